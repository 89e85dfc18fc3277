"""Runs that keep a few grids to look at, for Figures 6 and 7 (sections 4.2 and 4.4)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.workshop.scoring.learned_grids import learned_log_g
from semgrid_edu.workshop.paper.runs.data_runs import ArraysRun
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.paper.runs.training_runs import GridStageRun
from semgrid_edu.networks import WEIGHTS, load_net
from semgrid_edu.pipeline import Stages
from semgrid_edu.storage.tensors import read_arrays, write_arrays

GRIDS = "grids.npz"
"""The file of the run."""

SHOWN = (1 / 6, 1 / 2, 5 / 6)
"""Which frames are shown: at these shares of the test frames, so that nobody chose them."""


@dataclass(frozen=True)
class FigureRun(Run):
    """Keep images, truth and grids of a few test frames.

    Parameters
    ----------
    network : GridStageRun
        The run that trains the network.
    frames : ArraysRun
        The test frames.
    """

    network: GridStageRun
    frames: ArraysRun

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"figure-{self.network.name.removeprefix('grid-')}-on-{self.frames.name.removeprefix('arrays-')}"

    @property
    def needs(self) -> tuple[Run, ...]:
        """The network and the frames."""
        return self.network, self.frames

    @property
    def steps(self) -> int:
        """Number of frames."""
        return len(SHOWN)

    @property
    def pace(self) -> str:
        """It depends on the size of the network."""
        return f"figure {self.frames.preset}"

    def probe(self) -> float:
        """Return the seconds that a frame took on one core when this was written."""
        return 1.0

    def work(self, root: Path, device: str) -> None:
        """Make the grids. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        net = load_net(self.network.folder(root) / WEIGHTS, frames.camera)
        refine = Stages.of(net).refine
        numbers = [int(share * len(frames)) for share in SHOWN]
        log_g = [learned_log_g(net, frames[k]) for k in numbers]
        refined = [refine(g, frames.arrays["occupancy"][k]) for k, g in zip(numbers, log_g, strict=True)]
        kept = {
            "frame": np.array(numbers),
            "image": frames.arrays["image"][numbers],
            "truth": frames.arrays["truth"][numbers],
            "true": frames.arrays["true"][numbers],
            "network": np.argmax(log_g, axis=1).astype(np.uint8),
            "refined": np.argmax(refined, axis=1).astype(np.uint8),
        }
        write_arrays(self.folder(root) / GRIDS, kept)

    def grids(self, root: str | Path) -> dict[str, NDArray]:
        """Return what was kept.

        Parameters
        ----------
        root : path-like
            The folder of all runs.

        Returns
        -------
        dict of str to (N, ...) arrays
            "frame" (N,), "image" (N, 3, h, w), and grids (N, H, W): "truth" as learnt, "true", "network", "refined".

        Raises
        ------
        DataError
            When the run hasn't ended, or its file is damaged.
        """
        return read_arrays(self.folder(root) / GRIDS)


def figure_runs(scale: Scale, seeds: int) -> list[FigureRun]:
    """Return the runs of Figures 6 and 7: SegNet's first seed on the data of Table 1 and of Table 3.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Not used: pictures are of one network.

    Returns
    -------
    list of FigureRun
    """
    first, second = (
        scale.scored(data, "segnet", 0, truth) for data, truth in ((scale.kitti, "lidar"), (scale.synthia, "true"))
    )
    return [FigureRun(run.network, run.frames) for run in (first, second)]


def shown_frames(scale: Scale, seeds: int, root: Path) -> dict:
    """Return which frames the figures show, and where their grids are.

    Parameters
    ----------
    scale, seeds
        As `figure_runs` takes them.
    root : Path
        The folder of all runs.

    Returns
    -------
    dict
        "figures": by name the numbers of the "frames", and where the "grids" are, as a path below `root`.
    """
    names = ("Figure 6", "Figure 7")
    return {
        "figures": {
            name: {"frames": run.grids(root)["frame"].tolist(), "grids": f"{run.name}/{GRIDS}"}
            for name, run in zip(names, figure_runs(scale, seeds), strict=True)
        }
    }
