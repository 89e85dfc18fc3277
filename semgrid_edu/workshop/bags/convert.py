"""Write a bag as a drive in KITTI's raw layout, which every command reads (`semgrid-edu data from-bag`)."""

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from tqdm.auto import tqdm

from semgrid_edu.camera import Camera, invert_rigid, rigid_transform, transform_points
from semgrid_edu.datasets.kitti_raw import drive_folder
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import atomic_folder, check_new_folder
from semgrid_edu.workshop.bags.bag import Bag, open_bag, stamp_of
from semgrid_edu.workshop.bags.pictures_and_clouds import cloud_of, image_of
from semgrid_edu.workshop.bags.survey import Matches, Survey, Topics, matched, survey
from semgrid_edu.workshop.bags.transforms import NS
from semgrid_edu.workshop.simulation.sensors.calibration_files import write_calibration
from semgrid_edu.workshop.simulation.sensors.rig import DATAFORMAT, Geodesy, oxts_packet

DRIVE = "0001"
"""Number of the drive in its folder."""

LONGEST = 0.5
"""The longest time between the two poses around a scan, seconds: in it a car hardly leaves a straight line."""

HIGHEST = 10.0
"""The greatest height of a LIDAR above the ground, metres; more isn't metres."""

NOWHERE = Geodesy(0.0, 0.0, 0.0, 0.0)
"""Where a drive begins, as its odometry doesn't know it: on the equator. Only motion since the start has a meaning."""


class BagRig:
    """The calibration of a bag in KITTI's terms: rectified camera 0 is the camera, and the IMU is the base.

    Parameters
    ----------
    told : Survey
        What the bag says.
    """

    R_rect = np.eye(3)

    def __init__(self, told: Survey) -> None:
        self.camera: Camera = told.camera
        self.T_camera0_from_lidar = told.camera.T_camera_from_lidar
        self.T_lidar_from_imu = invert_rigid(rigid_transform(np.eye(3), told.T_base_from_lidar[:3, 3]))

    def P_rect(self, index: int) -> NDArray[np.float64]:
        """Return the projection matrix of a camera, (3, 4), the same for all four.

        Parameters
        ----------
        index : int
            Number of the camera.
        """
        return np.column_stack([self.camera.K, np.zeros(3)])


class Converted(NamedTuple):
    """What was written.

    Parameters
    ----------
    date, drive : str
        What KITTI's layout calls the drive.
    n_frames : int
        Number of its frames.
    left_out : Counter of str
        How many scans and returns weren't used, by what is wrong with them.
    brightest : float
        The brightness of returns that became a reflectance of 1.
    """

    date: str
    drive: str
    n_frames: int
    left_out: Counter[str]
    brightest: float


def convert_bag(bag: str | Path, folder: str | Path, topics: Topics, lidar_height: float) -> Converted:
    """Write a bag as a drive in KITTI's raw layout.

    Each scan becomes a frame with the nearest image within half a scan period and the pose at the scan's time stamp.
    Returns are written in a frame at the LIDAR with the axes of the odometry's frame, which ROS has x ahead, y left and
    z up, so a tilted LIDAR is made level (unless the odometry's frame is the LIDAR's own). KITTI's packets also say how
    good the GPS was, and its calibration when it was made: both are invented.

    Parameters
    ----------
    bag : path-like
        A file of ROS 1 or MCAP, or a folder of ROS 2.
    folder : path-like
        The new folder, which holds the folder of the date.
    topics : Topics
        The topics to read.
    lidar_height : float
        Height of the LIDAR above the ground, metres; no bag knows it.

    Raises
    ------
    ArgumentError
        When the height is impossible.
    DataError
        When the folder isn't empty, or the bag lacks something; the error names the topic.
    """
    if not 0 < lidar_height < HIGHEST:
        raise ArgumentError("--lidar-height", f"metres above the ground, between 0 and {HIGHEST:g}", lidar_height)
    check_new_folder(folder)
    with open_bag(Path(bag)) as recording:
        told = survey(recording, topics, lidar_height)
        matches = matched(told, LONGEST)
        if not len(matches.scans):
            raise DataError(recording.place(topics.points), "scans with an image and a pose", _why_none(told, matches))
        start = np.datetime64(int(told.scans[matches.scans[0]]), "ns")
        date = str(start.astype("datetime64[D]")).replace("-", "_")
        with atomic_folder(folder) as root:
            write_calibration(root, BagRig(told), date)
            _write_drive(drive_folder(root, date, DRIVE), recording, topics, told, matches)
    return Converted(date, DRIVE, len(matches.scans), matches.left_out, told.brightest)


