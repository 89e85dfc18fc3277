"""Runs that score grids against the truth: networks, baselines, and the labels themselves (sections 3.3 and 4.2)."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_softmax

from semgrid_edu.crf import CrfParams
from semgrid_edu.datasets.index import load_index
from semgrid_edu.datasets.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.project_lidar import depth_scan, seen_returns
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.errors import DataError
from semgrid_edu.fast import mean_field
from semgrid_edu.storage.files import table_beside
from semgrid_edu.storage.tensors import read_arrays, write_arrays
from semgrid_edu.workshop.paper.data_runs import ArraysRun
from semgrid_edu.workshop.paper.run import Run
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.training_runs import NetworkRun
from semgrid_edu.workshop.paper.variants import EXACT, CalibrationError
from semgrid_edu.workshop.scoring.calibration import Reliability, reliability_of_sums
from semgrid_edu.workshop.scoring.confusions import (
    FrameConfusions,
    Grids,
    count_grids,
    load_confusions,
    reliability_key,
    save_confusions,
    seed_confusions,
)
from semgrid_edu.workshop.scoring.flat_ground import RULES, label_and_state
from semgrid_edu.workshop.scoring.grids import (
    MAJORITY,
    NETWORK,
    OCCUPANCY_ALONE,
    Refine,
    baseline_grids,
    network_grids,
)

CONFUSIONS, RELIABILITY = "confusions.npz", "reliability.npz"
"""The files of a run that scores: confusion matrices by frame, and how often a method is right by its confidence."""

WITH_CRF, WITH_SEARCHED = f"{NETWORK} + CRF", f"{NETWORK} + searched CRF"
"""The network's grid, refined with the CRF's default parameters, and with those that were searched."""

SEARCHED = {name: (row["temperature"], CrfParams(**row["crf"])) for name, row in table_beside(__file__).items()}
"""For each image network the temperature and the CRF's parameters that a search chose for pixel accuracy on validation
drives, with the shipped network of that kind (docs/results/crf_search*.json). A network for which nothing was searched
is scored without them."""

GEOMETRY, TRUE_GEOMETRY, FLAT_GROUND = "geometry", "geometry with true image labels", "flat ground"
"""Image labels carried by the LIDAR's depth with gaps closed, from the image network and true ones; and image labels
looked up where flat ground would be."""

FITTED_BASELINES = {
    MAJORITY: MAJORITY,
    OCCUPANCY_ALONE: OCCUPANCY_ALONE,
    **{f"{way} of label and state": label_and_state(way, f"{NETWORK} labels") for way in RULES},
    **{f"{way} of true label and state": label_and_state(way, "true labels") for way in RULES},
}
"""The baselines that are fitted to training frames, and what `baseline_grids` calls each. "Label" is the image's label
where flat ground would be."""

BASELINES = FITTED_BASELINES | {
    FLAT_GROUND: f"flat ground, {NETWORK} labels, observed cells",
    GEOMETRY: f"geometry, {NETWORK} labels, gaps closed",
    TRUE_GEOMETRY: "geometry, true labels, gaps closed",
}
"""All baselines of the paper's tables. The last ones call unlabelled cells by the unknown classes of KITTI-14, and so
are left out on data with other classes."""

LABELS = "labels"
"""The method: the labels themselves, counted like the grids of a network."""


class CountingRun(Run):
    """A run that counts grids against the truth of `frames`, an `ArraysRun`."""

    @abstractmethod
    def grids(self, root: Path, frames: TrainingSet) -> Grids:
        """Return the function that makes the grids of a frame.

        Parameters
        ----------
        root : Path
            The folder of all runs.
        frames : TrainingSet
            The frames to score.
        """

    def work(self, root: Path, device: str) -> None:
        """Count the grids. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        counted = count_grids(self.grids(root, frames), frames)
        write_arrays(self.folder(root) / RELIABILITY, counted.reliability)
        save_confusions(self.folder(root) / CONFUSIONS, counted.confusions)

    def confusions(self, counted: RunCounts, method: str, truth: str, band: str | None = None) -> FrameConfusions:
        """Return the confusion matrices of one method, one per drive.

        Parameters
        ----------
        counted : RunCounts
            What is known about the runs.
        method, truth, band
            What to count, as `FrameConfusions.of` takes it.

        Raises
        ------
        DataError
            When the run hasn't ended, its file is damaged, or it hasn't counted this.
        """
        name = f"{method}, {truth} labels, {band or 'all distances'}"
        return counted.confusions(self, method, name, lambda root: self._counts(root, method, truth, band))

    def frame_confusions(self, counted: RunCounts, method: str, truth: str) -> NDArray[np.int64]:
        """Return one method's matrices, one per frame, (N, C, C). Parameters are those of `CountingRun.confusions`."""
        name = f"{method}, {truth} labels, by frame"
        return counted.of(self, (name,), lambda root: {name: self._counts(root, method, truth).counts[method]})[name]

    def _counts(self, root: Path, method: str, truth: str, band: str | None = None) -> FrameConfusions:
        """Read the confusion matrices of one method, one per frame."""
        path = self.folder(root) / CONFUSIONS
        try:
            return load_confusions(path).of(method, truth, band)
        except KeyError as error:
            raise DataError(path, f"what was counted of {error}; remove the folder to count again", "none") from error

    def reliability(self, counted: RunCounts, method: str, truth: str = "true") -> Reliability:
        """Return how often a method is right by its confidence, over all frames.

        Parameters
        ----------
        counted : RunCounts
            What is known about the runs.
        method : str
            Such as `NETWORK`.
        truth : str
            The labels, "true" or "lidar".
        """
        key = reliability_key(method, truth)
        name = f"{key}, confidence"

        def read(root: Path) -> dict[str, NDArray]:
            found = read_arrays(self.folder(root) / RELIABILITY)
            return {name: found[key]} if key in found else {}

        return reliability_of_sums(counted.of(self, (name,), read)[name])


