"""Labels that lie beside a KITTI raw drive, in its folder labels/: image, depth and bird's-eye truth (section 4)."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.reading import read_png, read_text
from semgrid_edu.errors import DataError
from semgrid_edu.frame import LABEL_GRID, FrameLabels
from semgrid_edu.labels import IGNORE, LABEL_SETS, LabelSet

LABEL_FOLDERS = ("image", "depth", "birdseye", "visible")

DEPTH_UNIT = 1 / 256
"""Metres of one step in a depth PNG (KITTI's convention); 0 means none."""


def read_labels(folder: Path, name: str, image_size: tuple[int, int]) -> FrameLabels | None:
    """Read what is true at one frame.

    Parameters
    ----------
    folder : Path
        labels/ of a drive.
    name : str
        The frame's file name, such as 0000000009.png.
    image_size : (int, int)
        Height and width of the camera's images.

    Returns
    -------
    FrameLabels or None
        None when none of the four files is there.

    Raises
    ------
    DataError
        When only some of the files are there, or one is damaged.
    """
    paths = {kind: folder / kind / name for kind in LABEL_FOLDERS}
    if not any(path.exists() for path in paths.values()):
        return None
    label_set = read_label_set(folder / "label_set.txt")
    depth = read_png(paths["depth"], "I;16", image_size).astype(np.float32) * np.float32(DEPTH_UNIT)
    return FrameLabels(
        label_set=label_set,
        image=_read_classes(paths["image"], image_size, label_set),
        depth=np.where(depth > 0, depth, np.float32(np.nan)),
        birdseye=_read_classes(paths["birdseye"], LABEL_GRID.shape, label_set),
        visible=_read_mask(paths["visible"]),
    )


def read_label_set(path: Path) -> LabelSet:
    """Return the label set that a file names.

    Raises
    ------
    DataError
        When the file is missing, or there is no such label set.
    """
    name = read_text(path).strip()
    if name not in LABEL_SETS:
        raise DataError(path, f"one of {', '.join(LABEL_SETS)}", repr(name))
    return LABEL_SETS[name]


def _read_classes(path: Path, size: tuple[int, int], label_set: LabelSet) -> NDArray[np.uint8]:
    """Read a map of classes, refusing numbers that name none."""
    classes = read_png(path, "L", size)
    strange = classes[(classes >= len(label_set)) & (classes != IGNORE)]
    if strange.size:
        raise DataError(path, f"classes 0 to {len(label_set) - 1} or {IGNORE}", f"{strange[0]}")
    return classes


def _read_mask(path: Path) -> NDArray[np.bool_]:
    """Read a bird's-eye mask of 0 and 255."""
    mask = read_png(path, "L", LABEL_GRID.shape)
    if not np.isin(mask, (0, 255)).all():
        raise DataError(path, "a mask of 0 and 255", f"the values {np.unique(mask)[:5].tolist()} and so on")
    return mask == 255