def _why_none(told: Survey, matches: Matches) -> str:
    """Return why no scan is a frame: sensors with clocks of their own show in their first and last times."""
    why = [f"{why}: {n}" for why, n in matches.left_out.items()]
    times = {"scans": told.scans, "images": told.images, "odometry": told.trajectory.stamps}
    why += [f"{name} from {stamps[0] / NS:.1f} to {stamps[-1] / NS:.1f} s" for name, stamps in times.items()]
    return f"none; {', '.join(why)}"


def _write_drive(folder: Path, bag: Bag, topics: Topics, told: Survey, matches: Matches) -> None:
    """Write images, scans, packets and time stamps."""
    for name in ("image_02", "velodyne_points", "oxts"):
        (folder / name / "data").mkdir(parents=True)
    scans = told.scans[matches.scans]
    images = told.images[matches.images]
    for name, stamps in (("image_02", images), ("velodyne_points", scans), ("oxts", scans)):
        lines = (str(stamp).replace("T", " ") + "\n" for stamp in stamps.astype("datetime64[ns]"))
        (folder / name / "timestamps.txt").write_text("".join(lines))
    _write_packets(folder / "oxts", told, scans)
    _write_sensors(folder, bag, topics, told, matches)


def _write_packets(folder: Path, told: Survey, stamps: NDArray[np.int64]) -> None:
    """Write the pose at each scan as a packet of GPS and IMU; velocities are those over one step of the odometry."""
    (folder / "dataformat.txt").write_text(DATAFORMAT)
    start = int(stamps[0])
    step = float(np.median(np.diff(told.trajectory.stamps)) / NS)
    for k, stamp in enumerate(stamps):
        seconds = (int(stamp) - start) / NS
        packet = oxts_packet(lambda t: told.trajectory.at(start + round(t * NS)), seconds, NOWHERE, step)
        (folder / "data" / f"{k:010d}.txt").write_text(packet)


def _write_sensors(folder: Path, bag: Bag, topics: Topics, told: Survey, matches: Matches) -> None:
    """Write the images and scans of the frames, in the order of the bag."""
    waiting = {
        topics.image: {int(stamp): k for k, stamp in enumerate(told.images[matches.images])},
        topics.points: {int(stamp): k for k, stamp in enumerate(told.scans[matches.scans])},
    }
    turn = rigid_transform(told.T_base_from_lidar[:3, :3], np.zeros(3))
    total = len(told.images) + len(told.scans)
    for topic, message in tqdm(bag.messages(topics.image, topics.points), "writing", total, leave=False):
        k = waiting[topic].pop(stamp_of(message), None)  # of equal time stamps the first
        if k is None:
            continue
        if topic == topics.image:
            image = Image.fromarray(_sized(message, told, bag.place(topic)))
            image.save(folder / "image_02" / "data" / f"{k:010d}.png", compress_level=4)
            continue
        cloud = cloud_of(message, bag.place(topic))
        columns = np.column_stack([transform_points(turn, cloud.points), cloud.brightness / told.brightest])
        (folder / "velodyne_points" / "data" / f"{k:010d}.bin").write_bytes(columns.astype("<f4").tobytes())


def _sized(message: object, told: Survey, place: str) -> NDArray[np.uint8]:
    """Decode an image, and check its size."""
    image = image_of(message, place)
    if image.shape[:2] != told.camera.size:
        expected, there = (f"{w} x {h} pixels" for h, w in (told.camera.size, image.shape[:2]))
        raise DataError(place, f"images of {expected}, as the first one", there)
    return image
