"""A tiny scene in PandaSet's layout, and tables pickled as pandas 1 pickles them, without pandas.

The vehicle drives 0.5 m along the world's y axis from number to number, on flat ground 1 m above the world's origin.
There are scans 0, 2 and 4; ahead of the place where scan 0 was taken stand a wall, a parked car, and a car that drives
1 m to the right from number to number.
"""

import copyreg
import gzip
import json
import pickle
import sys
from types import ModuleType
from unittest import mock

import numpy as np
from PIL import Image

SCENE, NUMBERS, STEP, GROUND = "002", (0, 2, 4), 0.5, 1.0
SIDE_NUMBERS = (0, 4)
POSE = np.array([0.0, 0.0, GROUND + 0.3])
"""Where the pose of number 0 is. Its axes are those of the world: x right, y ahead, z up."""
LIDAR = np.add(POSE, (0, 0.79, 1.86))
"""Where the Pandar64 stands at number 0."""
ROAD, SIDEWALK, CAR, BUILDING, REFLECTION, OTHER = 7, 11, 13, 41, 4, 42
F, CENTRE = 1000.0, (960.0, 540.0)
WALL, PARKED, DRIVING = 20.2, (3.0, 10.0), (-4.0, 14.0)
"""y of the wall; x and y of the cars' middles at number 0, relative to the LIDAR, metres."""
CAR_SIZE = (1.8, 4.0, 1.5)


class _Fake:
    """What stands for a class or a function of pandas while its name is pickled."""

    def __init__(self, state=None):
        self.state = state

    def __reduce_ex__(self, _):
        return copyreg.__newobj__, (type(self),), self.state


def _named(module, name):
    return type(name, (_Fake,), {"__module__": module})


_CLASSES = {
    "pandas.core.frame": ["DataFrame"],
    "pandas.core.internals.managers": ["BlockManager"],
    "pandas.core.indexes.base": ["_new_Index", "Index"],
    "pandas.core.indexes.range": ["RangeIndex"],
}
_FAKES = {name: _named(module, name) for module, names in _CLASSES.items() for name in names}


class Called:
    """Pickled as the call of a function."""

    def __init__(self, function, *args):
        self.call = function, args

    def __reduce__(self):
        return self.call


def pickled_table(columns, protocol=3):
    """Pickle columns by name as pandas 1 does: each type of column in a block of its own."""
    kinds = {}
    for place, values in enumerate(columns.values()):
        kinds.setdefault(np.asarray(values).dtype.kind, []).append(place)
    values = [np.asarray(one, object if np.asarray(one).dtype.kind == "U" else None) for one in columns.values()]
    blocks = [
        {"values": np.array([values[place] for place in places]), "mgr_locs": np.array(places)}
        for places in kinds.values()
    ]
    names = Called(_FAKES["_new_Index"], _FAKES["Index"], {"data": np.array(list(columns), object), "name": None})
    rows = {"name": None, "start": 0, "stop": max(map(len, values)), "step": 1}
    axes = [names, Called(_FAKES["_new_Index"], _FAKES["RangeIndex"], rows)]
    manager = _FAKES["BlockManager"](([], [], [], {"0.14.1": {"axes": axes, "blocks": blocks}}))
    modules = {module: ModuleType(module) for module in (*_CLASSES, "pandas", "pandas.core", "pandas.core.internals")}
    for module, classes in _CLASSES.items():
        vars(modules[module]).update({name: _FAKES[name] for name in classes})
    with mock.patch.dict(sys.modules, modules):
        return pickle.dumps(_FAKES["DataFrame"]({"_data": manager, "_typ": "dataframe"}), protocol)


def write_table(path, columns):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(gzip.compress(pickled_table(columns), 1))


def _pose(place, rotation=(0.0, 0.0, 0.0, 1.0)):
    return {"position": dict(zip("xyz", place, strict=True)), "heading": dict(zip("xyzw", rotation, strict=True))}


def _patch(x, y, z, number):
    """Points of one class on the product of three axes, relative to the LIDAR at number 0, z above the ground."""
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.add(points, (*LIDAR[:2], GROUND)), np.full(len(points), number)


