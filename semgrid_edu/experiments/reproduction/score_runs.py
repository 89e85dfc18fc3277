"""Runs that score: a trained network on the frames of a test split, drive by drive and by distance (section 4.2)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams, at_temperature, mean_field, reliability, unary_from_log_probability
from semgrid_edu.crf.temperature import Reliability
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.experiments.confusions import FrameConfusions, load_confusions, save_confusions
from semgrid_edu.experiments.learned_grids import learned_log_g
from semgrid_edu.experiments.reproduction.calibration_errors import EXACT, CalibrationError
from semgrid_edu.experiments.reproduction.data_runs import RECIPE_OF, ArraysRun
from semgrid_edu.experiments.reproduction.runs import Run
from semgrid_edu.experiments.reproduction.training_runs import GridStageRun
from semgrid_edu.grid import GridSpec
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.networks import WEIGHTS, load_net
from semgrid_edu.storage.arrays import read_arrays, write_arrays

CONFUSIONS, RELIABILITY = "confusions.npz", "reliability.npz"
"""The files of a score run: confusion matrices by frame, and how often each method is right when it is how sure."""

NETWORK, WITH_CRF, WITH_SEARCHED = "network", "network + CRF", "network + searched CRF"
"""The methods: the network's own grid, refined with the CRF's default parameters, and with those that were searched."""

SEARCHED = {
    "segnet": (1.1622, (1.82, 3.42, 1.79, 0.0756, 0.536)),
    "fcn": (1.2057, (0.947, 1.64, 26.9, 0.868, 1.27)),
    "deeplab": (1.2656, (1.32, 2.36, 18.7, 0.873, 0.957)),
}
"""For each image network the temperature and the CRF's five parameters that `semgrid-edu search-crf` chose for pixel
accuracy on validation drives, with the shipped network of that kind (docs/results/crf_search*.json)."""

BANDS = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, np.inf)
"""Limits of the bands of distance from the LIDAR by which cells are counted, metres."""


def band_names() -> list[str]:
    """Return the names of the bands of distance, nearest first."""
    return [f"{low:g}-{high:g} m" if np.isfinite(high) else f"beyond {low:g} m" for low, high in pairwise(BANDS)]


@dataclass(frozen=True)
class ScoreRun(Run):
    """Score a network on the frames of a split.

    Parameters
    ----------
    network : GridStageRun
        The training of the network.
    frames : ArraysRun
        The frames; with labels made with the LIDAR, they are scored against these and against the true ones.
    crf : bool
        Whether the CRF refines the grids as well, with default and with searched parameters.
    calibration : CalibrationError
        What the network believes wrongly about where the camera stands.
    """

    network: GridStageRun
    frames: ArraysRun
    crf: bool = True
    calibration: CalibrationError = EXACT

    @property
    def name(self) -> str:
        """The name of its folder."""
        where = self.frames.name.removeprefix("arrays-")
        return f"score-{self.network.name.removeprefix('grid-')}-on-{where}{self.calibration.name}" + "-crf" * self.crf

    @property
    def needs(self) -> tuple[Run, ...]:
        """The network and the frames."""
        return self.network, self.frames

    @property
    def steps(self) -> int:
        """Number of frames that are scored."""
        routes = RECIPE_OF[self.frames.data.data].routes
        return sum(len(route.labelled) for route in routes if route.split == self.frames.split)

    @property
    def pace(self) -> str:
        """It depends on the network, and the CRF takes the most time."""
        return f"score {self.network.image_stage.segmenter} {self.frames.preset}" + " with CRF" * self.crf

    def probe(self) -> float:
        """Return the seconds that a frame took on one core when this was written."""
        return (0.8 if self.crf else 0.15) * (1 if self.frames.preset == "compact" else 10)

    def work(self, root: Path, device: str) -> None:
        """Score the network. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        net = load_net(self.network.folder(root) / WEIGHTS, self.calibration.applied_to(frames.camera))
        refinements = self._refinements(frames.spec.cell) if self.crf else {}
        counted = _Counts(frames)
        for k in tqdm(range(len(frames)), desc="score", unit="frame"):
            sample = frames[k]
            log_g, o = learned_log_g(net, sample), sample.occupancy.numpy()
            counted.add(NETWORK, k, np.exp(log_g))
            for method, refine in refinements.items():
                counted.add(method, k, refine(log_g, o))
        write_arrays(self.folder(root) / RELIABILITY, counted.sure)
        save_confusions(self.folder(root) / CONFUSIONS, counted.confusions())

    def _refinements(self, cell: float) -> dict[str, Callable]:
        temperature, searched = SEARCHED[self.network.image_stage.segmenter]
        return {
            WITH_CRF: partial(_refined, CrfParams.for_cells(cell), 1.0),
            WITH_SEARCHED: partial(_refined, CrfParams(*searched), temperature),
        }

    def confusions(self, root: str | Path, method: str, truth: str, band: str | None = None) -> FrameConfusions:
        """Return the confusion matrices of one method.

        Parameters
        ----------
        root : path-like
            The folder of all runs.
        method : str
            Such as `NETWORK`.
        truth : str
            Against which labels: "true" or "lidar".
        band : str, optional
            One of `band_names`; all distances when left out.

        Returns
        -------
        FrameConfusions
            With one method, called `method`.
        """
        found = load_confusions(self.folder(root) / CONFUSIONS)
        bands = [band] if band else band_names()
        return FrameConfusions(found.drives, {method: sum(found.counts[_key(method, truth, one)] for one in bands)})

    def reliability(self, root: str | Path, method: str) -> Reliability:
        """Return how often a method is right when it is how sure, over all frames, by the true labels.

        Parameters
        ----------
        root : path-like
            The folder of all runs.
        method : str
            Such as `NETWORK`.
        """
        cells, confidence, right = read_arrays(self.folder(root) / RELIABILITY)[method]
        some = np.maximum(cells, 1)
        return Reliability(confidence / some, right / some, cells.astype(np.int64))


