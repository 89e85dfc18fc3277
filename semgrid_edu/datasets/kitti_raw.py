"""One drive in KITTI's raw layout, real or simulated, frame by frame (section 4; Geiger et al., IJRR 2013)."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import Camera, invert_rigid
from semgrid_edu.datasets.calibration import read_camera, read_lidar_height, read_rectification, read_rigid
from semgrid_edu.datasets.drive_files import IMAGE_SUFFIXES, first_sound, numbers_in, photograph, what_is, what_is_in
from semgrid_edu.datasets.frames import FrameSequence, error_of, read_scan
from semgrid_edu.datasets.kitti_labels import KINDS, have_gaps, is_labelled, read_label, read_label_set, read_labels
from semgrid_edu.datasets.oxts import imu_pose, read_packet, read_timestamps
from semgrid_edu.datasets.project_lidar import cells_in_view
from semgrid_edu.errors import ArgumentError, DataError, check_text
from semgrid_edu.frame import LABEL_GRID, Frame, FrameLabels
from semgrid_edu.labels import LabelSet
from semgrid_edu.storage.reading import read_image

VIEWS = ("image_02", "image_03")
"""The folders of the colour cameras."""

SAME_INSTANT = np.timedelta64(500, "ms")
"""How much the sensors' times of one frame may differ; at 10 Hz they should differ by less than 0.1 s."""

SUFFIXES = (".bin", ".txt", *IMAGE_SUFFIXES)
"""How the names of a frame's files end."""


def drive_folder(root: str | Path, date: str, drive: str) -> Path:
    """Return where KITTI's layout keeps a drive.

    Parameters
    ----------
    root : path-like
        The folder that holds the folders of the dates.
    date : str
        Date of the drive, such as "2011_09_26".
    drive : str
        Number of the drive, such as "0013".

    Examples
    --------
    >>> drive_folder("kitti_raw", "2011_09_26", "0013").name
    '2011_09_26_drive_0013_sync'
    """
    return Path(root) / date / f"{date}_drive_{drive}_sync"


