"""Writes a hand-made drive of a few frames in KITTI's raw layout: a car that drives north-east at 10 m/s.

Everything is written from its definition, with none of the package's readers or writers.
"""

import json
from pathlib import Path

import numpy as np
from PIL import Image

DATE = "2026_01_01"
SIZE = (12, 40)
K = np.array([[20.0, 0.0, 19.5], [0.0, 20.0, 5.5], [0.0, 0.0, 1.0]])
BASELINE = 0.06
CAMERA_FROM_LIDAR = np.array(
    [[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, -0.1], [1.0, 0.0, 0.0, -0.3], [0.0, 0.0, 0.0, 1.0]]
)
LIDAR_FROM_IMU = np.array([[1.0, 0.0, 0.0, -0.8], [0.0, 1.0, 0.0, 0.3], [0.0, 0.0, 1.0, -0.8], [0.0, 0.0, 0.0, 1.0]])
EARTH_RADIUS = 6378137.0
LATITUDE, LONGITUDE, YAW = 49.0, 8.4, np.pi / 4
STEP = 1.0
"""Metres between frames, at 10 Hz."""


def write_tiny_drive(root: Path, drive: str = "0001", n_frames: int = 3, labelled: tuple[int, ...] = (2,)) -> Path:
    """Write calibration and a drive; return the drive's folder."""
    write_calibration(root / DATE)
    folder = root / DATE / f"{DATE}_drive_{drive}_sync"
    rng = np.random.default_rng(int(drive))
    for k in range(n_frames):
        _write_frame(folder, k, rng)
    for sensor, milliseconds in (("velodyne_points", 0), ("image_02", 10), ("oxts", 17)):
        write_timestamps(folder / sensor / "timestamps.txt", n_frames, milliseconds)
    (folder / "labels").mkdir()
    (folder / "labels" / "label_set.txt").write_text("KITTI-14\n")
    for k in labelled:
        _write_labels(folder / "labels", k, rng)
    return folder


def write_tiny_dataset(root: Path, n_frames: int = 3, name: str = "tiny", **n_drives: int) -> Path:
    """Write a data set of so many drives in each split, by default two to learn from and one to test.

    The last frame of each drive is labelled.
    """
    splits, last = {}, n_frames - 1
    for split, number in (n_drives or {"train": 2, "test": 1}).items():
        first = 1 + sum(map(len, splits.values()))
        splits[split] = [{"date": DATE, "drive": f"{first + k:04d}", "frame": last} for k in range(number)]
        for frame in splits[split]:
            write_tiny_drive(root, frame["drive"], n_frames, (last,))
    (root / "dataset.json").write_text(json.dumps({"name": name, "label_set": "KITTI-14", "splits": splits}))
    return root


def write_calibration(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    P = np.c_[K, [K[0, 0] * BASELINE, 0, 0]]
    identity = _numbers(np.eye(3))
    rectified = f"S_rect_02: {SIZE[1]} {SIZE[0]}\nR_rect_00: {identity}\nP_rect_02: {_numbers(P)}\n"
    (folder / "calib_cam_to_cam.txt").write_text(f"calib_time: 09-Jan-2026 13:57:47\n{rectified}")
    for name, T in (("velo_to_cam", CAMERA_FROM_LIDAR), ("imu_to_velo", LIDAR_FROM_IMU)):
        (folder / f"calib_{name}.txt").write_text(f"R: {_numbers(T[:3, :3])}\nT: {_numbers(T[:3, 3])}\n")


def write_timestamps(path: Path, n_frames: int, milliseconds: int = 0) -> None:
    """Write times at 10 Hz that cross midnight before the second frame."""
    path.parent.mkdir(parents=True, exist_ok=True)
    start = np.datetime64("2026-01-01T23:59:59.950000001", "ns")
    times = start + np.arange(n_frames) * np.timedelta64(100, "ms") + np.timedelta64(milliseconds, "ms")
    path.write_text("".join(f"{time}\n".replace("T", " ") for time in times))


def write_packet(path: Path, position: np.ndarray, angles: tuple[float, float, float]) -> None:
    """Write the packet of a place: metres east, north and up of (LATITUDE, LONGITUDE), by Mercator's inverse."""
    scale = np.cos(np.radians(LATITUDE))
    y_start = np.arcsinh(np.tan(np.radians(LATITUDE)))
    longitude = LONGITUDE + np.degrees(position[0] / (scale * EARTH_RADIUS))
    latitude = np.degrees(np.arctan(np.sinh(y_start + position[1] / (scale * EARTH_RADIUS))))
    path.parent.mkdir(parents=True, exist_ok=True)
    values = [latitude, longitude, position[2], *angles]
    path.write_text(" ".join(repr(float(value)) for value in values) + " 0.0" * 19 + " 4 10 4 4 0\n")


def _write_frame(folder: Path, k: int, rng: np.random.Generator) -> None:
    direction = np.array([np.cos(YAW), np.sin(YAW), 0])
    write_packet(folder / "oxts" / "data" / f"{k:010d}.txt", k * STEP * direction, (0.0, 0.0, YAW))
    for sensor in ("velodyne_points", "image_02"):
        (folder / sensor / "data").mkdir(parents=True, exist_ok=True)
    ground = np.stack([rng.uniform(3, 60, 500), rng.uniform(-15, 15, 500), np.full(500, -1.73), rng.random(500)], 1)
    wall = np.stack([np.full(200, 30.0), rng.uniform(-8, 8, 200), rng.uniform(-1.2, 0.5, 200), rng.random(200)], 1)
    points = np.concatenate([ground, wall]).astype("<f4")
    (folder / "velodyne_points" / "data" / f"{k:010d}.bin").write_bytes(points.tobytes())
    Image.fromarray(rng.integers(0, 256, (*SIZE, 3), dtype=np.uint8)).save(
        folder / "image_02" / "data" / f"{k:010d}.png"
    )


def _write_labels(folder: Path, k: int, rng: np.random.Generator) -> None:
    birdseye = np.zeros((710, 310), np.uint8)
    birdseye[400:420, 100:200] = 6
    visible = np.zeros((710, 310), np.uint8)
    visible[400:, 50:250] = 255
    image = rng.choice(np.array([0, 6, 255], np.uint8), SIZE)
    depth = rng.integers(0, 2**15, SIZE).astype(np.uint16)
    for kind, array in {"image": image, "depth": depth, "birdseye": birdseye, "visible": visible}.items():
        (folder / kind).mkdir(exist_ok=True)
        Image.fromarray(array).save(folder / kind / f"{k:010d}.png")


def _numbers(array: np.ndarray) -> str:
    return " ".join(f"{value:.6e}" for value in np.ravel(array))
