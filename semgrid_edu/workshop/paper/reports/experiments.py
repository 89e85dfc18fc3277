"""The experiments of the paper, each with its runs and how its result is computed, written and drawn (section 4)."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.paper.reports import pictures, tables
from semgrid_edu.workshop.paper.reports.ablations import ablation_runs, ablations, ablations_markdown
from semgrid_edu.workshop.paper.reports.judging import claims_markdown, claims_picture, judge_claims
from semgrid_edu.workshop.paper.reports.structure import (
    structure,
    structure_markdown,
    structure_picture,
    structure_plan,
)
from semgrid_edu.workshop.paper.reports.truth_costs import (
    truth_cost_runs,
    truth_costs,
    truth_costs_markdown,
    truth_costs_picture,
)
from semgrid_edu.workshop.paper.runs import claim_runs
from semgrid_edu.workshop.paper.runs.paper import TABLE_1_SCORES, TABLE_2_SCORES
from semgrid_edu.workshop.paper.runs.run_counts import RunCounts
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.scheduler.runs import Run


@dataclass(frozen=True)
class Experiment:
    """One table or list of the paper.

    Parameters
    ----------
    runs : callable
        (scale, number of seeds) -> the runs that it is computed from.
    result : callable
        (scale, number of seeds, what is known about the runs) -> the result; JSON can hold it.
    markdown : callable
        result -> Markdown.
    picture : callable
        (result, what is known about the runs) -> Figure.
    title : str
        What it is called.
    field : str
        On which data: "kitti", "chroma" or "synthia", as `deviations` takes it.
    seeds : str
        The field of `Scale` that says how many seeds it has by default.
    deviations : tuple of str
        In what it differs from the paper beside what all experiments on these data do, one sentence each.
    help : str
        What its command says of it.
    """

    runs: Callable[[Scale, int], Sequence[Run]]
    result: Callable[[Scale, int, RunCounts], dict]
    markdown: Callable[[dict], str]
    picture: Callable[[dict, RunCounts], Figure]
    title: str
    field: str = "kitti"
    seeds: str = "seeds"
    deviations: tuple[str, ...] = ()
    help: str = ""


def _seed_by_seed(runs: Iterable[Sequence[Run]]) -> list[Run]:
    """Return all runs of the first seed, then of the second: a plan that is stopped has whole seeds."""
    return [run for alike in zip(*runs, strict=True) for run in alike]


_WORDS = table_beside(__file__)


def _accuracy(name: str, runs: Callable, paper: Mapping) -> Experiment:
    """Return Table 1 or 2, from runs by image network and the paper's scores; baselines are those of SegNet."""

    def result(scale: Scale, seeds: int, counted: RunCounts) -> dict:
        networks = runs(scale, seeds)
        return tables.accuracy_result(networks, counted, paper, claim_runs.baselines_of(networks["segnet"]))

    def plan(scale: Scale, seeds: int) -> list[Run]:
        networks = runs(scale, seeds)
        return _seed_by_seed([*networks.values(), claim_runs.baselines_of(networks["segnet"])])

    return Experiment(plan, result, tables.accuracy_markdown, _of_result(pictures.accuracy_picture), **_WORDS[name])


def _table3(scale: Scale, seeds: int, counted: RunCounts) -> dict:
    networks = claim_runs.table3_runs(scale, seeds)
    return tables.confusion_result(networks, counted, claim_runs.baselines_of(networks))


def _table3_plan(scale: Scale, seeds: int) -> list[Run]:
    networks = claim_runs.table3_runs(scale, seeds)
    return _seed_by_seed([networks, claim_runs.baselines_of(networks)])


def _of_result(picture: Callable[[dict], Figure]) -> Callable[[dict, RunCounts], Figure]:
    return lambda result, _: picture(result)


_PARTS = {
    "table3": (_table3_plan, _table3, tables.confusion_markdown, _of_result(pictures.confusion_picture)),
    "claims": (claim_runs.claims_plan, judge_claims, claims_markdown, _of_result(claims_picture)),
    "structure": (structure_plan, structure, structure_markdown, _of_result(structure_picture)),
    "ablations": (ablation_runs, ablations, ablations_markdown, _of_result(pictures.ablations_picture)),
    "truth-costs": (truth_cost_runs, truth_costs, truth_costs_markdown, _of_result(truth_costs_picture)),
    "figures": (claim_runs.figure_runs, claim_runs.shown_frames, pictures.figures_markdown, pictures.figures_picture),
}

EXPERIMENTS = {
    "table1": _accuracy("table1", claim_runs.table1_runs, TABLE_1_SCORES),
    "table2": _accuracy("table2", claim_runs.table2_runs, TABLE_2_SCORES),
    **{name: Experiment(*parts, **_WORDS[name]) for name, parts in _PARTS.items()},
}
"""Every experiment by the name of its command."""
