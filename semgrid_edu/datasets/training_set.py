"""The training set: image, occupancy grid and truth of each labelled frame of a split; excerpts of it (section 4.1)."""

import copy
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.grid_truth import fill_gaps_with_unknown
from semgrid_edu.datasets.index import DatasetIndex, LabelledFrame, load_index
from semgrid_edu.datasets.label_policies import LidarTruth
from semgrid_edu.datasets.training_arrays import ArrayRecipe
from semgrid_edu.datasets.training_cache import cached_arrays
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import Architecture
from semgrid_edu.occupancy import CmcdotParams, track_drive
from semgrid_edu.storage.tensors import read_tensors

FRAMES = "frames.safetensors"
"""Name of the file with an excerpt: a few labelled frames, such as the shipped ones."""


class Sample(NamedTuple):
    """One labelled frame, in the form that a network takes.

    Parameters
    ----------
    image : (3, h, w) uint8
        RGB.
    labels : (h, w) uint8
        The class of each pixel; 255 where unlabelled.
    occupancy : (4, H, W) float32
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    truth : (H, W) uint8
        The class of each cell.
    return_heights : (2, H, W) float32, or None
        The lowest and the highest return of each cell, metres, from `cell_heights`; only networks with
        `uses_return_heights` need them, and the shipped excerpt lacks them.
    """

    image: Tensor
    labels: Tensor
    occupancy: Tensor
    truth: Tensor
    return_heights: Tensor | None = None


EXCERPT = Sample._fields[:4]
"""The fields that an excerpt of a data set holds: all but `return_heights`."""


