"""The files of a PandaSet scene, read and checked one by one: scans with classes and cuboids, poses, times, cameras.

Points, poses and cuboids are given in a world whose z axis points up, metres. Two LIDARs: the Pandar64 on the roof
turns (d = 0), the PandarGT looks ahead (d = 1).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import invert_rigid, rigid_transform, transform_points
from semgrid_edu.datasets.cuboids import Cuboids, LabelledScan
from semgrid_edu.datasets.frames import ClassTable
from semgrid_edu.errors import DataError
from semgrid_edu.labels import KITTI_14
from semgrid_edu.storage.pickled_tables import PickledTable, read_pickled_table
from semgrid_edu.storage.reading import read_json

CREDIT = "PandaSet by Hesai and Scale AI, CC BY 4.0 (creativecommons.org/licenses/by/4.0), cut and reduced."
"""The credit to show with data of PandaSet."""

TURNING = 0
"""The number d of the Pandar64, the only LIDAR that the occupancy filter uses."""

LIDAR_IN_POSE = np.array([0.0, 0.79, 1.86])
"""Position of the Pandar64 in the frame of lidar/poses.json (x right, y ahead, z up), metres. Measured on scene 002 as
the point from which each laser's returns have the same elevation; the published extrinsics of the cameras agree within
2 cm. The poses themselves refer to a point near the ground."""

ROOF = (-0.9, -1.7), (0.9, 1.4)
"""Bounds of the vehicle's roof, metres to the right and ahead of the Pandar64: on scene 002 about 630 returns in each
scan come from the roof, 1.6 to 2 m above the ground."""

FIRST_THING = 5
"""Classes below this number are smoke, exhaust, spray and reflections: returns without an object."""

MOVABLE = range(13, 34)
"""The class numbers of things that may move: vehicles, people, animals."""

PANDASET_CLASSES = ClassTable(
    KITTI_14,
    {
        **dict.fromkeys((7, 8, 9, 10), "road"),  # road, lane lines, stop lines, other markings
        **dict.fromkeys((11,), "sidewalk"),
        **dict.fromkeys((5,), "vegetation"),
        **dict.fromkeys((13, 14, 15, 16, 17), "car"),  # car, pickup, two sizes of trucks, towed object
        **dict.fromkeys((19, 20, 22, 23), "car"),  # construction, uncommon and emergency vehicles, bus
        **dict.fromkeys((27, 28, 29), "car"),  # train, trolley, tram
        **dict.fromkeys((30, 31), "pedestrian"),  # also with an object
        **dict.fromkeys((18, 25, 26), "bicycle"),  # motorcycle, scooter, bicycle
        **dict.fromkeys((41,), "building"),
        **dict.fromkeys((36, 38), "signage"),  # signs, also of construction sites
        **dict.fromkeys((35, 39), "fence"),  # road barriers, also of construction sites
        **dict.fromkeys((1, 2, 3, 4), None),  # smoke, exhaust, spray, reflection: nothing is there
        **dict.fromkeys((6, 12), None),  # other ground and driveways: neither road nor sidewalk
        **dict.fromkeys((21, 24, 32, 33), None),  # pedicab, mobility device, animals
        **dict.fromkeys((34, 37, 40, 42), None),  # pylon, cone, rolling container, other static object
    },
)
"""KITTI-14's class of each number in annotations/semseg; the numbers come from PandaSet's classes.json.

