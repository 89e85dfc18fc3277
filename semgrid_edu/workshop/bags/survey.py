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
from semgrid_edu.workshop.bags.pictures_and_clouds import FARTHEST, cloud_of, image_of, unit_of_brightness
from semgrid_edu.workshop.bags.transforms import NS, RecordedPath, StaticTransforms, pose_of

TYPES = {
    "image": ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"),
    "points": ("sensor_msgs/msg/PointCloud2",),
    "odometry": (
        "nav_msgs/msg/Odometry",
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
    ),
    "camera_info": ("sensor_msgs/msg/CameraInfo",),
    "transforms": ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"),
}
"""The types of messages that each topic may have."""

BASE = "base_link"
"""The coordinate frame of poses that don't name theirs, such as those of geometry_msgs/PoseStamped."""

UPRIGHT = 0.5
"""The least part of a camera's view that points ahead, and of its y axis that points down: the cosine of 60 degrees."""

JUMP = 1.0
"""How far time stamps may fall back, seconds: messages may overtake each other, but clocks may not be set."""

LONGEST_GAP = 0.5
"""The longest time between a scan and its image, seconds; readers refuse more."""

NO_PINHOLE = ("equidistant", "fisheye")
"""Models of distortion that are no pinhole even if all their coefficients are 0."""


class Topics(NamedTuple):
    """The topics to read.

    Parameters
    ----------
    image, points, odometry, camera_info : str
        Their names.
    transforms : tuple of str
        The topics that fixed transforms are on.
    """

    image: str
    points: str
    odometry: str
    camera_info: str
    transforms: tuple[str, ...] = ("/tf_static",)


class Survey(NamedTuple):
    """What a bag says before its images and scans are written.

    Parameters
    ----------
    scans, images : (N,), (M,) int64
        Time stamps of all scans with returns and of all images, nanoseconds, rising.
    trajectory : RecordedPath
        The path of the base.
    T_base_from_lidar : (4, 4) float64
        Metres.
    camera : Camera
        The camera; `T_camera_from_lidar` is from a frame at the LIDAR with the axes of the base.
    brightest : float
        The brightness of returns that is a reflectance of 1.
    left_out : Counter of str
        How many scans and returns aren't used, by what is wrong with them.
    """

    scans: NDArray[np.int64]
    images: NDArray[np.int64]
    trajectory: RecordedPath
    T_base_from_lidar: NDArray[np.float64]
    camera: Camera
    brightest: float
    left_out: Counter[str]


def survey(bag: Bag, topics: Topics, lidar_height: float) -> Survey:
    """Go once through a bag, and check all but the images after the first.

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
        When a topic is missing or of another type, a clock is set back, a topic's coordinate frame changes, there is no
        chain of transforms, the images aren't rectified, or a scan or the first image can't be decoded.
    """
    heard = _listen(bag, topics)
    images, _ = _rising(heard.stamps[topics.image], bag.place(topics.image))
    scans, _ = _rising(heard.stamps[topics.points], bag.place(topics.points))
    stamps, first = _rising(heard.stamps[topics.odometry], bag.place(topics.odometry))
    heard.left_out["scans with the time stamp of an earlier one"] = len(heard.stamps[topics.points]) - len(scans)
    T_base_from_lidar, T_camera_from_base = _mounting(heard, bag, topics)
    T_camera_from_level = T_camera_from_base @ rigid_transform(np.eye(3), T_base_from_lidar[:3, 3])
    size = image_of(heard.first[topics.image], bag.place(topics.image)).shape[:2]
    K = _intrinsics(heard.first[topics.camera_info], size, topics, bag)
    camera = camera_from(bag.place(topics.camera_info), K, T_camera_from_level, size, lidar_height)
    trajectory = RecordedPath(stamps, np.array(heard.poses)[first])
    unit = unit_of_brightness(max(heard.brightest))
    return Survey(scans, images, trajectory, T_base_from_lidar, camera, unit, heard.left_out)


