"""Write simulated drives and excerpts in KITTI's raw layout. Each drive is written atomically."""

import json
import shutil
import tempfile
from collections.abc import Collection, Iterable, Iterator, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.datasets.kitti_labels import DEPTH_UNIT, KINDS
from semgrid_edu.datasets.kitti_raw import drive_folder
from semgrid_edu.datasets.project_lidar import depth_scan
from semgrid_edu.errors import DataError
from semgrid_edu.frame import FrameLabels
from semgrid_edu.labels import KITTI_14, LabelSet
from semgrid_edu.workshop.simulation.drive import PERIOD, SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.rig import DATAFORMAT, oxts_packet
from semgrid_edu.workshop.simulation.things.materials import class_of_kind

DATE = "2026_01_01"
"""Date of all simulated drives."""
_START = datetime(2026, 1, 1, 10, 0, 0, 125000)
UNFINISHED = ".partial"
"""Suffix of the hidden folder of a drive that isn't complete yet."""


def remove_unfinished(day: Path) -> None:
    """Remove incomplete drives that killed processes left. No other process may be writing drives there.

    Parameters
    ----------
    day : Path
        The folder with a day's drives.
    """
    for partial in day.glob(f".*{UNFINISHED}"):
        shutil.rmtree(partial, ignore_errors=True)


def check_complete(folder: Path, n_frames: int, labelled: Collection[int]) -> None:
    """Check that a drive has all its files.

    Parameters
    ----------
    folder : Path
        The drive's folder.
    n_frames : int
        Number of frames.
    labelled : collection of int
        Numbers of the frames that have labels.

    Raises
    ------
    DataError
        When a file is missing.
    """
    per_frame = {"image_02/data": "png", "velodyne_points/data": "bin", "oxts/data": "txt"}
    expected = [f"{place}/{k:010d}.{suffix}" for place, suffix in per_frame.items() for k in range(n_frames)]
    expected += [f"labels/{kind}/{k:010d}.png" for kind in KINDS for k in labelled]
    expected += [f"{sensor}/timestamps.txt" for sensor in ("image_02", "velodyne_points", "oxts")]
    expected += ["labels/label_set.txt", "labels/objects.json"]
    missing = [name for name in expected if not (folder / name).is_file()]
    if missing:
        found = f"{len(missing)} missing, such as {missing[0]}"
        raise DataError(folder, f"all {len(expected)} files of a drive (delete the folder to make it again)", found)


def _write_times(folder: Path, times: Sequence[datetime]) -> None:
    """Write timestamps. Camera, LIDAR and IMU share the middle of the LIDAR's revolution."""
    offsets = {"image_02/timestamps": 0.0, "oxts/timestamps": 0.0, "velodyne_points/timestamps": 0.0}
    offsets |= {"velodyne_points/timestamps_start": -PERIOD / 2, "velodyne_points/timestamps_end": PERIOD / 2}
    for name, offset in offsets.items():
        moved = (time + timedelta(seconds=offset) for time in times)
        (folder / f"{name}.txt").write_text("".join(f"{time:%Y-%m-%d %H:%M:%S.%f}000\n" for time in moved))