Ambiguous classes stay unlabelled: an "other static object" may be a pole, a wall or a hydrant."""


FARTHEST = 1000.0
"""No return is this far from most others, metres; the LIDARs reach 200 and 300 m."""


class PandasetScan(NamedTuple):
    """The contents of one scan's files.

    Parameters
    ----------
    points : (N, 3) float64
        World, metres.
    reflectance : (N,) float32
        From 0 to 1.
    lidars : (N,) int
        Number of the LIDAR of each return.
    labelled : LabelledScan or None
        The returns with their classes, without returns that have no object (`FIRST_THING`); None in a scene without
        labels.
    """

    points: NDArray[np.float64]
    reflectance: NDArray[np.float32]
    lidars: NDArray[np.int64]
    labelled: LabelledScan | None


NO_SCAN = PandasetScan(np.zeros((0, 3)), np.zeros(0, np.float32), np.zeros(0, np.int64), None)
"""In place of a scan that is missing."""


LIDAR_HEIGHT = 2.13
"""Height of the Pandar64 above the ground if no labels show the ground, metres; measured on scene 002."""


def above_the_road(labelled: LabelledScan | None, eye: NDArray[np.float64]) -> float:
    """Return how high the Pandar64 is above the road within 12 m, metres; `LIDAR_HEIGHT` if no label tells.

    Parameters
    ----------
    labelled : LabelledScan or None
        A scan, if it has labels.
    eye : (3,) float64
        Where the LIDAR is, world.
    """
    if labelled is None:
        return LIDAR_HEIGHT
    points = labelled.points
    near = (labelled.classes == KITTI_14.index("road")) & (np.hypot(*(points[:, :2] - eye[:2]).T) < 12)
    return float(eye[2] - np.median(points[near, 2])) if near.any() else LIDAR_HEIGHT


def semseg_folder(scene: Path) -> Path:
    """Return the folder with the classes of a scene's returns; scenes without labels don't have it.

    Parameters
    ----------
    scene : Path
        The folder of the scene.
    """
    return scene / "annotations" / "semseg"


def on_the_roof(points: NDArray[np.float64], T_world_from_vehicle: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which returns come from the vehicle itself; only the front camera's grid has the vehicle's heading.

    Parameters
    ----------
    points : (N, 3) float64
        Returns in the world, metres.
    T_world_from_vehicle : (4, 4) float64
        The scan's row of lidar/poses.json.

    Returns
    -------
    (N,) bool
        Whether each is above `ROOF`.
    """
    from_lidar = (transform_points(invert_rigid(T_world_from_vehicle), points) - LIDAR_IN_POSE)[:, :2]
    return ((ROOF[0] < from_lidar) & (from_lidar < ROOF[1])).all(axis=1)


def read_pandaset_scan(scene: Path, number: int) -> PandasetScan:
    """Read the returns of a scan, their classes and the cuboids of the things among them.

    Parameters
    ----------
    scene : Path
        The folder of the scene.
    number : int
        Number of the scan.
    """
    path = scene / "lidar" / f"{number:02d}.pkl.gz"
    table, rows = _table(path, ("x", "y", "z", "i", "d"))
    points = np.column_stack([table[axis] for axis in "xyz"])
    reflectance = (table["i"] / 255).astype(np.float32)
    lidars = table["d"]
    if not ((reflectance >= 0) & (reflectance <= 1)).all():
        raise DataError(path, "i from 0 to 255", f"{table['i'].min():g} to {table['i'].max():g}")
    if len(points):
        distance = np.abs(points - np.median(points, axis=0)).max(axis=1)
        if distance.max() > FARTHEST:
            expected = f"returns within {FARTHEST:g} m of the scan's middle"
            raise DataError(path, expected, f"{points[distance.argmax()].tolist()} in row {distance.argmax()}")
    if not semseg_folder(scene).is_dir():
        return PandasetScan(points, reflectance, lidars, None)
    path = semseg_folder(scene) / f"{number:02d}.pkl.gz"
    table, class_rows = _table(path, ("class",))
    if len(class_rows) != len(points):
        raise DataError(path, f"a class for each of the scan's {len(points)} returns", f"{len(class_rows)}")
    numbers = table["class"][_same_rows(path, class_rows, rows)]
    arrays = points, PANDASET_CLASSES.classes(path, numbers), np.isin(numbers, MOVABLE), lidars
    cuboids = _read_cuboids(scene / "annotations" / "cuboids" / path.name)
    labelled = LabelledScan(*(array[numbers >= FIRST_THING] for array in arrays), cuboids)
    return PandasetScan(points, reflectance, lidars, labelled)


def read_poses(path: Path, least: int) -> NDArray[np.float64]:
    """Read the poses of a sensor, T_world_from_sensor, (N, 4, 4), metres.

    Parameters
    ----------
    path : Path
        The file poses.json.
    least : int
        The least number of poses.
    """
    entries = read_json(path, list)
    if len(entries) < least:
        raise DataError(path, f"at least {least} poses, one for each frame", f"{len(entries)}")
    try:
        places = np.array([[entry["position"][axis] for axis in "xyz"] for entry in entries], np.float64)
        turns = np.array([[entry["heading"][axis] for axis in "xyzw"] for entry in entries], np.float64)
        rotations = Rotation.from_quat(turns).as_matrix()
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(path, "poses of a position x, y, z and a heading w, x, y, z", repr(error)) from error
    if not (np.isfinite(places).all() and np.isfinite(rotations).all()):
        raise DataError(path, "finite poses", "others")
    return np.array([rigid_transform(*pose) for pose in zip(rotations, places, strict=True)])


