"""What all readers of drives share: frames read on demand, KITTI's scans, tables of classes (section 4)."""

import operator
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.drive_files import DriveFiles
from semgrid_edu.errors import DataError
from semgrid_edu.frame import LABEL_GRID, Frame, FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LabelSet
from semgrid_edu.storage.reading import read_bytes

LIDAR_RANGE = 250.0
"""Largest coordinate of a return, metres. KITTI's HDL-64E sees 120 m, so anything twice as far isn't a measurement."""


@dataclass(frozen=True)
class ClassTable:
    """A table from the class numbers in another data set's files to the classes of a label set.

    Parameters
    ----------
    label_set : LabelSet
        The classes to translate to.
    names : dict of int to (str or None)
        The class of each number that may occur in the files; None for unlabelled.

    Examples
    --------
    >>> from semgrid_edu.labels import KITTI_14
    >>> ClassTable(KITTI_14, {0: None, 7: "road"}).classes(Path("a.png"), np.array([7, 0]))
    array([  0, 255], dtype=uint8)
    """

    label_set: LabelSet
    names: dict[int, str | None]

    def classes(self, path: Path, numbers: NDArray) -> NDArray[np.uint8]:
        """Translate the numbers of a file.

        Parameters
        ----------
        path : Path
            Where the numbers come from, for the error.
        numbers : (...) int
            The numbers in the file.

        Returns
        -------
        (...) uint8
            Classes of the label set; 255 where unlabelled.
        """
        known = np.array(sorted(self.names))
        places = np.searchsorted(known, numbers).clip(max=len(known) - 1)
        unknown = numbers[known[places] != numbers]
        if unknown.size:
            raise DataError(path, f"labels among {', '.join(map(str, known))}", f"{unknown.flat[0]}")
        names = [self.names[number] for number in known]
        classes = np.array([IGNORE if name is None else self.label_set.index(name) for name in names], dtype=np.uint8)
        return classes[places]


class FrameSequence(DriveFiles, Sequence[Frame]):
    """The frames of a drive, each read and checked on access.

    `drive[k]` is frame k, `drive[-1]` the last one, `drive[2:5]` a list of three. A reader derives from this class and
    defines `__len__`, `_frame`, `name`, and `folder`, which contains the drive's files; for training and scoring also
    `camera`, the same for all frames, and `label_set`, the classes of image labels and truth. If the data's licence
    requires attribution, `credit` is its text.
    """

    name: str
    folder: Path
    camera: Camera
    label_set: LabelSet
    credit: str = ""

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        """Read a frame, or a list of frames."""
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        k = operator.index(index)
        if not -len(self) <= k < len(self):
            raise IndexError(f"frame {k} of a drive of {len(self)} frames")
        return self._frame(k % len(self))

    def problems(self) -> list[str]:
        """Read everything and list what is missing or damaged.

        Returns
        -------
        list of str
            One line per problem, which names the file or folder; empty if every frame can be read.
        """
        return [error for error in dict.fromkeys(map(error_of, self._readers())) if error]

    def _readers(self) -> Iterator[Callable[[], object]]:
        """Return functions that read the drive in pieces (here: by frame), so that no error hides another."""
        return (partial(self._frame, k) for k in range(len(self)))

    def truth(self, k: int, spec: GridSpec) -> NDArray[np.uint8]:
        """Return the class of each cell that the camera sees at frame k, (H, W); 255 where nothing is known.

        Parameters
        ----------
        k : int
            Number of a labelled frame.
        spec : GridSpec
            The grid, (H, W) cells.
        """
        return visible_labels(self._labels_of(k), spec)

    def undecided(self, k: int, spec: GridSpec) -> NDArray[np.bool_]:
        """Return the cells in view of the camera when the labels have gaps, (H, W); no cell when they have none.

        In these cells 255 in `truth` means that the camera may see something unlabelled, so training ignores them. The
        other unlabelled cells become unknown classes, even where a LIDAR saw more. Parameters are those of
        `FrameSequence.truth`.
        """
        return self._labels_of(k).undecided_on(spec)

    def image_labels(self, k: int, size: tuple[int, int]) -> NDArray[np.uint8]:
        """Return the class of each pixel of frame k when its image is resized, (h, w); 255 where unlabelled.

        Parameters
        ----------
        k : int
            Number of a labelled frame.
        size : (int, int)
            Height and width of the resized image, pixels.
        """
        labels = self._labels_of(k)
        return resize_labels(labels.image, size, sparse=labels.undecided is not None)

    def _labels_of(self, k: int) -> FrameLabels:
        """Return the labels of a frame, or raise an error if it has none."""
        labels = self[k].labels
        if labels is None:
            raise DataError(self.folder, f"labels of the frame {k}", "none")
        return labels

    def files(self) -> list[Path]:
        """Return all files below the folder of the drive: when one of them changes, its cached arrays are stale."""
        return [path for path in self.folder.rglob("*.*") if path.is_file()]

    @abstractmethod
    def _frame(self, k: int) -> Frame:
        """Read frame k, 0 <= k < len(self)."""

    def without_labels(self, k: int) -> Frame:
        """Read a frame that may lack its labels; readers whose labels take long to make override this.

        Parameters
        ----------
        k : int
            Number of the frame, 0 <= k < len(self).
        """
        return self._frame(k)


