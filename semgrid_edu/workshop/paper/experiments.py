"""The experiments of the paper, each with its runs and how its result is computed and written (section 4)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from matplotlib.figure import Figure

from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.paper import figures, scales, tables, verdicts
from semgrid_edu.workshop.paper.ablations import ablation_runs, ablations, ablations_markdown, rows_without_runs
from semgrid_edu.workshop.paper.data_runs import RECIPE_OF, frame_counts
from semgrid_edu.workshop.paper.published import TABLE_1_SCORES, TABLE_2_SCORES
from semgrid_edu.workshop.paper.run import Run
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import Scale
from semgrid_edu.workshop.paper.truth_costs import truth_cost_runs, truth_costs, truth_costs_markdown
from semgrid_edu.workshop.simulation.sensors.rig import KITTI_AHEAD


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
    picture : callable, optional
        (result, what is known about the runs) -> Figure, for what only a picture can show.
    rows_without_runs : callable, optional
        As `result`, -> the rows that the result leaves out, because they were added after the counts were kept. Without
        it every run is needed.
    title : str
        What it is called.
    field : str
        On which data: "kitti", "chroma" or "synthia", as `deviations` takes it.
    seeds : str
        The field of `Scale` with its default number of seeds.
    deviations : tuple of str
        In what it differs from the paper beside what all experiments on these data do, one sentence each.
    help : str
        The help of its command.
    """

    runs: Callable[[Scale, int], Sequence[Run]]
    result: Callable[[Scale, int, RunCounts], dict]
    markdown: Callable[[dict], str]
    picture: Callable[[dict, RunCounts], Figure] | None = None
    rows_without_runs: Callable[[Scale, int, RunCounts], list[str]] | None = None
    title: str = ""
    field: str = "kitti"
    seeds: str = "seeds"
    deviations: tuple[str, ...] = ()
    help: str = ""


def _table(name: str, runs: Callable, result: Callable, markdown: Callable) -> Experiment:
    """Return one of Tables 1 to 3, whose networks are compared with baselines fitted to SegNet's training frames."""

    def plan(scale: Scale, seeds: int) -> list[Run]:
        networks = runs(scale, seeds)
        by_seed = zip(*networks.values(), scales.baselines_of(networks["segnet"]), strict=True)
        return [run for alike in by_seed for run in alike]  # a plan that is stopped has whole seeds

    def computed(scale: Scale, seeds: int, counted: RunCounts) -> dict:
        networks = runs(scale, seeds)
        return result(networks, counted, scales.baselines_of(networks["segnet"]))

    return Experiment(plan, computed, markdown, **_WORDS[name])


_WORDS = table_beside(__file__)
_DIFFERENCES = table_beside(__file__, "deviations")
_ACCURACY = {"table1": (scales.table1_runs, TABLE_1_SCORES), "table2": (scales.table2_runs, TABLE_2_SCORES)}
_OTHERS = {
    "claims": (verdicts.claims_plan, verdicts.judge_claims, verdicts.claims_markdown),
    "ablations": (ablation_runs, ablations, ablations_markdown, None, rows_without_runs),
    "truth-costs": (truth_cost_runs, truth_costs, truth_costs_markdown),
    "figures": (figures.figure_runs, figures.shown_frames, figures.figures_markdown, figures.figures_picture),
}

EXPERIMENTS = {
    **{
        name: _table(name, runs, partial(tables.accuracy_result, paper=paper), tables.accuracy_markdown)
        for name, (runs, paper) in _ACCURACY.items()
    },
    "table3": _table("table3", scales.table3_runs, tables.confusion_result, tables.confusion_markdown),
    **{name: Experiment(*parts, **_WORDS[name]) for name, parts in _OTHERS.items()},
}
"""Every experiment by the name of its command."""


def deviations(scale: Scale, field: str, beside_gpu: list[str] | None = None) -> list[str]:
    """Return in what an experiment differs from the paper's, one sentence each.

    Parameters
    ----------
    scale : Scale
        How large it is.
    field : str
        On which data: "kitti", "chroma" or "synthia".
    beside_gpu : list of str, optional
        The training runs that were done on the CPU when others were done on a GPU; None when all were done on the CPU.
    """
    data = getattr(scale, field)
    preset = _DIFFERENCES[scale.preset]
    counts = frame_counts(data)
    numbers = {
        "data": data,
        "frames": " and ".join(f"{frames} to {split} in {n} drives" for split, (frames, n) in counts.items()),
        "drives": counts["test"][1],
        "image_steps": scale.image_iterations,
        "grid_steps": scale.grid_iterations,
    }
    lines = [*_DIFFERENCES[field]["data"]]
    if RECIPE_OF[data].rig == KITTI_AHEAD and not RECIPE_OF[data].dense:
        lines.append(_DIFFERENCES["scanner"]["columns"])
    lines += [*_DIFFERENCES[field]["labels"], *preset["networks"]]
    if beside_gpu is not None:
        names = dict.fromkeys(name.rsplit("-seed", 1)[0] for name in beside_gpu)
        on_cpu = f" Trained on the CPU, in float32: {', '.join(names)}." if names else ""
        lines.append(_DIFFERENCES["gpu"]["all"] + on_cpu)
    lines += [*(preset["chosen"] if field == "kitti" else ()), *_DIFFERENCES[field]["numbers"]]
    return [line.format(**numbers) for line in lines]
