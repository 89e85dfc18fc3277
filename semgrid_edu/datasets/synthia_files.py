"""The files of a SYNTHIA sequence: labels, depth, intrinsics and poses (section 4; Ros et al., CVPR 2016).

From the readme of the data set (26 June 2016): 5 frames a second; the first channel of a label PNG is the class, the
second one the instance; depth is in centimetres, 16 bits, in any of three channels.

From published programs that read it, since no sequence could be looked at: label PNGs have 16 bits a channel;
intrinsics.txt holds focal length, principal point (u, v) and stereo baseline; a pose is 16 numbers, column by column
the matrix that takes points from the camera to the world, with a camera whose x points right, y up and z *back*. If a
sequence keeps its poses otherwise, `SynthiaSequence.problems` says that the camera doesn't move the way it looks.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import rigid_transform
from semgrid_edu.datasets.calibration import check_rotation
from semgrid_edu.datasets.class_tables import ClassTable
from semgrid_edu.errors import DataError
from semgrid_edu.labels import SYNTHIA_10
from semgrid_edu.storage.png16 import read_png16
from semgrid_edu.storage.reading import parse_numbers, read_text

SYNTHIA_CLASSES = ClassTable(
    SYNTHIA_10,
    {
        0: "void",
        1: "void",  # sky
        2: "building",
        3: "road",
        4: "sidewalk",
        5: "fence",
        6: "vegetation",
        7: "pole",
        8: "car",
        9: "sign",
        10: "void",  # pedestrian
        11: "void",  # bicycle
        12: "lane",
        13: "void",  # reserved
        14: "void",  # reserved
        15: "void",  # traffic light
    },
)
"""SYNTHIA-10's class of each number in the labels: the paper leaves sky, people, bicycles and traffic lights out."""

SYNTHIA_CAMERA_AXES = np.diag([1.0, -1.0, -1.0])
"""(3, 3): from this package's camera axes (x right, y down, z ahead) to those of SYNTHIA's poses."""


def read_synthia_labels(path: Path, size: tuple[int, int] | None) -> NDArray[np.uint8]:
    """Read the class of each pixel.

    Parameters
    ----------
    path : Path
        A file of GT/LABELS.
    size : (int, int) or None
        Height and width that it must have, pixels; None where any size will do.

    Returns
    -------
    (h, w) uint8
        Classes of SYNTHIA-10.

    Raises
    ------
    DataError
        When the file is missing or damaged, or holds a number that is no class.
    """
    return SYNTHIA_CLASSES.classes(path, read_png16(path, size)[..., 0].astype(np.int64))


def read_synthia_depth(path: Path, size: tuple[int, int] | None) -> NDArray[np.float32]:
    """Read the depth of each pixel.

    Parameters
    ----------
    path : Path
        A file of Depth.
    size : (int, int) or None
        Height and width that it must have, pixels; None where any size will do.

    Returns
    -------
    (h, w) float32
        Metres along the optical axis; NaN where the file holds 0 or 65535, so that nothing was met.

    Raises
    ------
    DataError
        When the file is missing or damaged.
    """
    centimetres = read_png16(path, size)[..., 0]
    nothing = (centimetres == 0) | (centimetres == np.iinfo(np.uint16).max)
    return np.where(nothing, np.float32(np.nan), centimetres.astype(np.float32) * np.float32(0.01))


def read_synthia_intrinsics(path: Path) -> NDArray[np.float64]:
    """Read the intrinsic matrix of all cameras.

    Parameters
    ----------
    path : Path
        CameraParams/intrinsics.txt.

    Returns
    -------
    (3, 3) float64
        K, pixels.

    Raises
    ------
    DataError
        When the file is missing or doesn't hold four numbers.
    """
    numbers = parse_numbers(path, read_text(path), "focal length, principal point and baseline")
    if numbers.size != 4 or numbers[0] <= 0:
        raise DataError(path, "focal length (above 0), principal point u and v, baseline", numbers.tolist())
    focal, u, v, _ = numbers
    return np.array([[focal, 0, u], [0, focal, v], [0, 0, 1]])


def read_synthia_pose(path: Path) -> NDArray[np.float64]:
    """Read the pose of a camera in one frame.

    Parameters
    ----------
    path : Path
        A file of CameraParams/Stereo_Left/Omni_F.

    Returns
    -------
    (4, 4) float64
        T_world_from_camera, metres, for a camera whose x points right, y down and z ahead.

    Raises
    ------
    DataError
        When the file is missing or its numbers are no rigid transform.
    """
    numbers = parse_numbers(path, read_text(path), "a pose")
    if numbers.size != 16 or not np.array_equal(numbers[3::4], [0, 0, 0, 1]):
        raise DataError(path, "16 numbers, every fourth of which is 0, 0, 0, 1", numbers.tolist())
    T = numbers.reshape(4, 4).T
    return rigid_transform(check_rotation(path, T[:3, :3], "the pose") @ SYNTHIA_CAMERA_AXES, T[:3, 3])
