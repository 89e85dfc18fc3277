"""Other runs of a trained network: overturned cars, and its speed (sections 3.4 and 4.4)."""

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
from semgrid_edu.datasets.kitti_raw import drive_folder
from semgrid_edu.errors import DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.networks import SemanticGridNet, unit_image
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.paper.data_runs import ArraysRun
from semgrid_edu.workshop.paper.run import Run
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.score_runs import CONFUSIONS
from semgrid_edu.workshop.paper.training_runs import GridStageRun, NetworkRun, seconds_per_step
from semgrid_edu.workshop.scoring.confusions import FrameConfusions, load_confusions, save_confusions
from semgrid_edu.workshop.scoring.grids import learned_log_g
from semgrid_edu.workshop.scoring.score_with_interval import ScoreWithInterval

OVERTURNED = "overturned cars"
"""The method: the network's grid, counted in the cells of overturned cars alone."""

UPRIGHT = "upright cars"
"""The same for upright cars on the same frames."""

UPRIGHT_RANGE = (10.0, 22.0)
"""At which distances upright cars count, metres: those of the overturned ones."""

TIMES = "times.json"
"""The file with the times."""

FRAME = "seconds per frame"
"""Its key for the times of whole frames."""

STEP = "seconds per training step"
"""Its key for the times of training steps."""

ROUNDS = 12
"""How often two networks take turns on frames."""

FRAMES_EACH = 3
"""How many frames a network gets at each turn."""

TRAINING_ROUNDS = 6
"""How often two networks take turns in training."""


@dataclass(frozen=True)
class OverturnedRun(NetworkRun):
    """Count what a network calls the cells of overturned cars (section 4.4)."""

    kind, trial_seconds = "overturned", 0.15

    def work(self, root: Path, device: str) -> None:
        """Count. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        counts = {OVERTURNED: [], UPRIGHT: []}
        net = self.network.trained(root, frames.camera)
        car = KITTI_14.index("car")
        for k, objects in enumerate(tqdm(self._objects(root), total=len(frames), unit="frame")):
            called = learned_log_g(net, frames[k]).argmax(axis=0)
            cars = cars_by_pose(objects)
            for method, some in counts.items():
                counted = boxes_on(frames.spec, cars[method]) & (frames.arrays["true"][k] == car)
                some.append(confusion_matrix(np.where(counted, car, IGNORE), called, len(KITTI_14)))
        stacked = {method: np.stack(some) for method, some in counts.items()}
        save_confusions(self.folder(root) / CONFUSIONS, FrameConfusions(frames.drives, stacked))

    def _objects(self, root: Path) -> Iterator[list[dict]]:
        """Yield the road users of each frame."""
        index = load_index(self.frames.data.dataset_dir(root))
        for (date, drive), numbers in index.frames_by_drive(self.frames.split).items():
            objects = read_json(drive_folder(index.root, date, drive) / "labels" / "objects.json")
            yield from (objects[f"{number:010d}"] for number in numbers)

    def confusions(self, counted: RunCounts, method: str, truth: str, band: str | None = None) -> FrameConfusions:
        """Return what was counted, by the true labels. Parameters are those of `CountingRun.confusions`."""
        return counted.confusions(self, method, method, lambda root: load_confusions(self.folder(root) / CONFUSIONS))


def cars_by_pose(objects: list[dict]) -> dict[str, list[dict]]:
    """Return the overturned cars, and the upright ones in `UPRIGHT_RANGE`, by method.

    Parameters
    ----------
    objects : list of dict
        Road users, with "class" and "centre", as a simulated drive's labels hold them.
    """
    cars = [one for one in objects if one["class"] == "car"]
    lying = [one for one in cars if one.get("overturned", False)]
    nearest, farthest = UPRIGHT_RANGE
    within = [one for one in cars if nearest <= np.hypot(*one["centre"][:2]) <= farthest]
    return {OVERTURNED: lying, UPRIGHT: [one for one in within if one not in lying]}


def boxes_on(spec: GridSpec, objects: list[dict], margin: float = 0.25) -> NDArray[np.bool_]:
    """Return which cells are in the boxes of road users, (H, W).

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
        c = np.cos(one["yaw"])
        s = np.sin(one["yaw"])
        ahead = c * x + s * y
        left = c * y - s * x
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
        both = [(run.architecture, run.params, run.kind) for run in (self.first, self.second)]
        steps = [[seconds_per_step(*one) for one in both] for _ in range(TRAINING_ROUNDS)]
        write_json(self.folder(root) / TIMES, {FRAME: rounds, STEP: steps})

    def rounds(self, counted: RunCounts, name: str) -> NDArray[np.float64]:
        """Return the seconds of both networks in each round, (R, 2).

        Parameters
        ----------
        counted : RunCounts
            What is known about the runs.
        name : str
            `FRAME` or `STEP`: per frame, or per training step.
        """
        return counted.of(self, (name,), lambda root: {name: self._read(root, name)})[name]

    def _read(self, root: Path, name: str) -> NDArray[np.float64]:
        path = self.folder(root) / TIMES
        try:
            return np.array(read_json(path).get(name), dtype=np.float64).reshape(-1, 2)
        except (ValueError, TypeError) as error:
            raise DataError(path, f"the {name} of two networks in each round", error) from error


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
        From `TimeRun.rounds`.

    Returns
    -------
    ScoreWithInterval
        The interval is Student's, over the rounds, and "seeds" are the rounds.
    """
    saved = 1 - rounds[:, 0] / rounds[:, 1]
    low, high = stats.ttest_1samp(saved, 0).confidence_interval(0.95)
    return {"mean": saved.mean(), "low": low, "high": high, "seeds": saved.tolist()}


def p_not_saved(rounds: NDArray) -> float:
    """Return Student's one-sided p-value against the statement that time is saved.

    Parameters
    ----------
    rounds : (R, 2) float
        As `time_saved` takes them.
    """
    return float(stats.ttest_1samp(1 - rounds[:, 0] / rounds[:, 1], 0, alternative="less").pvalue)
