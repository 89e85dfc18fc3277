"""How `real/` was made: `python data_samples/make_real.py PANDASET SCENE N_FRAMES FOLDER`.

A few frames of a PandaSet scene in KITTI's raw layout, small enough to ship with the package.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from string import Template
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, Camera, lidar_from_grid
from semgrid_edu.datasets.index import INDEX_FILE
from semgrid_edu.datasets.kitti_labels import WITH_GAPS
from semgrid_edu.datasets.pandaset import PandasetScene
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.frame import LABEL_GRID, resize_image
from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import SensorModel
from semgrid_edu.occupancy.polar import beams_of, height_above_ground
from semgrid_edu.storage.files import LOCK, sole_writer, write_json, write_text
from semgrid_edu.storage.provenance import write_provenance
from semgrid_edu.workshop.simulation.sensors.calibration_files import write_calibration
from semgrid_edu.workshop.simulation.sensors.rig import Geodesy, oxts_packet
from semgrid_edu.workshop.simulation.writer import WrittenFrame, write_frames

IMAGE_SIZE = (145, 480)
"""Height and width of the images, pixels: a quarter of the original. At a third, a number plate could be read."""

AROUND, BEHIND = 4.0, 8.0
"""AROUND: margin around the grid, metres, in which all returns are kept, because the filter's map is larger than the
grid. BEHIND: how far behind the vehicle, metres, returns are kept for the ground profile."""

SCANS = 9
"""Number of scans before and after a frame whose returns label its cells."""

NOWHERE = Geodesy(latitude=0.0, longitude=0.0, altitude=0.0, heading=0.0)
"""Start of the GPS/IMU track, so that the packets don't reveal the real location."""


class _FixedRig(PandasetScene):
    """A scene as KITTI's car would record it: one calibration for all frames, LIDAR frame 1.73 m above the ground.

    In the original scene the LIDAR frame is level and the camera sways relative to it. Here the LIDAR frame sways with
    the camera. So all frames share one calibration, and the poses and returns contain the sway.
    """

    def __init__(self, root: Path, scene: str) -> None:
        super().__init__(root, scene)
        level = PandasetScene(root, scene)
        T = level.camera.T_camera_from_lidar @ lidar_from_grid(level.lidar_height - KITTI_LIDAR_HEIGHT)
        self.lidar_height = KITTI_LIDAR_HEIGHT
        self._fixed = replace(level.camera.resized(IMAGE_SIZE), T_camera_from_lidar=T, lidar_height=self.lidar_height)

    def _camera(self, _: int) -> Camera:
        return self._fixed

    def _T_world_from_lidar(self, k: int) -> NDArray[np.float64]:
        return self._camera_poses[self.numbers[k]] @ self._fixed.T_camera_from_lidar

    def frames(self, n_frames: int) -> Iterator[WrittenFrame]:
        """Yield the first frames."""
        times = self._camera_times[[*self.numbers[:n_frames]]]
        poses = np.stack([self._T_world_from_lidar(k) for k in range(n_frames)])
        velocity = np.gradient(poses[:, :3, 3], times, axis=0)

        def pose(t: float) -> NDArray[np.float64]:
            k = np.abs(times - times[0] - t).argmin()
            moved = poses[k].copy()
            moved[:3, 3] += velocity[k] * (t - (times[k] - times[0]))
            return moved

        for k in range(n_frames):
            frame = self[k]
            seen = self.visible(k, LABEL_GRID, SCANS, SCANS)
            labels = replace(frame.labels, birdseye=self.truth(k, LABEL_GRID, SCANS, SCANS), visible=seen)
            image = resize_image(frame.image, IMAGE_SIZE)
            points = frame.points[needed_returns(frame.points_grid)]
            oxts = oxts_packet(pose, times[k] - times[0], NOWHERE)
            yield WrittenFrame(datetime.fromtimestamp(times[k], UTC), image, points, oxts, labels)