class KittiRawDrive(FrameSequence):
    """The frames of a drive, each read and checked on access.

    `drive[k]` is frame k as KITTI numbers it, `drive[-1]` the last one, `drive[2:5]` a list of three. Some of KITTI's
    drives have gaps, such as 0009, which lacks the scans 177 to 180. A frame in a gap keeps its number, time and image,
    but has no points, so the filter only predicts. `gaps` lists these frames. The files of a clip cut from a drive may
    begin at any number; `drive[0]` is then the first frame of the clip, and `numbers` names the files.

    Parameters
    ----------
    root : path-like
        The folder that holds the folders of the dates.
    date : str
        Date of the drive, such as "2011_09_26".
    drive : str
        Number of the drive, such as "0013".
    images : bool
        Whether to read the images; reading is faster without them.
    view : str
        The folder of the images: "image_02" for the left camera, "image_03" for the right one. Labels of simulated
        drives belong to the left one.

    Raises
    ------
    ArgumentError
        When date or drive is empty, or there is no such view.
    DataError
        When there is no such drive; the error lists those that exist. `drive[k]` raises it when a file that the frame
        needs is missing or damaged.

    Examples
    --------
    >>> drive = KittiRawDrive("kitti_raw", "2011_09_26", "0013")    # doctest: +SKIP
    >>> frame = drive[3]                                            # doctest: +SKIP
    >>> frame.points.shape, frame.image.shape                       # doctest: +SKIP
    ((113944, 4), (375, 1242, 3))
    """

    def __init__(self, root: str | Path, date: str, drive: str, *, images: bool = True, view: str = VIEWS[0]) -> None:
        check_text(date=(date, "2011_09_26"), drive=(drive, "0013"))
        if view not in VIEWS:
            raise ArgumentError("view", " or ".join(VIEWS), repr(view))
        self.date_folder, self.folder = _existing(Path(root), date, drive)
        self.name = f"{date} {drive}"
        self.view = view
        self._sensors = ["velodyne_points", "oxts"]
        if images and (self.folder / view).exists():
            self._sensors.append(view)
        by_sensor = {name: numbers_in(self.folder / name / "data", SUFFIXES, 10) for name in self._sensors}
        recorded = set().union(*(numbers for name, numbers in by_sensor.items() if name != "oxts")) or by_sensor["oxts"]
        if not recorded:
            scans = self.folder / "velodyne_points" / "data"
            raise DataError(scans, "frames such as 0000000000.bin", what_is_in(scans))
        self._numbers = range(min(recorded), 1 + max(recorded | by_sensor["oxts"]))

    def __len__(self) -> int:
        """Return the number of frames, including frames whose scans were never recorded."""
        return len(self._numbers)

    @property
    def label_set(self) -> LabelSet:
        """The classes of the labels, which the file label_set.txt of a labelled drive names."""
        return read_label_set(self.folder / "labels" / "label_set.txt")

    def files(self) -> list[Path]:
        """Return the files of the drive, and the calibration of its day."""
        return [*self.date_folder.glob("*.txt"), *super().files()]

    def _frame(self, k: int) -> Frame:
        return Frame(
            image=self._image(k),
            points=self._points(k),
            camera=self.camera,
            T_world_from_lidar=self._pose(k),
            time=self._time(k),
            labels=self._labels(k),
        )

    def scan_file(self, k: int) -> Path:
        """Return the file of a frame's scan. Parameters are those of `DriveFiles.scan_file`."""
        return self.file("velodyne_points", k, ".bin")

    def image_file(self, k: int) -> Path | None:
        """Return the file of a frame's image, if images are read. Parameters are those of `DriveFiles.scan_file`."""
        if self.view not in self._sensors:
            return None
        return photograph(self.folder / self.view / "data", f"{self.numbers[k]:010d}")

    def packets(self) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64]]:
        """Return the packets that can be read, by file, and their times; NaN if the times can't be read."""
        packets = {}
        readable = []
        for k in range(len(self)):
            path = self.file("oxts", k, ".txt")
            with suppress(DataError):
                packets[str(path)] = read_packet(path)
                readable.append(k)
        seconds = np.full(len(self), np.nan)
        with suppress(DataError):
            times = self._read_times(self.folder / "oxts" / "timestamps.txt")
            seconds = (times - times[0]) / np.timedelta64(1, "s")  # an unknown time (NaT) becomes NaN
        return packets, seconds[readable]

    @cached_property
    def camera(self) -> Camera:
        """The calibration of the view, the same for all frames."""
        return read_camera(self.date_folder, self.view)

    def _readers(self) -> Iterator[Callable[[], object]]:
        """Yield a reader for each file, so that no error hides another."""
        yield partial(read_rectification, self.date_folder / "calib_cam_to_cam.txt", self.view)
        yield partial(read_rigid, self.date_folder / "calib_velo_to_cam.txt")
        yield partial(read_lidar_height, self.date_folder / "calib_velo_to_cam.txt")
        yield partial(read_rigid, self.date_folder / "calib_imu_to_velo.txt")
        for path in self._timestamp_files():
            yield partial(self._read_times, path)
        size = None if error_of(lambda: self.camera) else self.camera.size
        for k in range(len(self)):
            yield partial(self._points, k)
            yield partial(read_packet, self.file("oxts", k, ".txt"))
            yield partial(self._time, k)
            if self.view in self._sensors:
                yield partial(read_image, self.image_file(k), size)
            labels = self.folder / "labels"
            name = f"{self.numbers[k]:010d}.png"
            for kind in KINDS if is_labelled(labels, name) else ():
                yield partial(read_label, labels, kind, name, size)

    def file(self, sensor: str, k: int, suffix: str) -> Path:
        """Return the path of a sensor's file of a frame, whether it exists or not.

        Parameters
        ----------
        sensor : str
            Folder of the sensor: "velodyne_points", "oxts", "image_02" or "image_03".
        k : int
            The frame, counted from 0.
        suffix : str
            ".bin", ".txt" or ".png".
        """
        return self.folder / sensor / "data" / f"{self.numbers[k]:010d}{suffix}"

    def _timestamp_files(self) -> list[Path]:
        """Return timestamps.txt of every sensor, and the LIDAR's times of start and end where they are given."""
        optional = [self.folder / "velodyne_points" / f"timestamps_{event}.txt" for event in ("start", "end")]
        always = [self.folder / sensor / "timestamps.txt" for sensor in self._sensors]
        return [*always, *filter(Path.exists, optional)]

    @cached_property
    def _times(self) -> dict[str, NDArray[np.datetime64]]:
        """Time of each frame, (frames,) datetime64[ns] by sensor."""
        return {sensor: self._read_times(self.folder / sensor / "timestamps.txt") for sensor in self._sensors}

    def _read_times(self, path: Path) -> NDArray[np.datetime64]:
        return read_timestamps(path, len(self), self.numbers[0])

    def _time(self, k: int) -> float:
        """Return the seconds since the first scan, after checking that the sensors' times agree."""
        times = {sensor: of_sensor[k] for sensor, of_sensor in self._times.items()}
        if k in self.gaps and np.isnat(times["velodyne_points"]):
            del times["velodyne_points"]  # a scan that was never recorded has no time in KITTI
        (reference, time), *_ = times.items()
        for sensor, other in times.items():
            path = self.folder / sensor / "timestamps.txt"
            if np.isnat(other):
                raise DataError(path, f"a time in line {k + 1}", "an empty line")
            if abs(other - time) > SAME_INSTANT:
                first_path = self.folder / reference / "timestamps.txt"
                expected = f"in line {k + 1} a time within {SAME_INSTANT} of {time}, which {first_path} has there"
                raise DataError(path, expected, f"{other}")
        lidar = self._times["velodyne_points"]
        return float((time - lidar[~np.isnat(lidar)][0]) / np.timedelta64(1, "s"))

    def _points(self, k: int) -> NDArray[np.float32]:
        if k in self.gaps:
            return np.zeros((0, 4), np.float32)
        return read_scan(self.scan_file(k))

    def _image(self, k: int) -> NDArray[np.uint8] | None:
        """Read the image, (h, w, 3); None when the drive has no folder of this camera."""
        path = self.image_file(k)
        return None if path is None else read_image(path, self.camera.size)

    @cached_property
    def _T_lidar_from_imu(self) -> NDArray[np.float64]:
        return read_rigid(self.date_folder / "calib_imu_to_velo.txt")

    @cached_property
    def _first_packet(self) -> NDArray[np.float64]:
        return first_sound(lambda k: read_packet(self.file("oxts", k, ".txt")), range(len(self)))

    def _pose(self, k: int) -> NDArray[np.float64]:
        """Return T_world_from_lidar; the world is the frame of the IMU at the drive's first packet."""
        T_world_from_imu = imu_pose(self._first_packet, read_packet(self.file("oxts", k, ".txt")))
        return T_world_from_imu @ invert_rigid(self._T_lidar_from_imu)

    def _labels(self, k: int) -> FrameLabels | None:
        if self.view != VIEWS[0]:
            return None
        labels = read_labels(self.folder / "labels", f"{self.numbers[k]:010d}.png", self.camera.size)
        return replace(labels, undecided=self._in_view) if labels and have_gaps(self.folder / "labels") else labels

    @cached_property
    def _in_view(self) -> NDArray[np.bool_]:
        """The cells of `LABEL_GRID` in view of the camera, hidden or not."""
        return cells_in_view(self.camera, LABEL_GRID)


def _existing(root: Path, date: str, drive: str) -> tuple[Path, Path]:
    """Return the folders of the date and of the drive; an error lists what exists instead."""
    folder = drive_folder(root, date, drive)
    if not root.is_dir():
        raise DataError(root, "a folder of dates", "no folder")
    if not folder.parent.is_dir():
        raise DataError(folder.parent, "a folder", _instead(root, root, "dates", "*_*_*"))
    if not folder.is_dir():
        raise DataError(folder, "a folder", _instead(root, folder.parent, "drives", "*_sync"))
    return folder.parent, folder


def _instead(root: Path, parent: Path, what: str, pattern: str) -> str:
    """List the existing dates or drives, and name the layout that the folder seems to have."""
    there = sorted(path.name for path in parent.glob(pattern) if path.is_dir())
    layout = what_is(root)
    names = f"only the {what} {', '.join(there)}" if there else f"no {what}"
    return names + (f"; {root} looks like {layout}" if layout else "")
