"""Figures 6 and 7: a few test frames with their labels and grids (sections 4.2 and 4.4)."""

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14, SYNTHIA_10, LabelSet
from semgrid_edu.plotting import class_legend, grid_labels
from semgrid_edu.storage.tensors import read_arrays, write_arrays
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import Scale, scale_named
from semgrid_edu.workshop.paper.training_runs import NetworkRun
from semgrid_edu.workshop.scoring.grids import crf_refinement, learned_log_g
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table

GRIDS, SHOWN = "grids.npz", (1 / 6, 1 / 2, 5 / 6)
"""The file with the grids, and which frames they are of: at these shares of the test frames, so that nobody chose them.
"""

KEPT = ("frame", "image", "truth", "true", "network", "refined")
"""The arrays in that file, as `FigureRun.grids` returns them."""


@dataclass(frozen=True)
class FigureRun(NetworkRun):
    """Keep images, truth and grids of a few test frames to look at, for Figures 6 and 7 (sections 4.2 and 4.4)."""

    kind = "figure"
    steps = len(SHOWN)
    trial_seconds = 1.0

    def work(self, root: Path, device: str) -> None:
        """Make the grids. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        net = self.network.trained(root, frames.camera)
        refine = crf_refinement(frames.spec.cell)
        numbers = [int(share * len(frames)) for share in SHOWN]
        log_g = [learned_log_g(net, frames[k]) for k in numbers]
        refined = [refine(g, frames.arrays["occupancy"][k]) for k, g in zip(numbers, log_g, strict=True)]
        kept = {name: frames.arrays[name][numbers] for name in ("image", "truth", "true")}
        called = {"network": np.argmax(log_g, axis=1), "refined": np.argmax(refined, axis=1)}
        kept |= {name: classes.astype(np.uint8) for name, classes in called.items()}
        write_arrays(self.folder(root) / GRIDS, {"frame": np.array(numbers), **kept})

    def grids(self, counted: RunCounts) -> dict[str, NDArray]:
        """Return what was kept.

        Parameters
        ----------
        counted : RunCounts
            What is known about the runs.

        Returns
        -------
        dict of str to (N, ...) arrays
            "frame" (N,), "image" (N, 3, h, w), and grids (N, H, W): "truth" as learnt, "true", "network", "refined".

        Raises
        ------
        DataError
            When the run hasn't ended, or its file is damaged.
        """
        return counted.of(self, KEPT, lambda root: read_arrays(self.folder(root) / GRIDS))


def figure_runs(scale: Scale, seeds: int) -> list[FigureRun]:
    """Return the runs of Figures 6 and 7: SegNet's first seed on the data of Tables 1, 2 and 3.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Not used: pictures are of one network.
    """
    data = {scale.kitti: "lidar", scale.chroma: "lidar", scale.synthia: "true"}
    scored = [scale.scored(name, "segnet", 1, truth) for name, truth in data.items()]
    return [FigureRun(run.network, run.frames) for (run,) in scored]


FIGURES = ("Figure 6", "Figure 6, INRIA-Chroma", "Figure 7")
"""The figures' parts, each on data of its own."""


def shown_frames(scale: Scale, seeds: int, counted: RunCounts) -> dict:
    """Return which frames the figures show, and where their grids are.

    Parameters
    ----------
    scale, seeds
        As `figure_runs` takes them.
    counted : RunCounts
        What is known about the runs.

    Returns
    -------
    dict
        "figures": by name the numbers of the "frames", and where the "grids" are, as a path in the folder of all runs.
    """
    runs = dict(zip(FIGURES, figure_runs(scale, seeds), strict=True))
    frames = {name: run.grids(counted)["frame"].tolist() for name, run in runs.items()}
    return {"figures": {name: {"frames": frames[name], "grids": f"{run.name}/{GRIDS}"} for name, run in runs.items()}}


TITLES = {"true": "true labels", "network": "SegNet"}
"""The titles of the grids that both figures show."""

_FIGURE_6 = (KITTI_14, {"truth": "labels made\nwith the LIDAR", **TITLES, "refined": "SegNet + CRF"})
PARTS: dict[str, tuple[LabelSet, dict[str, str]]] = dict(
    zip(FIGURES, (_FIGURE_6, _FIGURE_6, (SYNTHIA_10, TITLES)), strict=True)
)
"""The classes of each figure's part, and the titles of its grids from left to right."""


def figures_picture(result: dict, counted: RunCounts) -> Figure:
    """Draw the figures: one row per frame, the image and its grids.

    Parameters
    ----------
    result : dict
        From `shown_frames`, and the scale.
    counted : RunCounts
        What is known about the runs.
    """
    runs = dict(zip(FIGURES, figure_runs(scale_named(result["scale"]), result["seeds"]), strict=True))
    figure = plt.figure(figsize=(13, 8.5 * len(runs)), layout="constrained")
    for part, (name, run) in zip(figure.subfigures(len(runs), 1), runs.items(), strict=True):
        part.suptitle(name, x=0.02, ha="left")
        _draw(part, run.grids(counted), *PARTS[name])
    return figure


def _draw(part: SubFigure, grids: dict[str, NDArray], label_set: LabelSet, columns: dict[str, str]) -> None:
    """Draw the rows of one figure."""
    n_rows = len(grids["frame"])
    shape = grids["true"].shape[1:]
    spec = next(spec for spec in (GridSpec.compact(), GridSpec.paper()) if spec.shape == shape)
    axes = part.subplots(n_rows, 1 + len(columns), width_ratios=[2.2] + [1] * len(columns), squeeze=False)
    for row, line in enumerate(axes):
        line[0].imshow(grids["image"][row].transpose(1, 2, 0))
        line[0].set_axis_off()
        line[0].set_title(f"test frame {grids['frame'][row]}", fontsize="medium")
        for ax, (name, title) in zip(line[1:], columns.items(), strict=True):
            grid_labels(spec, grids[name][row], label_set, ax=ax, legend=False)
            ax.set_title(title if row == 0 else "", fontsize="medium")
            outer_left = ax is line[1]
            lowest = row == n_rows - 1  # only outer grids name their axes
            ax.tick_params(labelleft=outer_left, labelbottom=lowest)
            ax.set(xlabel=ax.get_xlabel() * lowest, ylabel=ax.get_ylabel() * outer_left)
    class_legend(axes[0, -1], label_set, grids["true"])


def figures_markdown(result: dict) -> str:
    """Return which frames the figures show, as Markdown.

    Parameters
    ----------
    result : dict
        From `shown_frames`.
    """
    rows = [[name, ", ".join(map(str, shown["frames"]))] for name, shown in result["figures"].items()]
    table = markdown_table([["", "test frames"], *rows])
    return f"Frames at fixed shares of the test split; nobody chose them.\n\n{table}"