def save_png(path: Path, pixels: NDArray) -> None:
    """Write a PNG. Higher compression levels take longer and hardly save space.

    Parameters
    ----------
    path : Path
        The file; its folder is created when missing.
    pixels : (h, w) or (h, w, 3) uint8, or (h, w) uint16
        The image.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path, compress_level=4)


def depth_to_png(depth: NDArray) -> NDArray[np.uint16]:
    """Encode depths like KITTI's depth maps: metres times 256; 0 for no depth and for 256 m or more.

    Parameters
    ----------
    depth : (h, w) float
        Metres along the optical axis; NaN for none.

    Returns
    -------
    (h, w) uint16
        In steps of `DEPTH_UNIT`.
    """
    scaled = np.round(np.nan_to_num(depth, nan=0.0) / DEPTH_UNIT)
    return np.where(scaled < 65536, scaled, 0).astype(np.uint16)


class WrittenFrame(NamedTuple):
    """One frame to write to disk.

    Parameters
    ----------
    time : datetime
        When the sensors recorded it.
    image : (h, w, 3) uint8
        RGB.
    points : (N, 4) float32
        LIDAR returns: x, y, z in the LIDAR frame, metres, and reflectance 0..1.
    oxts : str
        The GPS/IMU packet, from `oxts_packet`.
    labels : FrameLabels or None
        Ground truth; None for an unlabelled frame.
    objects : sequence of dict
        Cars, pedestrians and bicycles in the bird's-eye grid, from `SimulatedDrive.objects`.
    """

    time: datetime
    image: NDArray[np.uint8]
    points: NDArray[np.float32]
    oxts: str
    labels: FrameLabels | None = None
    objects: Sequence[dict] = ()


def _write_labels(folder: Path, name: str, labels: FrameLabels) -> None:
    """Write the labels of one frame."""
    images = (labels.image, depth_to_png(labels.depth), labels.birdseye, np.uint8(255) * labels.visible)
    for kind, pixels in zip(KINDS, images, strict=True):
        save_png(folder / kind / f"{name}.png", pixels)


def _write_files(folder: Path, frames: Iterable[WrittenFrame], label_set: str) -> tuple[int, list[int]]:
    """Write all files of a drive to its folder; return the number of frames and the numbers of the labelled ones."""
    for name in ("image_02/data", "velodyne_points/data", "oxts/data", "labels"):
        (folder / name).mkdir(parents=True)
    objects = {}
    times = []
    labelled = []
    for k, frame in enumerate(frames):
        name = f"{k:010d}"
        save_png(folder / "image_02" / "data" / f"{name}.png", frame.image)
        (folder / "velodyne_points" / "data" / f"{name}.bin").write_bytes(frame.points.tobytes())
        (folder / "oxts" / "data" / f"{name}.txt").write_text(frame.oxts)
        times.append(frame.time)
        objects[name] = frame.objects
        if frame.labels is not None:
            labelled.append(k)
            _write_labels(folder / "labels", name, frame.labels)
    _write_times(folder, times)
    (folder / "oxts" / "dataformat.txt").write_text(DATAFORMAT)
    (folder / "labels" / "label_set.txt").write_text(f"{label_set}\n")
    (folder / "labels" / "objects.json").write_text(json.dumps(objects, separators=(",", ":")) + "\n")
    return len(times), labelled


def _simulated_frames(
    simulated: SimulatedDrive, labelled: Collection[int], label_set: LabelSet, dense: bool
) -> Iterator[WrittenFrame]:
    """Yield the frames of a simulated drive."""
    classes = class_of_kind(label_set)
    for k in range(simulated.n_frames):
        frame = simulated.frame(k, k in labelled)
        labels = None
        picture = frame.picture
        truth = frame.truth
        if truth is not None:
            kinds = classes[picture.kind], picture.depth, classes[truth.kinds], truth.visible
            labels = FrameLabels(label_set, *kinds)
        points = depth_scan(picture.depth, simulated.rig.camera) if dense else frame.points
        oxts = oxts_packet(simulated.T_world_from_imu, frame.time, simulated.geodesy)
        time = _START + timedelta(seconds=k * PERIOD)
        yield WrittenFrame(time, picture.image, points, oxts, labels, frame.objects)


def write_drive(
    root: Path, drive: str, simulated: SimulatedDrive, labelled: Collection[int],
    label_set: LabelSet = KITTI_14, dense: bool = False,
) -> Path:  # fmt: skip
    """Write a simulated drive with `write_frames`.

    Parameters not named here, result and errors are those of `write_frames`.

    Parameters
    ----------
    simulated : SimulatedDrive
        The drive.
    labelled : collection of int
        Numbers of the frames to label.
    label_set : LabelSet
        The classes of the labels.
    dense : bool
        Whether points come from the thinned depth image (section 4: SYNTHIA) instead of the LIDAR.
    """
    return write_frames(root, (DATE, drive), _simulated_frames(simulated, labelled, label_set, dense), label_set.name)


def write_frames(root: Path, drive: tuple[str, str], frames: Iterable[WrittenFrame], label_set: str) -> Path:
    """Write a drive: images, points, oxts, timestamps, and the labels of some frames.

    The files go into a hidden folder, which is renamed when the drive is complete. So a killed process never leaves
    half a drive, and if two processes make the same drive, the first one wins.

    Parameters
    ----------
    root : path-like
        Parent of the day's folder, which holds the calibration.
    drive : (str, str)
        Date and number of the drive, four digits.
    frames : iterable of WrittenFrame
        Its frames.
    label_set : str
        The content of label_set.txt: the name of the label set, and `WITH_GAPS` on a second line if the labels have
        gaps.

    Returns
    -------
    Path
        The drive's folder.

    Raises
    ------
    DataError
        When another process has removed the files.
    """
    folder = drive_folder(root, *drive)
    folder.parent.mkdir(parents=True, exist_ok=True)
    partial = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}-", suffix=UNFINISHED))
    check_complete(partial, *_write_files(partial, frames, label_set))
    partial.chmod(0o755)
    try:
        partial.rename(folder)
    except OSError:
        shutil.rmtree(partial, ignore_errors=True)
        if not folder.exists():  # otherwise another process was faster
            raise
    return folder