def by_seed(
    runs: Sequence[CountingRun], counted: RunCounts, method: str, truth: str, band: str | None = None
) -> NDArray[np.int64]:
    """Return the confusion matrices of a method, seed by seed and drive by drive.

    Parameters
    ----------
    runs : sequence of S CountingRun
        The same network, trained with S seeds.
    counted : RunCounts
        What is known about the runs.
    method, truth, band
        What to count, as `FrameConfusions.of` takes it.

    Returns
    -------
    (S, V, C, C) int64

    Raises
    ------
    ArgumentError
        When there is no run, or two of them were scored on other frames.
    DataError
        When a run hasn't ended, or its file is damaged.
    """
    return seed_confusions([run.confusions(counted, method, truth, band) for run in runs], method)


@dataclass(frozen=True)
class ScoreRun(CountingRun, NetworkRun):
    """Score a network on the frames of a split.

    Parameters
    ----------
    crf : bool
        Whether the CRF refines the grids as well, with default parameters and with searched ones if there are any.
    calibration : CalibrationError
        Error in the calibration that the network is given.
    """

    crf: bool = True
    calibration: CalibrationError = EXACT
    kind = "score"
    pace = property(lambda self: f"score {self.segmenter} {self.frames.built}" + " with CRF" * self.crf)
    trial_seconds = property(lambda self: (0.8 if self.crf else 0.15) * (1 if self.frames.preset == "compact" else 10))

    @property
    def tag(self) -> str:
        """Network, frames, calibration, and whether the CRF is scored."""
        return f"{super().tag}{self.calibration.name}" + "-crf" * self.crf

    def grids(self, root: Path, frames: TrainingSet) -> Grids:
        """Return the network's grids. Parameters are those of `CountingRun.grids`."""
        net = self.network.trained(root, self.calibration.applied_to(frames.camera))
        return network_grids(net, frames, self._refinements(frames.spec.cell) if self.crf else {})

    def _refinements(self, cell: float) -> dict[str, Refine]:
        """Return the CRF with default parameters, and with searched ones if there are any."""
        found = {"CRF": partial(_refined, 1.0, CrfParams.for_cells(cell))}
        if self.segmenter in SEARCHED:
            return found | {"searched CRF": partial(_refined, *SEARCHED[self.segmenter])}
        print(f"No CRF parameters were searched for {self.segmenter}, so {WITH_SEARCHED!r} is left out.")
        return found


