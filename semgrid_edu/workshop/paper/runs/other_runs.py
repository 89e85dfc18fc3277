"""Runs that look at a network otherwise: cars on their tops, its time, and grids for the figures (sections 3.4, 4)."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import stats
from tqdm.auto import tqdm

from semgrid_edu.datasets.index import load_index
from semgrid_edu.datasets.readers.kitti_raw import drive_folder
from semgrid_edu.errors import DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.networks import SemanticGridNet, unit_image
from semgrid_edu.pipeline import Stages
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.reading import read_json
from semgrid_edu.storage.tensors import read_arrays, write_arrays
from semgrid_edu.workshop.paper.runs.data_runs import ArraysRun
from semgrid_edu.workshop.paper.runs.run_counts import RunCounts
from semgrid_edu.workshop.paper.runs.score_runs import CONFUSIONS
from semgrid_edu.workshop.paper.runs.training_runs import GridStageRun, NetworkRun
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.scoring.confusions import FrameConfusions, load_confusions, save_confusions
from semgrid_edu.workshop.scoring.grids import learned_log_g
from semgrid_edu.workshop.scoring.score_with_interval import ScoreWithInterval

OVERTURNED = "overturned cars"
"""The method: the network's own grid, of which only the cells of overturned cars are counted."""

TIMES, SECONDS, ROUNDS, FRAMES_EACH = "times.json", "seconds per frame", 12, 3
"""The file with the times, what it holds, how often two networks take turns, and for how many frames each time."""

GRIDS, SHOWN = "grids.npz", (1 / 6, 1 / 2, 5 / 6)
"""The file with the grids, and which frames they are of: at these shares of the test frames, so that nobody chose them.
"""

KEPT = ("frame", "image", "truth", "true", "network", "refined")
"""The arrays in that file, as `FigureRun.grids` returns them."""


