"""What the paper's few long runs do to the interval: SegNet on streets and on runs, in all pairs (section 4.3)."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import METRICS, pixel_accuracy
from semgrid_edu.workshop.paper.reports.deviations import frame_counts
from semgrid_edu.workshop.paper.reports.forest import draw_scores, legend_entries
from semgrid_edu.workshop.paper.runs.claim_runs import structure_runs
from semgrid_edu.workshop.paper.runs.run_counts import RunCounts
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.paper.runs.score_runs import by_seed
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.scoring.grids import NETWORK
from semgrid_edu.workshop.scoring.score_with_interval import every_metric, markdown_table, score_with_interval, shown
from semgrid_edu.workshop.scoring.statistics import drive_estimate

UNITS = ("drives", "frames")
"""What half-widths are computed from: drives, as everywhere, and frames as if none looked like another."""


def structure_plan(scale: Scale, seeds: int) -> list[Run]:
    """Return all runs. Parameters are those of `table1_runs`."""
    return [run for some in structure_runs(scale, seeds).values() for run in some]


def structure(scale: Scale, seeds: int, counted: RunCounts) -> dict:
    """Return SegNet's scores by what it learned from and what it is tested on, from ended runs.

    Parameters are those of `ablations`.

    Returns
    -------
    dict
        "rows", each with what it "learned" from and was "tested" on, the numbers of its test frames and drives, its
        "scores" against labels made with the LIDAR, by unit the "half-width" of the 95 % interval of pixel accuracy,
        and the lowest and the highest of the "drives"' own.
    """
    rows = []
    for (learned, tested), runs in structure_runs(scale, seeds).items():
        counts = by_seed(runs, counted, NETWORK, "lidar")
        by_frame = np.stack([run.frame_confusions(counted, NETWORK, "lidar") for run in runs])
        taken = zip(UNITS, (counts, by_frame), strict=True)  # as if independent
        widths = {unit: drive_estimate(some, pixel_accuracy).half_width(0.95) for unit, some in taken}
        drives = [pixel_accuracy(matrix) for matrix in counts.sum(axis=0)]  # single ones, all seeds together
        scores = every_metric(score_with_interval, KITTI_14, counts)
        about = {"learned": learned, "tested": tested, "frames and drives": frame_counts(tested)["test"]}
        rows.append(about | {"scores": scores, "half-width": widths, "drives": [min(drives), max(drives)]})
    return {"rows": rows}


def structure_markdown(result: dict) -> str:
    """Return the scores, and what the number of drives does to the interval, as Markdown.

    Parameters
    ----------
    result : dict
        From `structure`.
    """
    scores, widths = [["learned from", "tested on", *METRICS]], [["learned from", "tested on", *_WIDTHS]]
    for row in result["rows"]:
        name, (frames, drives) = [row["learned"], row["tested"]], row["frames and drives"]
        scores.append([*name, *(shown(row["scores"]["all"][metric]) for metric in METRICS)])
        numbers = [*(row["half-width"][unit] for unit in UNITS), *row["drives"]]
        widths.append([*name, str(frames), str(drives), *(f"{100 * number:.1f}" for number in numbers)])
    return "\n\n".join([_SCORES, markdown_table(scores), _HALVES, markdown_table(widths)])


_WIDTHS = ("frames", "drives", "half-width by drives", "by frames", "lowest drive", "highest drive")
_SCORES = """\
SegNet without the CRF, all labelled cells, labels made with the LIDAR. The labels that the paper takes from Zhang et \
al. come from eight runs, four of them for testing, so its Table 1 rests on about four test runs. Few drives have no \
interval."""
_HALVES = """\
Half the width of a 95 % interval of pixel accuracy, points, computed from drives as in all tables, and from frames as \
if they were independent, which frames of one drive aren't. With few drives the first number is itself hardly known, \
and the second is too small. Beside them the drives that are easiest and hardest:"""


def structure_picture(result: dict) -> Figure:
    """Draw pixel accuracy by what is learned from and tested on, with each seed.

    Parameters
    ----------
    result : dict
        From `structure`.
    """
    rows = {
        f"learned from {row['learned']},\ntested on {row['tested']}": row["scores"]["all"]["pixel accuracy"]
        for row in result["rows"]
    }
    figure, ax = plt.subplots(figsize=(8, 1.6 + 0.5 * len(rows)), layout="constrained")
    draw_scores(ax, rows)
    ax.invert_yaxis()
    ax.set(xlabel="pixel accuracy, per cent of all labelled cells; labels made with the LIDAR")
    figure.legend(*legend_entries(ax), loc="outside lower center", ncols=3)
    return figure
