"""The experiments of the paper, each with the runs that it needs and what it makes of them (section 4)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from semgrid_edu.labels import KITTI_14
from semgrid_edu.workshop.paper.reports.ablations import ablation_runs, ablations, ablations_markdown
from semgrid_edu.workshop.paper.reports.accuracy_tables import (
    accuracy_markdown,
    accuracy_rows,
    baseline_gains,
    crf_gains,
    network_gains,
)
from semgrid_edu.workshop.paper.reports.confusion_table import confusion_markdown, confusion_result
from semgrid_edu.workshop.paper.reports.judging import claim_runs, claims_markdown, claims_picture, judge_claims
from semgrid_edu.workshop.paper.reports.pictures import (
    ablations_picture,
    accuracy_picture,
    confusion_picture,
    figures_markdown,
    figures_picture,
)
from semgrid_edu.workshop.paper.reports.truth_costs import (
    truth_cost_runs,
    truth_costs,
    truth_costs_markdown,
    truth_costs_picture,
)
from semgrid_edu.workshop.paper.runs.claim_runs import (
    figure_runs,
    shown_frames,
    table1_baselines,
    table1_runs,
    table2_runs,
    table3_runs,
)
from semgrid_edu.workshop.paper.runs.paper import TABLE_1_SCORES, TABLE_2_SCORES
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.paper.runs.score_runs import ScoreRun
from semgrid_edu.workshop.scheduler.runs import Run


@dataclass(frozen=True)
class Experiment:
    """One table or list of the paper.

    Parameters
    ----------
    title : str
        What it is called.
    field : str
        On which data: "kitti", "chroma" or "synthia", as `deviations` takes it.
    seeds : callable
        (scale) -> how many seeds it has by default.
    runs : callable
        (scale, number of seeds) -> the runs that it is computed from.
    result : callable
        (scale, number of seeds, folder of all runs) -> the result; JSON can hold it.
    markdown : callable
        result -> Markdown.
    picture : callable
        (result, folder of all runs) -> Figure.
    deviations : tuple of str
        In what it differs from the paper beside what all experiments on these data do, one sentence each.
    """

    title: str
    field: str
    seeds: Callable[[Scale], int]
    runs: Callable[[Scale, int], Sequence[Run]]
    result: Callable[[Scale, int, Path], dict]
    markdown: Callable[[dict], str]
    picture: Callable[[dict, Path], Figure]
    deviations: tuple[str, ...] = ()


def _seed_by_seed(runs: Mapping[str, Sequence[Run]]) -> list[Run]:
    """Return all runs of the first seed, then of the second: a plan that is stopped has whole seeds."""
    return [run for alike in zip(*runs.values(), strict=True) for run in alike]


def _accuracies(runs: dict[str, list[ScoreRun]], root: Path, paper: dict) -> dict:
    gains = crf_gains(runs, root, KITTI_14) + network_gains(runs, root, KITTI_14)
    return {"rows": accuracy_rows(runs, root, KITTI_14, paper), "differences": gains}


def _table1(scale: Scale, seeds: int, root: Path) -> dict:
    """Return Table 1 with the differences from the baselines."""
    runs, baselines = table1_runs(scale, seeds), table1_baselines(scale, seeds)
    result = _accuracies(runs, root, TABLE_1_SCORES)
    result["differences"] += baseline_gains(runs["segnet"], baselines, root, KITTI_14)
    return result


EXPERIMENTS = {
    "table1": Experiment(
        "Table 1: image networks, with and without the CRF",
        "kitti",
        lambda scale: scale.table1_seeds,
        lambda scale, seeds: _seed_by_seed(table1_runs(scale, seeds) | {"baselines": table1_baselines(scale, seeds)}),
        _table1,
        accuracy_markdown,
        lambda result, _: accuracy_picture(result),
    ),
    "table2": Experiment(
        "Table 2: routes that were never driven in training",
        "chroma",
        lambda scale: scale.seeds,
        lambda scale, seeds: _seed_by_seed(table2_runs(scale, seeds)),
        lambda scale, seeds, root: _accuracies(table2_runs(scale, seeds), root, TABLE_2_SCORES),
        accuracy_markdown,
        lambda result, _: accuracy_picture(result),
    ),
    "table3": Experiment(
        "Table 3: confusion on data without any error",
        "synthia",
        lambda scale: scale.seeds,
        table3_runs,
        lambda scale, seeds, root: confusion_result(table3_runs(scale, seeds), root),
        confusion_markdown,
        lambda result, _: confusion_picture(result),
    ),
    "claims": Experiment(
        "The nine claims",
        "kitti",
        lambda scale: scale.seeds,
        claim_runs,
        judge_claims,
        claims_markdown,
        lambda result, _: claims_picture(result),
    ),
    "ablations": Experiment(
        "Ablations",
        "kitti",
        lambda scale: scale.seeds,
        ablation_runs,
        ablations,
        ablations_markdown,
        lambda result, _: ablations_picture(result),
    ),
    "truth-costs": Experiment(
        "What training costs on truth that is made in other ways",
        "kitti",
        lambda scale: scale.seeds,
        truth_cost_runs,
        truth_costs,
        truth_costs_markdown,
        lambda result, _: truth_costs_picture(result),
        (
            "The paper learns from one kind of truth. Three choices of the policy laboratory aren't trained on: scans "
            "after the labelled one, and image labels for each scan, because the drives end with their one labelled "
            "frame; and the mask of what is visible to the LIDAR, which hardly changes the labels.",
        ),
    ),
    "figures": Experiment(
        "Figures 6 and 7",
        "kitti",
        lambda scale: scale.seeds,
        figure_runs,
        shown_frames,
        figures_markdown,
        figures_picture,
    ),
}
"""Every experiment by the name of its command."""
