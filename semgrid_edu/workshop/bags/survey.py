"""What a bag's topics say before anything is written: time stamps, coordinate frames, calibration, path."""

from collections import Counter, defaultdict
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.camera import Camera, rigid_transform
from semgrid_edu.datasets.calibration import camera_from
from semgrid_edu.errors import DataError
from semgrid_edu.workshop.bags.bag import Bag, frame_of, stamp_of
from semgrid_edu.workshop.bags.pictures_and_clouds import image_of
from semgrid_edu.workshop.bags.transforms import NS, RecordedPath, StaticTransforms, pose_of

TYPES = {
    "image": ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"),
    "points": ("sensor_msgs/msg/PointCloud2",),
    "odometry": ("nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"),
    "camera_info": ("sensor_msgs/msg/CameraInfo",),
    "transforms": ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"),
}
"""The types of messages that each topic may have."""

BASE = "base_link"
"""The coordinate frame of poses that don't name theirs, geometry_msgs/PoseStamped."""

AHEAD = 0.5
"""The least part of a camera's viewing direction that must point ahead: its cosine, 60 degrees."""


class Topics(NamedTuple):
    """The topics to read.

    Parameters
    ----------
    image, points, odometry, camera_info : str
        Their names.
    transforms : str
        The topic of the fixed transforms.
    """

    image: str
    points: str
    odometry: str
    camera_info: str
    transforms: str = "/tf_static"


class Survey(NamedTuple):
    """What a bag says before its images and scans are written.

    Parameters
    ----------
    scans, images : (N,), (M,) int64
        Time stamps of all scans and images, nanoseconds, rising.
    trajectory : RecordedPath
        The path of the base.
    T_base_from_lidar : (4, 4) float64
        Metres.
    camera : Camera
        The camera; `T_camera_from_lidar` is from a frame at the LIDAR with the axes of the base.
    """

    scans: NDArray[np.int64]
    images: NDArray[np.int64]
    trajectory: RecordedPath
    T_base_from_lidar: NDArray[np.float64]
    camera: Camera


def survey(bag: Bag, topics: Topics, lidar_height: float) -> Survey:
    """Check everything that can be checked without decoding all images and scans.

    Parameters
    ----------
    bag : Bag
        An open bag.
    topics : Topics
        Its topics.
    lidar_height : float
        Height of the LIDAR above the ground, metres.

    Raises
    ------
    DataError
        When a topic is missing or of another type, time stamps don't rise, a topic's coordinate frame changes, there is
        no chain of transforms, or the images aren't rectified.
    """
    heard = _listen(bag, topics)
    rising = {topic: _rising(heard.stamps[topic], bag.place(topic)) for topic in topics[:3]}
    T_base_from_lidar, T_camera_from_base = _mounting(heard, bag, topics)
    T_base_from_level = rigid_transform(np.eye(3), T_base_from_lidar[:3, 3])
    size = image_of(heard.first[topics.image], bag.place(topics.image)).shape[:2]
    K, shift = _intrinsics(heard.first[topics.camera_info], size, topics, bag)
    T_camera_from_level = rigid_transform(np.eye(3), shift) @ T_camera_from_base @ T_base_from_level
    camera = camera_from(bag.place(topics.camera_info), K, T_camera_from_level, size, lidar_height)
    trajectory = RecordedPath(rising[topics.odometry], np.array(heard.poses))
    return Survey(rising[topics.points], rising[topics.image], trajectory, T_base_from_lidar, camera)


class _Heard(NamedTuple):
    """What is kept of all messages: by topic the first one, time stamps and frames; all poses and transforms."""

    first: dict[str, Any]
    stamps: defaultdict[str, list[int]]
    frames: defaultdict[str, set[str]]
    poses: list[NDArray[np.float64]]
    transforms: list[Any]


def _listen(bag: Bag, topics: Topics) -> _Heard:
    """Check that the topics are there, and go once through their messages."""
    total = sum(bag.count(topic, *types) for topic, types in zip(topics, TYPES.values(), strict=True))
    heard = _Heard({}, defaultdict(list), defaultdict(set), [], [])
    for topic, message in tqdm(bag.messages(*topics), "reading", total, leave=False):
        if topic == topics.transforms:
            heard.transforms.append(message)
            continue
        heard.first.setdefault(topic, message)
        heard.stamps[topic].append(stamp_of(message))
        heard.frames[topic].add(frame_of(message))
        if topic == topics.odometry:
            heard.poses.append(pose_of(message, bag.place(topic)))
    return heard


