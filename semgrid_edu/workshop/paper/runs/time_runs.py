"""Runs that measure time: how long two networks take for a frame, in turns (section 3.4)."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy import stats

from semgrid_edu.errors import DataError
from semgrid_edu.workshop.scoring.score_with_interval import Measured
from semgrid_edu.workshop.paper.runs.data_runs import ArraysRun
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.paper.runs.training_runs import GridStageRun
from semgrid_edu.networks import WEIGHTS, SemanticGridNet, load_net, unit_image
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.reading import read_json

TIMES = "times.json"
"""The file of the run."""

ROUNDS, FRAMES_EACH = 12, 3
"""How often the two take turns, and for how many frames each time."""


@dataclass(frozen=True)
class TimeRun(Run):
    """Measure how long two networks take for a frame.

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

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"times-{self.first.name.removeprefix('grid-')}-and{self.second.variant.name}"

    @property
    def needs(self) -> tuple[Run, ...]:
        """Both networks and the frames."""
        return self.first, self.second, self.frames

    @property
    def steps(self) -> int:
        """Number of frames that are timed."""
        return 2 * ROUNDS * FRAMES_EACH

    @property
    def pace(self) -> str:
        """It depends on the size of the networks."""
        return f"time {self.frames.preset}"

    def probe(self) -> float:
        """Return the seconds that a frame took on one core when this was written."""
        return 0.1

    def work(self, root: Path, device: str) -> None:
        """Time both. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        samples = [frames[k] for k in range(min(FRAMES_EACH, len(frames)))]
        nets = [load_net(run.folder(root) / WEIGHTS, frames.camera) for run in (self.first, self.second)]
        for net in nets:
            _seconds(net, samples)
        rounds = [[_seconds(net, samples) / len(samples) for net in nets] for _ in range(ROUNDS)]
        write_json(self.folder(root) / TIMES, {"seconds per frame": rounds})

    def seconds_per_frame(self, root: str | Path) -> np.ndarray:
        """Return the seconds per frame of both networks in each round.

        Parameters
        ----------
        root : path-like
            The folder of all runs.

        Returns
        -------
        (R, 2) float64
        """
        path = self.folder(root) / TIMES
        rounds = read_json(path).get("seconds per frame")
        try:
            return np.array(rounds, dtype=np.float64).reshape(-1, 2)
        except (ValueError, TypeError) as error:
            raise DataError(path, "the seconds per frame of two networks in each round", error) from error


@torch.inference_mode()
def _seconds(net: SemanticGridNet, samples: list) -> float:
    """Return how long a network takes for all samples."""
    began = time.perf_counter()
    for sample in samples:
        net(unit_image(sample.image)[None], sample.occupancy[None])
    return time.perf_counter() - began


def time_saved(rounds: np.ndarray) -> Measured:
    """Return the share of the second network's time that the first one saves.

    Parameters
    ----------
    rounds : (R, 2) float
        From `TimeRun.seconds_per_frame`.

    Returns
    -------
    dict
        As `measured` returns it; the interval is Student's, over the rounds, and "seeds" are the rounds.
    """
    saved = 1 - rounds[:, 0] / rounds[:, 1]
    half = stats.t.ppf(0.975, len(saved) - 1) * saved.std(ddof=1) / np.sqrt(len(saved))
    return {"mean": saved.mean(), "low": saved.mean() - half, "high": saved.mean() + half, "seeds": saved.tolist()}