def _refined(params: CrfParams, temperature: float, log_g: NDArray, o: NDArray) -> NDArray:
    """Refine a grid by the CRF, after it was made less or more sure."""
    return mean_field(unary_from_log_probability(at_temperature(log_g, temperature)), o, params)


class _Counts:
    """What is counted over the frames: confusion matrices by method, truth and band of distance, and reliability."""

    def __init__(self, frames: TrainingSet) -> None:
        self.frames = frames
        truth, true = frames.arrays["truth"], frames.arrays["true"]
        self.truths = {"true": true} if truth is true else {"lidar": truth, "true": true}
        self.band = distance_bands(frames.spec)
        self.matrices: dict[str, list[NDArray]] = {}
        self.sure: dict[str, NDArray] = {}

    def add(self, method: str, k: int, probability: NDArray) -> None:
        """Count the grid (C, H, W) that a method gives for frame k."""
        called = probability.argmax(axis=0)
        for truth, grids in self.truths.items():
            for number, name in enumerate(band_names()):
                there = self.band == number
                matrix = confusion_matrix(grids[k][there], called[there], len(self.frames.label_set))
                self.matrices.setdefault(_key(method, truth, name), []).append(matrix)
        diagram = reliability(probability, self.truths["true"][k])
        sums = np.stack([diagram.cells, diagram.confidence * diagram.cells, diagram.accuracy * diagram.cells])
        self.sure[method] = self.sure.get(method, 0) + sums

    def confusions(self) -> FrameConfusions:
        """Return all matrices."""
        return FrameConfusions(self.frames.drives, {key: np.stack(found) for key, found in self.matrices.items()})


def _key(method: str, truth: str, band: str) -> str:
    """Return the name that a method has in the file of confusion matrices."""
    return f"{method}, {truth} labels, {band}"


def distance_bands(spec: GridSpec) -> NDArray[np.int64]:
    """Return the band of distance that each cell lies in.

    Parameters
    ----------
    spec : GridSpec
        The grid.

    Returns
    -------
    (H, W) int64
        Number of the band of `band_names`, by the horizontal distance from the LIDAR to the cell's centre.
    """
    return np.digitize(np.hypot(*np.moveaxis(spec.centers(), -1, 0)), BANDS[1:-1])