class _Heard(NamedTuple):
    """What is kept of all messages: by topic the first one, time stamps and frames; the rest of all topics together."""

    first: dict[str, Any]
    stamps: defaultdict[str, list[int]]
    frames: defaultdict[str, set[str]]
    poses: list[NDArray[np.float64]]
    brightest: list[float]
    left_out: Counter[str]
    transforms: StaticTransforms


def _listen(bag: Bag, topics: Topics) -> _Heard:
    """Check that the topics are there, and go once through their messages."""
    wanted = [(getattr(topics, kind), types) for kind, types in TYPES.items() if kind != "transforms"]
    wanted += [(topic, TYPES["transforms"]) for topic in topics.transforms]
    total = sum(bag.count(topic, *types) for topic, types in wanted)
    transforms = StaticTransforms(bag.place(", ".join(topics.transforms)))
    heard = _Heard({}, defaultdict(list), defaultdict(set), [], [], Counter(), transforms)
    for topic, message in tqdm(bag.messages(*dict(wanted)), "reading", total, leave=False):
        if topic in topics.transforms:
            heard.transforms.add(message)
        elif topic != topics.points or _has_returns(message, bag.place(topic), heard):
            heard.first.setdefault(topic, message)
            heard.stamps[topic].append(stamp_of(message))
            heard.frames[topic].add(frame_of(message))
        if topic == topics.odometry:
            heard.poses.append(pose_of(message, bag.place(topic)))
            heard.frames["base"].add(getattr(message, "child_frame_id", "").lstrip("/") or BASE)
    return heard


def _has_returns(message: Any, place: str, heard: _Heard) -> bool:
    """Decode a scan, keep how bright it is and what is wrong with it, and return whether it has returns."""
    cloud = cloud_of(message, place)
    heard.brightest.append(cloud.brightness.max(initial=0.0))
    heard.left_out[f"returns beyond {FARTHEST:.0f} m"] += cloud.n_far
    heard.left_out["scans without returns"] += not len(cloud.points)
    return len(cloud.points) > 0


def _mounting(heard: _Heard, bag: Bag, topics: Topics) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return T_base_from_lidar and T_camera_from_base, (4, 4), metres."""
    lidar = _one_frame(heard.frames[topics.points], bag.place(topics.points))
    camera = _one_frame(heard.frames[topics.image], bag.place(topics.image))
    base = _one_frame(heard.frames["base"], bag.place(topics.odometry), "child_frame_id")
    T_base_from_lidar = heard.transforms.between(base, lidar)
    T_camera_from_base = heard.transforms.between(camera, base)
    _check_upright(T_camera_from_base[:3, :3], f"{bag.place(topics.image)}, frame {camera}", base)
    return T_base_from_lidar, T_camera_from_base


def _rising(stamps: list[int], place: str) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Return the time stamps in their order, each once, and the number of the first message that has it."""
    times = np.array(stamps, np.int64)
    jumps = np.flatnonzero(np.diff(times) < -JUMP * NS)
    if jumps.size:
        k = jumps[0]
        found = f"{times[k + 1] / NS:.3f} s in message {k + 1} after {times[k] / NS:.3f} s"
        raise DataError(place, "a clock that isn't set back", found)
    rising, first = np.unique(times, return_index=True)
    if len(rising) < 2:
        raise DataError(place, "two usable messages at least, with two time stamps", len(rising))
    return rising, first


def _one_frame(names: set[str], place: str, field: str = "frame_id") -> str:
    """Return the one coordinate frame of a topic's messages."""
    if len(names) != 1 or "" in names:
        raise DataError(place, f"one coordinate frame ({field})", ", ".join(map(repr, sorted(names))))
    return next(iter(names))


def _check_upright(R_camera_from_base: NDArray[np.float64], place: str, base: str) -> None:
    """Check that a camera looks ahead and isn't upside down in a base as ROS has it: x ahead, y left, z up."""
    _, down, ahead = R_camera_from_base
    if ahead[0] < UPRIGHT or -down[2] < UPRIGHT:
        expected = f"a camera whose z axis looks ahead, along x of {base}, and whose y axis points down, against z"
        looks, points = (f"({', '.join(f'{number:.2f}' for number in axis)})" for axis in (ahead, down))
        raise DataError(place, expected, f"z along {looks}, y along {points}")