def read_scan(path: Path) -> NDArray[np.float32]:
    """Read the returns of one scan.

    Parameters
    ----------
    path : Path
        A file of little-endian floats, four for each return.

    Returns
    -------
    (N, 4) float32
        x forward, y left, z up in the LIDAR frame (metres), and reflectance.
    """
    content = read_bytes(path)
    if len(content) % 16:
        found = f"{len(content)} bytes, {len(content) % 16} too many{_other_format(content)}"
        raise DataError(path, "points of 4 x 4 bytes", found)
    start = content[:1000]
    if start.isascii() and "".join(start.decode().split()).isprintable():
        raise DataError(path, "floats in binary", f"text: {start[:60].decode()!r}")
    points = np.frombuffer(content, dtype="<f4").reshape(-1, 4).astype(np.float32)
    impossible = ~(np.abs(points[:, :3]) <= LIDAR_RANGE).all(axis=1) | ~np.isfinite(points[:, 3])
    if impossible.any():
        first = impossible.argmax()
        expected = f"finite coordinates within {LIDAR_RANGE:g} m and a finite reflectance"
        raise DataError(path, expected, f"{points[first].tolist()} at point {first}{_other_format(content)}")
    return points


def _other_format(content: bytes) -> str:
    """Ask whether a scan that can't be right is in another format, if it would be right in that."""
    if content.startswith((b"\x93NUMPY", b"# .PCD", b"ply")):
        return ": is it a file of NumPy, PCD or PLY?"
    for question, dtype in (("do the floats have 64 bits?", "<f8"), ("are the floats big-endian?", ">f4")):
        with np.errstate(invalid="ignore"):
            numbers = np.frombuffer(content[: len(content) // 32 * 32], dtype)
        if len(numbers) and (np.abs(numbers) <= LIDAR_RANGE).all() and (np.abs(numbers) > 1e-3).mean() > 0.5:
            return f": {question}"
    return ""


def resize_labels(labels: NDArray[np.uint8], size: tuple[int, int], sparse: bool = False) -> NDArray[np.uint8]:
    """Give each larger pixel the class that covers most of it; of two equal ones, the smaller number.

    Parameters
    ----------
    labels : (h, w) uint8
        The class of each pixel; 255 (unlabelled) counts as a class.
    size : (int, int)
        The new height and width, pixels.
    sparse : bool
        Whether to ignore 255: a larger pixel gets its class from labelled pixels, and is 255 only if there are none.

    Returns
    -------
    (*size,) uint8
    """
    classes = np.unique(labels)
    masks = (Image.fromarray((labels == c).astype(np.float32)) for c in classes)
    shares = [np.asarray(mask.resize(size[::-1], Image.Resampling.BOX)) for mask in masks]
    if sparse and classes[-1] == IGNORE:
        shares[-1] = np.full(size, 1e-6, np.float32)
    return classes[np.argmax(shares, axis=0)]


def visible_labels(labels: FrameLabels, spec: GridSpec) -> NDArray[np.uint8]:
    """Return the class of each cell that the camera sees; if labels have gaps, the class of each labelled cell.

    Parameters
    ----------
    labels : FrameLabels
        The labels of a frame.
    spec : GridSpec
        The grid: the extent of `LABEL_GRID`, a multiple of its cell.

    Returns
    -------
    (H, W) uint8
        255 where the camera doesn't see, or nothing is labelled.
    """
    birdseye = labels.birdseye_on(spec)
    return birdseye if labels.undecided is not None else np.where(labels.visible_on(spec), birdseye, np.uint8(IGNORE))


def nothing_known(label_set: LabelSet, image_size: tuple[int, int]) -> FrameLabels:
    """Return empty labels, in which a reader replaces the fields that its data set provides.

    Parameters
    ----------
    label_set : LabelSet
        The classes of the fields that are replaced.
    image_size : (int, int)
        Height and width of the image, pixels.

    Returns
    -------
    FrameLabels
        Labels that are unlabelled everywhere, without depth, and with nothing visible.
    """
    return FrameLabels(
        label_set=label_set,
        image=np.full(image_size, IGNORE, dtype=np.uint8),
        depth=np.full(image_size, np.nan, dtype=np.float32),
        birdseye=np.full(LABEL_GRID.shape, IGNORE, dtype=np.uint8),
        visible=np.zeros(LABEL_GRID.shape, dtype=np.bool_),
    )


def error_of(read: Callable[[], object]) -> str:
    """Return the message of the error that a reader raises.

    Parameters
    ----------
    read : callable
        Reads something, and raises `DataError` if it is missing or damaged.

    Returns
    -------
    str
        Empty if there is no error.
    """
    try:
        read()
    except DataError as error:
        return str(error)
    return ""