def _refined(temperature: float, params: CrfParams, log_g: NDArray, o: NDArray) -> NDArray:
    """Refine a grid by the CRF, after its log-probabilities were divided by a temperature."""
    return mean_field(-log_softmax(log_g / temperature, axis=0), o, params)


@dataclass(frozen=True)
class BaselineRun(CountingRun, NetworkRun):
    """Score all of `BASELINES` on the frames of a split.

    The image stage of the network labels the images. What is fitted is fitted to what the network learned from: its
    training frames, with the same labels of cells.

    Parameters
    ----------
    calibration : CalibrationError
        Error in the calibration that geometry is given.
    dense : bool
        Whether geometry has the true depth of every pixel in place of the LIDAR's returns.
    """

    calibration: CalibrationError = EXACT
    dense: bool = False
    kind, trial_seconds = "baselines", 0.2
    pace = property(lambda self: f"baselines {self.segmenter} {self.frames.preset}")

    @property
    def tag(self) -> str:
        """Image network, labels, frames and calibration."""
        first = self.network.image_stage
        labels = f"{first.label}-{self.network.arrays.truth}-{first.iterations}-seed{first.seed}"
        return f"{labels}-on-{self.frames.tag}{self.calibration.name}" + "-dense" * self.dense

    @property
    def needs(self) -> tuple[Run, ...]:
        """The image network, and the frames of both splits."""
        return self.network.image_stage, self.network.arrays, self.frames

    def grids(self, root: Path, frames: TrainingSet) -> Grids:
        """Return the grids of the baselines. Parameters are those of `CountingRun.grids`."""
        segmenters = {NETWORK: self.network.image_stage.trained(root, frames.camera).segmenter}
        camera = self.calibration.applied_to(frames.camera)
        usual = self.calibration == EXACT and not self.dense
        returns = None if usual else self._believed_returns(root, frames)
        made = baseline_grids(self.network.arrays.frames(root), frames, segmenters, camera, returns)

        def grids(k: int) -> dict[str, NDArray]:
            found = made(k)
            return {name: found[full_name] for name, full_name in BASELINES.items() if full_name in found}

        return grids

    def _believed_returns(self, root: Path, frames: TrainingSet) -> Callable[[int], tuple[NDArray, NDArray]]:
        """Return pixels and cells of each frame's returns, as the believed calibration has them."""
        index = load_index(self.frames.data.dataset_dir(root))
        found = []
        for name, numbers in index.frames_by_drive(self.frames.split).items():
            drive = KittiRawDrive(index.root, *name, images=False)
            for frame in (drive[number] for number in numbers):
                points = depth_scan(frame.labels.depth, frame.camera, 1, 1) if self.dense else frame.points
                believed = replace(frame, camera=self.calibration.applied_to(frame.camera), points=points)
                found.append(seen_returns(believed, frames.spec, frames.camera.size))
        return found.__getitem__


@dataclass(frozen=True)
class LabelsRun(CountingRun):
    """Count the labels of a split against the true ones, and against those that are made in the usual way.

    Parameters
    ----------
    labels : ArraysRun
        The labels to count.
    usual : ArraysRun
        The same frames with the usual labels, made with the LIDAR.
    """

    labels: ArraysRun
    usual: ArraysRun
    kind = "labels"
    frames = property(lambda self: self.usual)
    steps = property(lambda self: self.labels.n_labelled)
    tag = property(lambda self: self.labels.tag)
    pace = property(lambda self: f"labels {self.labels.preset}")
    trial_seconds = property(lambda self: 0.01 if self.labels.preset == "compact" else 0.1)

    def grids(self, root: Path, frames: TrainingSet) -> Grids:
        """Return the labels. Parameters are those of `CountingRun.grids`."""
        classes = self.labels.frames(root).arrays["truth"]
        return lambda k: {LABELS: classes[k]}