def is_rectified(topic: str) -> bool:
    """Return whether the name of an image topic says that the images are rectified, as image_proc names them.

    Parameters
    ----------
    topic : str
        The topic.

    Examples
    --------
    >>> [is_rectified(f"/camera/{name}") for name in ("image_rect_color/compressed", "image_unrect", "image_raw")]
    [True, False, False]
    """
    return topic.removesuffix("/compressed").rpartition("/")[2].startswith("image_rect")


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


def _intrinsics(info: Any, size: tuple[int, int], topics: Topics, bag: Bag) -> NDArray[np.float64]:
    """Return the camera's matrix, (3, 3) pixels: from P for rectified images, from K for others."""
    place = bag.place(topics.camera_info)
    if (info.height, info.width) != size:
        expected = f"the size of the images of {topics.image}, {size[1]} x {size[0]} pixels"
        raise DataError(place, expected, f"{info.width} x {info.height}")
    D, K, P = (_calibrated(info, name) for name in ("d", "k", "p"))
    if is_rectified(topics.image):
        return _left_of_pair(P.reshape(3, 4), place)
    if D.any() or info.distortion_model in NO_PINHOLE:
        expected = "rectified images: a topic such as image_rect_color (image_proc makes it), or no distortion"
        found = f"distortion {info.distortion_model!r} {D.tolist()} in {topics.camera_info}"
        raise DataError(bag.place(topics.image), expected, found)
    return K.reshape(3, 3)


def _calibrated(info: Any, name: str) -> NDArray[np.float64]:
    """Return the numbers of a field of the calibration, which ROS 1 writes in capitals."""
    numbers = getattr(info, name) if hasattr(info, name) else getattr(info, name.upper())
    return np.array(numbers, np.float64)


def _left_of_pair(P: NDArray[np.float64], place: str) -> NDArray[np.float64]:
    """Return K of a projection, (3, 4), after checking that the camera isn't the right one of a pair.

    Drivers don't agree whether the frame of its images is shifted already.
    """
    if not P[0, 0] > 0:
        raise DataError(place, "P, the projection of the rectified camera", P.tolist())
    if P[:, 3].any():
        raise DataError(place, "a single camera or the left one of a pair, with 0 in P's last column", P[:, 3].tolist())
    return P[:, :3]


class Matches(NamedTuple):
    """Which scans become frames.

    Parameters
    ----------
    scans, images : (F,) int
        The scan and the image of each frame, as places in `Survey.scans` and `Survey.images`.
    left_out : Counter of str
        How many scans and returns aren't used, by what is wrong with them.
    """

    scans: NDArray[np.intp]
    images: NDArray[np.intp]
    left_out: Counter[str]


def matched(told: Survey, longest: float) -> Matches:
    """Give each scan the nearest image within half a scan period. An image belongs to the nearest scan only.

    Parameters
    ----------
    told : Survey
        What the bag says.
    longest : float
        The longest time between the two poses around a scan, seconds.
    """
    scans = told.scans
    images = told.images
    half = min(np.median(np.diff(scans)) / 2, LONGEST_GAP * NS)
    after = np.clip(np.searchsorted(images, scans), 1, len(images) - 1)
    nearest = np.where(scans - images[after - 1] <= images[after] - scans, after - 1, after)
    apart = np.abs(images[nearest] - scans)
    placed = told.trajectory.known(scans, longest)
    usable = np.flatnonzero((apart <= half) & placed)
    usable = usable[np.argsort(apart[usable], kind="stable")]
    # Of the scans with the same nearest image, `np.unique` keeps the first: the nearest one.
    chosen = usable[np.unique(nearest[usable], return_index=True)[1]]
    left_out = told.left_out + Counter(
        {
            f"scans without odometry around them within {longest:g} s": int(np.sum(~placed)),
            f"scans without an image of their own within {half / NS:.3g} s": int(np.sum(placed)) - len(chosen),
        }
    )
    return Matches(chosen, nearest[chosen], left_out)  # a sum of counters has no zeros
