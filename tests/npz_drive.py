"""A data set in a layout of its own: one npz file for each frame, its returns labelled, its images not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from tiny_drive import CAMERA_FROM_LIDAR, SIZE, K

from semgrid_edu.camera import Camera
from semgrid_edu.datasets import DatasetIndex, LabelledFrame
from semgrid_edu.datasets.frames import FrameSequence, nothing_known
from semgrid_edu.datasets.project_lidar import birdseye_votes, closest_returns
from semgrid_edu.frame import Frame
from semgrid_edu.labels import KITTI_14

CAMERA = Camera(K, CAMERA_FROM_LIDAR, SIZE)


class NpzDrive(FrameSequence):
    """The frames of a drive; a pixel that a return falls on has its class, the others have none."""

    label_set, camera = KITTI_14, CAMERA

    def __init__(self, root, drive):
        self.name, self.folder = drive, Path(root) / drive
        self.paths = sorted(self.folder.glob("*.npz"))

    def __len__(self):
        return len(self.paths)

    def _frame(self, k):
        data, labels = np.load(self.paths[k]), nothing_known(self.label_set, self.camera.size)
        frame = Frame(data["image"], data["points"], self.camera, data["T_world_from_lidar"], 0.1 * k)
        returns, (u, v) = closest_returns(frame)[0], closest_returns(frame)[1].T
        labels.image[v, u] = data["classes"][returns]
        return replace(frame, labels=labels)

    def truth(self, k, spec):
        return birdseye_votes(self[k].points_grid, np.load(self.paths[k])["classes"], spec, self.label_set)


def write_npz_drives(root: Path) -> DatasetIndex:
    """Write two drives to learn from and one to test: a wall at the end of a road, which comes 1 m closer a frame."""
    for seed, name in enumerate("abc"):
        (root / name).mkdir(parents=True)
        for k in range(3):
            _write_frame(root / name / f"{k}.npz", k, np.random.default_rng([seed, k]))
    splits = {"train": (LabelledFrame(("a",), 1), LabelledFrame(("b",), 2)), "test": (LabelledFrame(("c",), 2),)}
    return DatasetIndex(root, "npz", KITTI_14, splits, reader=NpzDrive)


def _write_frame(path, k, rng):
    road = np.stack([rng.uniform(5, 25, 900), rng.uniform(-8, 8, 900), np.full(900, -1.73), rng.random(900)], 1)
    wall = np.stack([np.full(300, 30.5 - k), rng.uniform(-8, 8, 300), rng.uniform(-1.7, 0.5, 300), rng.random(300)], 1)
    T_world_from_lidar = np.eye(4)
    T_world_from_lidar[0, 3] = k
    np.savez(
        path,
        points=np.concatenate([road, wall]).astype(np.float32),
        classes=np.repeat([KITTI_14.index("road"), KITTI_14.index("building")], [900, 300]).astype(np.uint8),
        image=rng.integers(0, 256, (*CAMERA.size, 3), dtype=np.uint8),
        T_world_from_lidar=T_world_from_lidar,
    )