class TrainingSet(Dataset[Sample]):
    """The labelled frames of a split.

    The first use runs the occupancy filter over every drive up to its labelled frames and stores the result in the data
    set's `cache/`, see `cached_arrays`. Later uses read it from there, until data, recipe or code change.

    Parameters
    ----------
    dataset : path-like or DatasetIndex
        The folder of a data set with dataset.json, such as data/minikitti; or an index made in Python, whose reader may
        be any class of a `FrameSequence`.
    split : str
        One of its splits, such as "train".
    spec : GridSpec, optional
        The grid of occupancy and truth; the compact one when left out.
    image_size : (int, int)
        Height and width to which the images are resized, pixels; the compact network's size when left out.
    params : CmcdotParams, optional
        Parameters of the occupancy filter; the package's defaults when left out.
    truth : LidarTruth, optional
        How to make the truth from image labels and LIDAR, which real data need. By default the truth comes from the
        data set (`FrameSequence.truth`).

    Attributes
    ----------
    camera : Camera
        The calibration of the resized images, the same for all frames.
    label_set : LabelSet
        The classes of labels and truth.
    spec : GridSpec
        The grid.
    drives : tuple of str
        The name of the drive of each frame, such as "2026_01_01 0143". Frames of one drive look alike, so they aren't
        independent.
    arrays : dict of str to array
        All frames at once, as `cached_arrays` returns them. The labels of pixels always come from the data set.

    Raises
    ------
    ArgumentError
        When there is no such split.
    DataError
        When the data set is damaged, or its drives have different cameras.

    Examples
    --------
    >>> training = TrainingSet("data/minikitti", "train")                  # doctest: +SKIP
    >>> as_in_the_paper = TrainingSet("data/minikitti", "train", truth=LidarTruth())  # doctest: +SKIP
    >>> torch.utils.data.DataLoader(training, batch_size=6, shuffle=True)  # doctest: +SKIP
    """

    track = staticmethod(track_drive)
    """Runs the occupancy filter over a drive; `semgrid_edu.fast.TrainingSet` uses the compiled filter."""

    def __init__(
        self,
        dataset: str | Path | DatasetIndex,
        split: str,
        spec: GridSpec | None = None,
        image_size: tuple[int, int] = Architecture.image_size,
        params: CmcdotParams | None = None,
        truth: LidarTruth | None = None,
    ) -> None:
        index = dataset if isinstance(dataset, DatasetIndex) else load_index(dataset)
        recipe = ArrayRecipe(spec or GridSpec.compact(), tuple(image_size), params or CmcdotParams(), self.track)
        self.spec = recipe.spec
        self.label_set = index.label_set
        drives = index.drives(split)
        self.camera = _shared_camera(drives).resized(recipe.image_size)
        self.drives = tuple(drive.name for drive, numbers in drives for _ in numbers)
        self.arrays = cached_arrays(index, split, recipe, truth)

    @classmethod
    def by_camera(
        cls,
        dataset: str | Path | DatasetIndex,
        split: str,
        spec: GridSpec | None = None,
        image_size: tuple[int, int] = Architecture.image_size,
        truth: LidarTruth | None = None,
    ) -> "list[TrainingSet]":
        """Open a split of a data set whose drives may have several cameras: one set for each, in the index's order.

        Parameters and errors are those of `TrainingSet`.
        """
        index = dataset if isinstance(dataset, DatasetIndex) else load_index(dataset)
        groups: list[tuple[Camera, list[LabelledFrame]]] = []
        for name, numbers in index.frames_by_drive(split).items():
            camera = index.reader(index.root, *name).camera
            frames = next((found for known, found in groups if known.same_as(camera)), None)
            if frames is None:
                groups.append((camera, frames := []))
            frames += [LabelledFrame(name, number) for number in numbers]
        parts = (replace(index, splits={split: tuple(frames)}) for _, frames in groups)
        return [cls(part, split, spec, image_size, truth=truth) for part in parts]

    def with_gaps_filled(self) -> "TrainingSet":
        """Return the same frames whose truth is unknown in cells far from any label, see `fill_gaps_with_unknown`.

        Raises
        ------
        ArgumentError
            When the classes aren't those of KITTI-14, which has unknown ones.
        """
        if self.label_set != KITTI_14:
            raise ArgumentError("fill_gaps", f"the classes of {KITTI_14.name}", self.label_set.name)
        other = copy.copy(self)
        truth = fill_gaps_with_unknown(self.arrays["truth"], self.arrays["occupancy"], self.spec)
        other.arrays = self.arrays | {"truth": truth}
        return other

    def __len__(self) -> int:
        """Return the number of labelled frames."""
        return len(self.arrays["truth"])

    def __getitem__(self, k: int) -> Sample:
        """Return frame k, by drive in the order of the index."""
        return Sample(*(torch.from_numpy(np.array(self.arrays[name][k])) for name in Sample._fields))

    def returns(self, k: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the pixel and the cell of each LIDAR return that the camera sees in a frame.

        Parameters
        ----------
        k : int
            Number of the frame in this set.

        Returns
        -------
        pixels, cells : (N,) int32
            As `seen_returns` counts them.
        """
        first, last = self.arrays["return_ends"][[k, k + 1]]
        return self.arrays["return_pixels"][first:last], self.arrays["return_cells"][first:last]


class Mixture(Sequence[Sample]):
    """Training sets that take turns, such as simulated and real ones, each with its own camera.

    Each step takes its frames from the next data set, whatever its size, and from that set's next camera.

    Parameters
    ----------
    data_sets : sequence of sequence of TrainingSet
        For each data set the frames of each of its cameras, as `TrainingSet.by_camera` returns them.

    Attributes
    ----------
    parts : tuple of TrainingSet
        All of them, in the order in which the frames are numbered.
    label_set : LabelSet
        The classes, the same for all.
    camera : Camera
        The calibration of the first part.

    Raises
    ------
    ArgumentError
        If there is no data set, if one has no camera, or if one has other classes than the first.
    """

    def __init__(self, data_sets: Sequence[Sequence[TrainingSet]]) -> None:
        if not data_sets or not all(data_sets):
            raise ArgumentError("data_sets", "at least one data set, each of at least one camera", "none")
        self._data_sets = data_sets
        self.parts = tuple(part for parts in data_sets for part in parts)
        self.label_set = self.parts[0].label_set
        self.camera = self.parts[0].camera
        for part in self.parts:
            if part.label_set != self.label_set:
                raise ArgumentError("data_sets", f"the label set {self.label_set.name} in each", part.label_set.name)

    def __len__(self) -> int:
        """Return the number of frames of all parts."""
        return sum(map(len, self.parts))

    def __getitem__(self, k: int) -> Sample:
        """Return frame k, counted from 0 through all parts."""
        for part in self.parts:
            if 0 <= k < len(part):
                return part[k]
            k -= len(part)
        raise IndexError(f"no such frame of {len(self)}")

    def turn(self, iteration: int) -> tuple[TrainingSet, int]:
        """Return the part whose turn it is at a training step, and how many turns it has had before.

        Parameters
        ----------
        iteration : int
            Number of the step, from 0.
        """
        round_, data_set = divmod(iteration, len(self._data_sets))
        cameras = self._data_sets[data_set]
        turns, camera = divmod(round_, len(cameras))
        return cameras[camera], turns


def _shared_camera(drives: Sequence[tuple[FrameSequence, list[int]]]) -> Camera:
    """Return the camera of a split's drives, which must all have the same one, because they share a sampler."""
    (first, _), *others = drives
    camera = first.camera
    for drive, _ in others:
        if not camera.same_as(drive.camera):
            expected = f"the calibration of {first.name}, because one network serves both"
            raise DataError(drive.name, expected, "another")
    return camera


def read_excerpt(folder: str | Path) -> list[Sample]:
    """Read the frames that `data_samples/make_frames.py` kept.

    Parameters
    ----------
    folder : path-like
        The folder that it wrote.
    """
    path = Path(folder) / FRAMES
    _, tensors = read_tensors(path)
    try:
        return [Sample(*frame) for frame in zip(*(tensors[name] for name in EXCERPT), strict=True)]
    except (KeyError, ValueError) as error:
        raise DataError(path, f"labelled frames: {', '.join(EXCERPT)}", error) from error
