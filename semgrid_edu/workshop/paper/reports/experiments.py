"""The experiments of the paper, each with its runs and how its result is computed, written and drawn (section 4)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from semgrid_edu.workshop.paper.reports import pictures, tables, truth_costs
from semgrid_edu.workshop.paper.reports.ablations import ablation_runs, ablations, ablations_markdown
from semgrid_edu.workshop.paper.reports.judging import claims_markdown, claims_picture, judge_claims
from semgrid_edu.workshop.paper.runs import claim_runs
from semgrid_edu.workshop.paper.runs.paper import TABLE_1_SCORES, TABLE_2_SCORES
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.scheduler.runs import Run


@dataclass(frozen=True)
class Experiment:
    """One table or list of the paper.

    Parameters
    ----------
    title : str
        What it is called.
    runs : callable
        (scale, number of seeds) -> the runs that it is computed from.
    result : callable
        (scale, number of seeds, folder of all runs) -> the result; JSON can hold it.
    markdown : callable
        result -> Markdown.
    picture : callable
        (result, folder of all runs) -> Figure.
    field : str
        On which data: "kitti", "chroma" or "synthia", as `deviations` takes it.
    seeds : callable
        (scale) -> how many seeds it has by default.
    deviations : tuple of str
        In what it differs from the paper beside what all experiments on these data do, one sentence each.
    """

    title: str
    runs: Callable[[Scale, int], Sequence[Run]]
    result: Callable[[Scale, int, Path], dict]
    markdown: Callable[[dict], str]
    picture: Callable[[dict, Path], Figure]
    field: str = "kitti"
    seeds: Callable[[Scale], int] = lambda scale: scale.seeds
    deviations: tuple[str, ...] = ()


def _seed_by_seed(runs: Mapping[str, Sequence[Run]]) -> list[Run]:
    """Return all runs of the first seed, then of the second: a plan that is stopped has whole seeds."""
    return [run for alike in zip(*runs.values(), strict=True) for run in alike]


EXPERIMENTS = {
    "table1": Experiment(
        "Table 1: image networks, with and without the CRF",
        lambda *size: _seed_by_seed(claim_runs.table1_runs(*size) | {"baselines": claim_runs.table1_baselines(*size)}),
        lambda scale, seeds, root: tables.accuracy_result(
            claim_runs.table1_runs(scale, seeds), root, TABLE_1_SCORES, claim_runs.table1_baselines(scale, seeds)
        ),
        tables.accuracy_markdown,
        lambda result, _: pictures.accuracy_picture(result),
        seeds=lambda scale: scale.table1_seeds,
    ),
    "table2": Experiment(
        "Table 2: routes that were never driven in training",
        lambda *size: _seed_by_seed(claim_runs.table2_runs(*size)),
        lambda scale, seeds, root: tables.accuracy_result(claim_runs.table2_runs(scale, seeds), root, TABLE_2_SCORES),
        tables.accuracy_markdown,
        lambda result, _: pictures.accuracy_picture(result),
        "chroma",
    ),
    "table3": Experiment(
        "Table 3: confusion on data without any error",
        claim_runs.table3_runs,
        lambda scale, seeds, root: tables.confusion_result(claim_runs.table3_runs(scale, seeds), root),
        tables.confusion_markdown,
        lambda result, _: pictures.confusion_picture(result),
        "synthia",
    ),
    "claims": Experiment(
        "The nine claims",
        claim_runs.claims_plan,
        judge_claims,
        claims_markdown,
        lambda result, _: claims_picture(result),
    ),
    "ablations": Experiment(
        "Ablations", ablation_runs, ablations, ablations_markdown, lambda result, _: pictures.ablations_picture(result)
    ),
    "truth-costs": Experiment(
        "What training costs on truth that is made in other ways",
        truth_costs.truth_cost_runs,
        truth_costs.truth_costs,
        truth_costs.truth_costs_markdown,
        lambda result, _: truth_costs.truth_costs_picture(result),
        deviations=(
            "The paper learns from one kind of truth. Three choices of the policy laboratory aren't trained on: scans "
            "after the labelled one, and image labels for each scan, because the drives end with their one labelled "
            "frame; and the mask of what is visible to the LIDAR, which hardly changes the labels.",
        ),
    ),
    "figures": Experiment(
        "Figures 6 and 7",
        claim_runs.figure_runs,
        claim_runs.shown_frames,
        pictures.figures_markdown,
        pictures.figures_picture,
    ),
}
"""Every experiment by the name of its command."""
