"""Labels in the folder labels/ of a KITTI raw drive: image, depth and bird's-eye truth (section 4)."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.frame import LABEL_GRID, FrameLabels
from semgrid_edu.labels import IGNORE, LABEL_SETS, LabelSet
from semgrid_edu.storage.reading import read_png, read_text

KINDS = ("image", "depth", "birdseye", "visible")
"""The four files of a labelled frame, each in a folder of this name."""

WITH_GAPS = "with gaps"
"""The second line of label_set.txt if part of the view is unlabelled, for example all but LIDAR returns."""

DEPTH_UNIT = 1 / 256
"""One step of a depth PNG, metres (KITTI's convention); 0 means none."""


def read_labels(folder: Path, name: str, image_size: tuple[int, int]) -> FrameLabels | None:
    """Read the labels of a frame.

    Parameters
    ----------
    folder : Path
        The folder labels/ of a drive.
    name : str
        File name of the frame, such as 0000000009.png.
    image_size : (int, int)
        Height and width of the camera's images, pixels.

    Returns
    -------
    FrameLabels or None
        None for a frame without labels.
    """
    if not is_labelled(folder, name):
        return None
    arrays = {kind: read_label(folder, kind, name, image_size) for kind in KINDS}
    return FrameLabels(label_set=read_label_set(folder / "label_set.txt"), **arrays)


def is_labelled(folder: Path, name: str) -> bool:
    """Return whether any of a frame's four label files exists.

    Parameters
    ----------
    folder : Path
        The folder labels/ of a drive.
    name : str
        File name of the frame, such as 0000000009.png.
    """
    return any((folder / kind / name).exists() for kind in KINDS)


def read_label(folder: Path, kind: str, name: str, image_size: tuple[int, int] | None) -> NDArray:
    """Read one file of a labelled frame.

    Parameters
    ----------
    folder : Path
        The folder labels/ of a drive.
    kind : str
        One of `KINDS`.
    name : str
        File name of the frame, such as 0000000009.png.
    image_size : (int, int) or None
        Height and width that image and depth must have, pixels; None if any size will do.

    Returns
    -------
    (h, w) or (710, 310), of the type that it has in `FrameLabels`
        The field of `FrameLabels` that `kind` names.
    """
    path = folder / kind / name
    if kind == "depth":
        steps = read_png(path, "I;16", image_size)
        return np.where(steps > 0, steps.astype(np.float32) * np.float32(DEPTH_UNIT), np.float32(np.nan))
    if kind == "visible":
        return _mask(path, read_png(path, "L", LABEL_GRID.shape))
    classes = read_png(path, "L", image_size if kind == "image" else LABEL_GRID.shape)
    return _classes(path, classes, read_label_set(folder / "label_set.txt"))


def have_gaps(folder: Path) -> bool:
    """Return whether the labels of a drive have gaps.

    Parameters
    ----------
    folder : Path
        The folder labels/ of the drive.
    """
    return read_text(folder / "label_set.txt").strip().endswith(WITH_GAPS)


def read_label_set(path: Path) -> LabelSet:
    """Return the label set that a file names.

    Parameters
    ----------
    path : Path
        label_set.txt of a drive.
    """
    name, *more = read_text(path).strip().splitlines() or [""]
    if name not in LABEL_SETS or more not in ([], [WITH_GAPS]):
        expected = f"one of {', '.join(LABEL_SETS)}, and perhaps a second line, {WITH_GAPS}"
        raise DataError(path, expected, repr("\n".join([name, *more])))
    return LABEL_SETS[name]


def _classes(path: Path, classes: NDArray[np.uint8], label_set: LabelSet) -> NDArray[np.uint8]:
    """Check that all numbers in a map are classes, and return the map."""
    strange = classes[(classes >= len(label_set)) & (classes != IGNORE)]
    if strange.size:
        raise DataError(path, f"classes 0 to {len(label_set) - 1} or {IGNORE}", f"{strange[0]}")
    return classes


def _mask(path: Path, mask: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Turn 0 and 255 into false and true; nothing else is allowed."""
    strange = mask[(mask != 0) & (mask != 255)]
    if strange.size:
        raise DataError(path, "a mask of 0 and 255", f"{strange[0]}")
    return mask == 255