def read_times(path: Path, count: int) -> NDArray[np.float64]:
    """Read the times of a sensor's poses, (count,) seconds.

    Parameters
    ----------
    path : Path
        The file timestamps.json.
    count : int
        How many poses there are.
    """
    try:
        times = np.array(read_json(path, list), np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(path, "times in seconds", repr(error)) from error
    if times.shape != (count,) or not np.isfinite(times).all() or not (np.diff(times) > 0).all():
        raise DataError(path, f"{count} finite times that grow, one for each pose", f"{times.size} others")
    return times


def read_intrinsics(path: Path) -> NDArray[np.float64]:
    """Read the intrinsic matrix of a camera, (3, 3), pixels.

    Parameters
    ----------
    path : Path
        The file intrinsics.json.
    """
    content = read_json(path)
    try:
        fx, fy, cx, cy = (float(content[key]) for key in ("fx", "fy", "cx", "cy"))
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(path, "the numbers fx, fy, cx and cy", repr(content)[:200]) from error
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _same_rows(path: Path, rows: NDArray, wanted: NDArray) -> NDArray[np.int64]:
    """Return where in a table the wanted rows are: pandas' index names them, whatever order they were written in."""
    if np.array_equal(rows, wanted):
        return np.arange(len(rows))
    if rows.dtype.kind in "iu" and wanted.dtype.kind in "iu":
        by_name = np.argsort(rows)
        found = by_name[np.searchsorted(rows, wanted, sorter=by_name).clip(max=len(rows) - 1)]
        if np.array_equal(rows[found], wanted) and len(np.unique(wanted)) == len(wanted):
            return found
    raise DataError(path, "the index (the names of the rows) of the scan's table, each once", "another")


def _table(path: Path, numbers: Sequence[str], others: Sequence[str] = ()) -> PickledTable:
    """Read a table, and check that it has some columns of finite numbers and some of other things."""
    table, rows = read_pickled_table(path)
    columns = [*numbers, *others]
    if not set(columns) <= set(table):
        raise DataError(path, f"the columns {', '.join(columns)}", ", ".join(table)[:200])
    for name in numbers:
        if len(table[name]) and (table[name].dtype == object or not np.isfinite(table[name]).all()):
            raise DataError(path, f"finite numbers in the column {name}", "others")
    return PickledTable(table, rows)


def _read_cuboids(path: Path) -> Cuboids:
    """Read the cuboids of a scan. A thing that moves has two, one for each LIDAR, which name each other."""
    columns = [f"{what}.{axis}" for what in ("position", "dimensions") for axis in "xyz"]
    which = ("uuid", "stationary", "cuboids.sibling_id")
    table, _ = _table(path, (*columns, "yaw", "cuboids.sensor_id"), which)
    places, sizes = np.split(np.column_stack([table[column] for column in columns]).astype(np.float64), 2, axis=1)
    turns = Rotation.from_rotvec(np.outer(table["yaw"], [0, 0, 1])).as_matrix()
    T = np.array([rigid_transform(*pose) for pose in zip(turns, places, strict=True)]).reshape(-1, 4, 4)
    lidars = table["cuboids.sensor_id"]
    sibling = table["cuboids.sibling_id"]
    names = np.where((lidars > TURNING) & (sibling != "-"), sibling, table["uuid"])
    stationary = table["stationary"].tolist()
    _check_objects(path, names, stationary, sizes)
    return Cuboids(names, T, sizes, ~np.array(stationary, bool), lidars)


def _check_objects(path: Path, names: NDArray, stationary: list, sizes: NDArray[np.float64]) -> None:
    """Check that names are text, that `stationary` is boolean, and that sizes aren't negative."""
    if not all(isinstance(name, str) for name in names):
        raise DataError(path, "text in the columns uuid and cuboids.sibling_id", "others")
    if not all(isinstance(value, bool) for value in stationary):
        raise DataError(path, "true or false in the column stationary", "others")
    if (sizes < 0).any():
        raise DataError(path, "dimensions from 0 m up", f"{sizes.min():g} m")