def _mounting(heard: _Heard, bag: Bag, topics: Topics) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return T_base_from_lidar and T_camera_from_base, (4, 4), metres."""
    lidar, eye = (_one_frame(heard.frames[topic], bag.place(topic)) for topic in (topics.points, topics.image))
    base = getattr(heard.first[topics.odometry], "child_frame_id", BASE).lstrip("/")
    fixed = StaticTransforms(heard.transforms, bag.place(topics.transforms))
    T_base_from_lidar = fixed.between(base, lidar)
    T_camera_from_base = fixed.between(eye, base)
    _check_ahead(T_camera_from_base[2, :3], f"{bag.place(topics.image)}, frame {eye}", base)
    return T_base_from_lidar, T_camera_from_base


def _rising(stamps: list[int], place: str) -> NDArray[np.int64]:
    """Return time stamps after checking that they rise."""
    times = np.array(stamps, np.int64)
    if len(times) < 2:
        raise DataError(place, "two messages at least", len(times))
    falls = np.flatnonzero(np.diff(times) <= 0)
    if falls.size:
        k = falls[0]
        found = f"{times[k + 1] / NS:.3f} s in message {k + 1} after {times[k] / NS:.3f} s"
        raise DataError(place, "time stamps that rise", found)
    return times


def _one_frame(names: set[str], place: str) -> str:
    """Return the one coordinate frame of a topic's messages."""
    if len(names) != 1 or "" in names:
        raise DataError(place, "one coordinate frame (frame_id)", ", ".join(map(repr, sorted(names))))
    return next(iter(names))


def _check_ahead(axis: NDArray[np.float64], place: str, base: str) -> None:
    """Check that a camera's axis, (3,) in the base, points along x of the vehicle: ROS has x ahead, y left, z up."""
    if axis[0] < AHEAD:
        found = f"({', '.join(f'{number:.2f}' for number in axis)})"
        raise DataError(place, f"a camera whose z axis looks ahead, along x of {base}", f"a look along {found}")


def is_rectified(topic: str) -> bool:
    """Return whether the name of an image topic says that the images are rectified, as image_proc names them.

    Parameters
    ----------
    topic : str
        The topic.

    Examples
    --------
    >>> is_rectified("/camera/image_rect_color/compressed"), is_rectified("/camera/image_raw")
    (True, False)
    """
    return "rect" in topic.removesuffix("/compressed").rpartition("/")[2]


def info_beside(topic: str) -> str:
    """Return the topic of the calibration that ROS keeps beside an image topic.

    Parameters
    ----------
    topic : str
        The image topic.

    Examples
    --------
    >>> info_beside("/camera/image_rect/compressed")
    '/camera/camera_info'
    """
    return topic.removesuffix("/compressed").rpartition("/")[0] + "/camera_info"


def _intrinsics(info: Any, size: tuple[int, int], topics: Topics, bag: Bag) -> tuple[NDArray, NDArray]:
    """Return K, (3, 3) pixels, and the shift to the camera, (3,) metres.

    Those of P for rectified images (right cameras of a pair are shifted, as `image_geometry` has it), of K for others.
    """
    place = bag.place(topics.camera_info)
    if (info.height, info.width) != size:
        expected = f"the size of the images of {topics.image}, {size[1]} x {size[0]} pixels"
        raise DataError(place, expected, f"{info.width} x {info.height}")
    rectified = is_rectified(topics.image)
    # ROS 1 writes these fields in capitals.
    D, K, P = (np.array(getattr(info, name, getattr(info, name.upper(), ())), np.float64) for name in "dkp")
    if D.any() and not rectified:
        expected = "rectified images: a topic such as image_rect_color (image_proc makes it), or no distortion"
        raise DataError(bag.place(topics.image), expected, f"distortion {D.tolist()} in {topics.camera_info}")
    if not rectified:
        return K.reshape(3, 3), np.zeros(3)
    P = P.reshape(3, 4)
    if not P[0, 0] > 0:
        raise DataError(place, "P, the projection of the rectified camera", P.tolist())
    return P[:, :3], np.array([P[0, 3] / P[0, 0], 0.0, 0.0])


class Matches(NamedTuple):
    """Which scans become frames.

    Parameters
    ----------
    scans, images : (F,) int
        Number of the scan and of the image of each frame, in their topics.
    left_out : Counter of str
        How many scans are left out, by the reason.
    """

    scans: NDArray[np.intp]
    images: NDArray[np.intp]
    left_out: Counter[str]


def matched(found: Survey, longest: float) -> Matches:
    """Give each scan the nearest image within half a scan period. An image belongs to one scan only.

    Parameters
    ----------
    found : Survey
        What the bag says.
    longest : float
        The longest time between the two poses around a scan, seconds.
    """
    scans, images = found.scans, found.images
    half = np.median(np.diff(scans)) / 2
    after = np.clip(np.searchsorted(images, scans), 1, len(images) - 1)
    nearest = np.where(scans - images[after - 1] <= images[after] - scans, after - 1, after)
    near = np.abs(images[nearest] - scans) <= half
    placed = found.trajectory.known(scans, longest)
    chosen = np.flatnonzero(near & placed)
    chosen = chosen[np.unique(nearest[chosen], return_index=True)[1]]
    reasons = {
        f"no odometry around them within {longest:g} s": np.sum(~placed),
        f"no image within {half / NS:.3g} s": np.sum(placed) - len(chosen),
    }
    return Matches(chosen, nearest[chosen], Counter({why: int(n) for why, n in reasons.items() if n}))
