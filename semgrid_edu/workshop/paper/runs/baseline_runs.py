"""Runs that score what learns no fusion: geometry, flat ground, occupancy alone, the majority (sections 3.3 and 4)."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.datasets.ground_truth import carry_labels, close_gaps
from semgrid_edu.datasets.index import load_index
from semgrid_edu.datasets.readers.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.readers.project_lidar import seen_returns
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.workshop.scoring.single_sources import majority_class
from semgrid_edu.workshop.scoring.learned_grids import best_labels
from semgrid_edu.workshop.paper.runs.variants import EXACT, CalibrationError
from semgrid_edu.workshop.paper.runs.counting import CountingRun, GridCounts
from semgrid_edu.workshop.paper.runs.data_runs import ArraysRun
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.paper.runs.training_runs import GridStageRun
from semgrid_edu.workshop.scoring.single_sources import (
    classes_of_states,
    ground_pixels,
    inverse_perspective,
    majority_by_state,
)
from semgrid_edu.networks import WEIGHTS, load_net

GEOMETRY, TRUE_GEOMETRY, FLAT_GROUND = "geometry", "geometry with true image labels", "flat ground"
"""Image labels carried by the LIDAR's depth with gaps closed, from the image network and true ones; and image labels
looked up where flat ground would be."""

MAJORITY, OCCUPANCY_ALONE = "majority class", "occupancy alone"
"""The most frequent class of each cell, and of each cell and occupancy state."""

BASELINES = (MAJORITY, OCCUPANCY_ALONE, FLAT_GROUND, GEOMETRY, TRUE_GEOMETRY)
"""All of them."""


@dataclass(frozen=True)
class BaselineRun(CountingRun):
    """Score all baselines on the frames of a split.

    Parameters
    ----------
    network : GridStageRun
        The network to compare with: its image stage labels the images, and the majority is that of its frames.
    frames : ArraysRun
        The frames to score.
    calibration : CalibrationError
        What geometry believes wrongly about where the camera stands.
    """

    network: GridStageRun
    frames: ArraysRun
    calibration: CalibrationError = EXACT

    @property
    def name(self) -> str:
        """The name of its folder."""
        first, where = self.network.image_stage, self.frames.name.removeprefix("arrays-")
        label = f"{first.label}-{self.network.arrays.truth}-{first.iterations}-seed{first.seed}"
        return f"baselines-{label}-on-{where}{self.calibration.name}"

    @property
    def needs(self) -> tuple[Run, ...]:
        """The image network, and the frames of both splits."""
        return self.network.image_stage, self.network.arrays, self.frames

    @property
    def steps(self) -> int:
        """Number of frames that are scored."""
        return self.frames.n_labelled

    @property
    def pace(self) -> str:
        """It depends on the image network."""
        return f"baselines {self.network.image_stage.segmenter} {self.frames.preset}"

    def probe(self) -> float:
        """Return the seconds that a frame took on one core when this was written."""
        return 0.2

    def work(self, root: Path, device: str) -> None:
        """Score the baselines. Parameters are those of `Run.work`."""
        frames, training = self.frames.frames(root), self.network.arrays.frames(root).arrays
        majority, by_state = (
            majority_class(training["truth"]),
            majority_by_state(training["truth"], training["occupancy"]),
        )
        segmenter = load_net(self.network.image_stage.folder(root) / WEIGHTS, frames.camera).segmenter
        ground = ground_pixels(frames.spec, self.calibration.applied_to(frames.camera))
        counted = GridCounts(frames)
        for k, returns in enumerate(tqdm(self._returns(root, frames), total=len(frames), unit="frame")):
            sample, o = frames[k], frames.arrays["occupancy"][k]
            ours, true = best_labels(segmenter, sample), sample.labels.numpy()
            counted.add(MAJORITY, k, majority)
            counted.add(OCCUPANCY_ALONE, k, classes_of_states(by_state, o))
            counted.add(FLAT_GROUND, k, inverse_perspective(ours, ground, o, True))
            for method, labels in ((GEOMETRY, ours), (TRUE_GEOMETRY, true)):
                counted.add(method, k, close_gaps(carry_labels(labels, *returns, o), frames.spec.cell))
        counted.write(self.folder(root))

    def _returns(self, root: Path, frames: TrainingSet) -> Iterator[tuple[NDArray, NDArray]]:
        """Yield pixels and cells of the returns of each frame, as the believed calibration has them."""
        if self.calibration == EXACT:
            yield from (frames.returns(k) for k in range(len(frames)))
            return
        index = load_index(self.frames.data.dataset_dir(root))
        for (date, drive), numbers in index.frames_by_drive(self.frames.split).items():
            scans = KittiRawDrive(index.root, date, drive, images=False)
            for number in numbers:
                frame = scans[number]
                believed = replace(frame, camera=self.calibration.applied_to(frame.camera))
                yield seen_returns(believed, frames.spec, frames.camera.size)