def needed_returns(points: NDArray) -> NDArray[np.bool_]:
    """Select the returns that the filter needs to compute the same belief over `LABEL_GRID` as with the full scan.

    All returns on the grid and closely around it are kept. From the others the filter needs only the range of each beam
    and the ground profile: the nearest obstacle and the farthest ground return of each beam, and, ahead of the vehicle,
    the lowest and the highest return in each bin of a sector (`GroundParams`).

    Parameters
    ----------
    points : (N, 4) float
        Returns in the grid frame, metres.

    Returns
    -------
    (N,) bool
        True for the returns to keep.
    """
    sensor = SensorModel()
    x, y, z = points[:, :3].T.astype(np.float64)
    far = np.hypot(x, y)
    height = height_above_ground(points, sensor.ground)
    beyond = np.maximum(np.abs(x - LABEL_GRID.x_max / 2) - LABEL_GRID.x_max / 2, np.abs(y) - LABEL_GRID.y_max)
    kept = beyond < AROUND
    ahead = ~kept & (x > -BEHIND)
    bins = np.minimum(far / sensor.ground.bin_length, sensor.ground.bins - 1).astype(np.int64)
    bins += beams_of(x, y, sensor.ground.sectors).astype(np.int64) * sensor.ground.bins
    # In float32, as in the filter, because many returns are on the border between two beams.
    beam = beams_of(points[:, 0], points[:, 1], sensor.beams)
    obstacle = (height >= sensor.obstacle_min) & (height <= sensor.obstacle_max)
    for place, value, among in (
        (bins, z, ahead),
        (bins, -z, ahead),
        (beam, far, ~kept & obstacle),
        (beam, -far, ~kept & (height < sensor.obstacle_min)),
    ):
        order = np.flatnonzero(among)
        order = order[np.lexsort((value[order], place[order]))]
        kept[order[np.unique(place[order], return_index=True)[1]]] = True
    return kept


def write_real_excerpt(pandaset: str | Path, scene: str, n_frames: int, folder: str | Path) -> Path:
    """Write the first frames of a scene's front camera as a drive in KITTI's raw layout, with labels and attribution.

    Parameters
    ----------
    pandaset : path-like
        The folder with the scenes.
    scene : str
        Number of the scene, such as "002".
    n_frames : int
        Number of frames, at least two.
    folder : path-like
        Output folder, new or empty, for the day's folder, README.md, dataset.json and provenance.json.

    Returns
    -------
    Path
        The drive's folder.

    Raises
    ------
    ArgumentError
        When the scene has fewer frames.
    DataError
        When the folder isn't empty, the scene has no labels, or one of its files is missing or damaged.
    """
    excerpt = _FixedRig(Path(pandaset), scene)
    folder = Path(folder)
    if not 2 <= n_frames <= len(excerpt):
        raise ArgumentError("n_frames", f"2 to {len(excerpt)} frames", n_frames)
    excerpt.visible(0, LABEL_GRID, 0, 0)  # raises an error for a scene without labels, before anything is written
    with sole_writer(folder):
        if {path.name for path in folder.iterdir()} - {LOCK}:
            raise DataError(folder, "a new or an empty folder", "one with files")
        return _write(excerpt, scene, n_frames, folder)


def _write(excerpt: _FixedRig, scene: str, n_frames: int, folder: Path) -> Path:
    """Write the drive, then its metadata."""
    date = f"{datetime.fromtimestamp(excerpt._camera_times[0], UTC):%Y_%m_%d}"
    drive = scene.zfill(4)
    K = excerpt.camera.K
    T = excerpt.camera.T_camera_from_lidar
    rig = SimpleNamespace(camera=excerpt.camera, R_rect=np.eye(3), T_camera0_from_lidar=T, T_lidar_from_imu=np.eye(4))
    rig.P_rect = lambda _: np.column_stack([K, np.zeros(3)])  # KITTI has four cameras, and this one is camera 2
    write_calibration(folder, rig, date)
    label_set = f"{KITTI_14.name}\n{WITH_GAPS}"
    written = write_frames(folder, (date, drive), excerpt.frames(n_frames), label_set)
    frames = [{"date": date, "drive": drive, "frame": k} for k in range(n_frames)]
    write_json(folder / INDEX_FILE, {"name": "real", "label_set": KITTI_14.name, "splits": {"drive": frames}})
    text = Template(Path(__file__).with_name("attribution.md").read_text(encoding="utf-8"))
    numbers = ", ".join(f"{number:02d}" for number in excerpt.numbers[:n_frames])
    write_text(folder / "README.md", text.substitute(scene=scene, numbers=numbers, width=IMAGE_SIZE[1], scans=SCANS))
    command = f"python data_samples/make_real.py PANDASET {scene} {n_frames} {folder.name}"
    write_provenance(folder, command, 0, ("numpy", "scipy", "numba", "pillow"))
    return written


if __name__ == "__main__":
    print(write_real_excerpt(sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4]))