@dataclass(frozen=True)
class OverturnedRun(NetworkRun):
    """Count what a network calls the cells of overturned cars (section 4.4)."""

    kind, trial_seconds = "overturned", 0.15

    def work(self, root: Path, device: str) -> None:
        """Count. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        net, car, counts = self.network.trained(root, frames.camera), KITTI_14.index("car"), []
        for k, objects in enumerate(tqdm(self._objects(root), total=len(frames), unit="frame")):
            called = learned_log_g(net, frames[k]).argmax(axis=0)
            lying = [one for one in objects if one["class"] == "car" and one.get("overturned", False)]
            counted = boxes_on(frames.spec, lying) & (frames.arrays["true"][k] == car)
            counts.append(confusion_matrix(np.where(counted, car, IGNORE), called, len(KITTI_14)))
        save_confusions(self.folder(root) / CONFUSIONS, FrameConfusions(frames.drives, {OVERTURNED: np.stack(counts)}))

    def _objects(self, root: Path) -> Iterator[list[dict]]:
        """Yield the road users of each frame."""
        index = load_index(self.frames.data.dataset_dir(root))
        for (date, drive), numbers in index.frames_by_drive(self.frames.split).items():
            objects = read_json(drive_folder(index.root, date, drive) / "labels" / "objects.json")
            yield from (objects[f"{number:010d}"] for number in numbers)

    def confusions(self, counted: RunCounts, method: str, truth: str, band: str | None = None) -> FrameConfusions:
        """Return what was counted, by the true labels. Parameters are those of `CountingRun.confusions`."""
        return counted.confusions(self, method, method, lambda root: load_confusions(self.folder(root) / CONFUSIONS))


def boxes_on(spec: GridSpec, objects: list[dict], margin: float = 0.25) -> NDArray[np.bool_]:
    """Return which cells lie in the boxes of road users, (H, W).

    Parameters
    ----------
    spec : GridSpec
        The grid.
    objects : list of dict
        With "centre", "size" and "yaw" in the grid frame, as a simulated drive's labels hold them.
    margin : float
        By how much each side is moved outwards, metres: a cell counts when a part of it is covered.
    """
    inside = np.zeros(spec.shape, bool)
    for one in objects:
        x, y = np.moveaxis(spec.centers() - np.array(one["centre"][:2]), -1, 0)
        c, s = np.cos(one["yaw"]), np.sin(one["yaw"])
        ahead, left = c * x + s * y, c * y - s * x
        inside |= (np.abs(ahead) <= one["size"][0] / 2 + margin) & (np.abs(left) <= one["size"][1] / 2 + margin)
    return inside


@dataclass(frozen=True)
class TimeRun(Run):
    """Measure how long two networks take for a frame, in turns (section 3.4).

    Parameters
    ----------
    first, second : GridStageRun
        The runs that train the two networks.
    frames : ArraysRun
        The frames.
    """

    first: GridStageRun
    second: GridStageRun
    frames: ArraysRun
    kind, steps, trial_seconds = "times", 2 * ROUNDS * FRAMES_EACH, 0.1
    tag = property(lambda self: f"{self.first.tag}-and{self.second.variant.name}")
    pace = property(lambda self: f"time {self.frames.preset}")

    def work(self, root: Path, device: str) -> None:
        """Time both. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        samples = [frames[k] for k in range(min(FRAMES_EACH, len(frames)))]
        nets = [run.trained(root, frames.camera) for run in (self.first, self.second)]
        for net in nets:
            _seconds(net, samples)
        rounds = [[_seconds(net, samples) / len(samples) for net in nets] for _ in range(ROUNDS)]
        write_json(self.folder(root) / TIMES, {SECONDS: rounds})

    def seconds_per_frame(self, counted: RunCounts) -> NDArray[np.float64]:
        """Return the seconds per frame of both networks in each round, (R, 2).

        Parameters
        ----------
        counted : RunCounts
            What is known about the runs.
        """
        return counted.of(self, (SECONDS,), lambda root: {SECONDS: self._rounds(root)})[SECONDS]

    def _rounds(self, root: Path) -> NDArray[np.float64]:
        """Read the seconds per frame."""
        path = self.folder(root) / TIMES
        try:
            return np.array(read_json(path).get(SECONDS), dtype=np.float64).reshape(-1, 2)
        except (ValueError, TypeError) as error:
            raise DataError(path, "the seconds per frame of two networks in each round", error) from error


@torch.inference_mode()
def _seconds(net: SemanticGridNet, samples: list) -> float:
    """Return how long a network takes for all samples."""
    began = time.perf_counter()
    for sample in samples:
        net(unit_image(sample.image)[None], sample.occupancy[None])
    return time.perf_counter() - began


def time_saved(rounds: NDArray) -> ScoreWithInterval:
    """Return the share of the second network's time that the first one saves.

    Parameters
    ----------
    rounds : (R, 2) float
        From `TimeRun.seconds_per_frame`.

    Returns
    -------
    ScoreWithInterval
        The interval is Student's, over the rounds, and "seeds" are the rounds.
    """
    saved = 1 - rounds[:, 0] / rounds[:, 1]
    half = stats.t.ppf(0.975, len(saved) - 1) * saved.std(ddof=1) / np.sqrt(len(saved))
    return {"mean": saved.mean(), "low": saved.mean() - half, "high": saved.mean() + half, "seeds": saved.tolist()}


@dataclass(frozen=True)
class FigureRun(NetworkRun):
    """Keep images, truth and grids of a few test frames to look at, for Figures 6 and 7 (sections 4.2 and 4.4)."""

    kind, steps, trial_seconds = "figure", len(SHOWN), 1.0

    def work(self, root: Path, device: str) -> None:
        """Make the grids. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        net = self.network.trained(root, frames.camera)
        refine, numbers = Stages.of(net).refine, [int(share * len(frames)) for share in SHOWN]
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