def _box(middle, number):
    (x, y), (width, length, height) = middle, CAR_SIZE
    sides = np.linspace(x - width / 2, x + width / 2, 10), np.linspace(y - length / 2, y + length / 2, 20)
    return _patch(*sides, np.linspace(0.1, height, 8), number)


def driving_at(number):
    """Where the middle of the driving car is, relative to the LIDAR at number 0."""
    return DRIVING[0] + 1.0 * number, DRIVING[1]


def _scan(number):
    parts = [
        _patch(np.arange(-8, 8, 0.25), np.arange(3.1, WALL, 0.25), [0.0], ROAD),
        _patch(np.arange(-8, 8, 0.1), [WALL], np.arange(0.1, 4, 0.1), BUILDING),
        _box(PARKED, CAR),
        _box(driving_at(number), CAR),
        _patch([0.0], [6.0 + number], [1.0], REFLECTION),
    ]
    points, classes = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    seen_by = np.r_[np.zeros(len(points), int), 1]  # one return of the LIDAR that looks ahead, on the wall
    points, classes = np.r_[points, [[LIDAR[0], LIDAR[1] + WALL, GROUND + 2.0]]], np.r_[classes, BUILDING]
    return points, classes, seen_by


def _write_cuboids(path, number):
    middles = np.array([PARKED, driving_at(number)]) + LIDAR[:2]
    table = {"uuid": ["parked", "driving"], "stationary": np.array([True, False]), "yaw": np.zeros(2)}
    for axis, values in zip("xyz", [*middles.T, np.full(2, GROUND + CAR_SIZE[2] / 2)], strict=True):
        table[f"position.{axis}"] = values
    for axis, size in zip("xyz", CAR_SIZE, strict=True):
        table[f"dimensions.{axis}"] = np.full(2, size)
    write_table(path, table | {"cuboids.sibling_id": ["-", "-"], "cuboids.sensor_id": np.array([-1, -1])})


LOOKS_AHEAD = (-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
LOOKS_LEFT = (-0.5, -0.5, 0.5, 0.5)
"""Headings x, y, z, w of a camera whose z axis points to the world's y, or against its x."""


def _write_camera(folder, numbers, heading):
    folder.mkdir(parents=True)
    poses = [_pose(np.add(LIDAR, (0, STEP * number, -0.1)), heading) for number in range(5)]
    (folder / "poses.json").write_text(json.dumps(poses))
    (folder / "timestamps.json").write_text(json.dumps([100.0 + 0.1 * number for number in range(5)]))
    (folder / "intrinsics.json").write_text(json.dumps({"fx": F, "fy": F, "cx": CENTRE[0], "cy": CENTRE[1]}))
    picture = np.repeat(np.arange(1080) // 8, 1920).astype(np.uint8).reshape(1080, 1920)
    for number in numbers:
        picture[:, -100:] = 40 * number  # so that images differ
        Image.fromarray(picture).convert("RGB").save(folder / f"{number:02d}.jpg", quality=95)


def write_tiny_pandaset(root):
    """Write the scene to a folder of scenes, and return that folder."""
    folder = root / SCENE
    for number in NUMBERS:
        points, classes, lidars = _scan(number)
        table = {axis: points[:, column] for column, axis in enumerate("xyz")}
        table |= {"i": np.full(len(points), 51.0), "t": np.full(len(points), 100.0), "d": lidars}
        write_table(folder / f"lidar/{number:02d}.pkl.gz", table)
        write_table(folder / f"annotations/semseg/{number:02d}.pkl.gz", {"class": classes})
        _write_cuboids(folder / f"annotations/cuboids/{number:02d}.pkl.gz", number)
    (folder / "lidar/poses.json").write_text(json.dumps([_pose(np.add(POSE, (0, STEP * n, 0))) for n in range(5)]))
    (folder / "lidar/timestamps.json").write_text(json.dumps([100.0 + 0.1 * number for number in range(5)]))
    _write_camera(folder / "camera/front_camera", NUMBERS, LOOKS_AHEAD)
    _write_camera(folder / "camera/left_camera", SIDE_NUMBERS, LOOKS_LEFT)
    return root
