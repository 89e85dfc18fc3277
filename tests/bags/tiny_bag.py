"""Writes a bag of six scans by `rosbags`: a car that turns left at 5 m/s among landmarks that stay where they are.

Everything is computed from its definition, with none of the package's readers or writers.
"""

from dataclasses import dataclass, field
from functools import cache
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation
from tiny_drive import SIZE, K

START = 1_767_261_600_000_000_000
"""2026-01-01 10:00:00 UTC, nanoseconds."""
N_SCANS, PERIOD = 6, 100_000_000
SPEED, TURN = 5.0, 0.2
"""Metres and radians a second."""


def rigid(angles: tuple, shift: tuple) -> np.ndarray:
    """A transform by roll, pitch and yaw in degrees, and metres."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    T[:3, 3] = shift
    return T


T_BASE_FROM_LIDAR = rigid((2, 10, 90), (0.5, 0.1, 1.6))  # tilted, and turned to the left
T_BASE_FROM_MOUNT = rigid((0, 3, -2), (0.9, -0.1, 1.3))
T_MOUNT_FROM_OPTICAL = np.eye(4)
T_MOUNT_FROM_OPTICAL[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]  # z ahead, x right, y down
LANDMARKS = np.random.default_rng(0).uniform((-20, -20, 0), (20, 20, 3), (50, 3))
BRIGHTNESS = np.arange(50.0) * 5
IMAGES = np.random.default_rng(1).integers(0, 256, (N_SCANS, *SIZE, 3), np.uint8)


def pose(t: float) -> np.ndarray:
    """T_world_from_base after t seconds on a circle."""
    angle = TURN * t
    radius = SPEED / TURN
    T = rigid((0, 0, np.degrees(angle) + 30), (7.0, -3.0, 0.5))
    T[:3, 3] += rigid((0, 0, 30), (0, 0, 0))[:3, :3] @ [radius * np.sin(angle), radius * (1 - np.cos(angle)), 0]
    return T


@dataclass
class Recipe:
    """How a bag differs from the usual one."""

    image_topic: str = "/cam/image_raw"
    encoding: str = "rgb8"
    distortion: float = 0.0
    model: str = "plumb_bob"
    shift: float = 0.0
    intensity: str | None = "intensity"
    intensity_type: int = 7
    intensity_scale: float = 1.0
    big_endian: bool = False
    pose_type: str = "nav_msgs/msg/Odometry"
    base: str = "base_link"
    without: str = ""
    left_out_images: tuple = ()
    scan_stamps: dict = field(default_factory=dict)
    empty_scans: tuple = ()
    n_far: int = 0
    tf_topic: str = "/tf_static"
    drifting: str = ""
    base_turn: tuple = (0, 0, 0)
    slash: str = ""
    transforms: tuple = ("base_link lidar", "base_link mount", "mount optical")
    info_size: tuple = SIZE


@cache
def known_types(is_ros1: bool):
    """The types of messages, whose code is made once for all bags."""
    if not is_ros1:
        return get_typestore(Stores.ROS2_HUMBLE)
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    return store


def write_bag(path: Path, kind: str = "mcap", **changes) -> Path:
    """Write a bag of the kind ros1, sqlite3 or mcap; return its file or folder."""
    recipe = Recipe(**changes)
    store = known_types(kind == "ros1")
    if kind == "ros1":
        path = path.with_suffix(".bag")
        writer = Writer1(path)
    else:
        plugin = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[kind]
        writer = Writer2(path, version=9, storage_plugin=plugin)
    serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
    messages = [one for one in Messages(store, kind == "ros1", recipe).all() if one[0] != recipe.without]
    with writer:
        connections = {}
        for topic, when, message in sorted(messages, key=lambda one: one[1]):
            name = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=store)
            writer.write(connections[topic], when, serialize(message, name))
    return path


class Messages:
    """Makes the messages."""

    def __init__(self, store, is_ros1: bool, recipe: Recipe):
        self.types, self.is_ros1, self.recipe = store.types, is_ros1, recipe

    def make(self, name: str, /, **fields):
        return self.types[name](**fields)

    def header(self, stamp: int, frame: str):
        time = self.make("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
        return self.make(
            "std_msgs/msg/Header",
            stamp=time,
            frame_id=self.recipe.slash + frame,
            **({"seq": 0} if self.is_ros1 else {}),
        )

    def all(self):
        for k in range(N_SCANS if self.recipe.tf_topic == "/tf" else 1):
            yield self.recipe.tf_topic, START + k * PERIOD, self.static(k)
        for k in range(N_SCANS):
            stamp = START + k * PERIOD
            yield "/points", stamp + 1, self.cloud(k, self.recipe.scan_stamps.get(k, stamp))
            if k not in self.recipe.left_out_images:
                yield self.recipe.image_topic, stamp + 2, self.image(k, stamp + 7_000_000)
                yield "/cam/camera_info", stamp + 2, self.info(stamp + 7_000_000)
        for k in range(-1, 30):
            stamp = START + k * PERIOD // 5 + 3_000_000
            yield "/odom", stamp, self.odometry(stamp)

    def static(self, k: int):
        """The fixed transforms, and on /tf the path too, which changes."""
        turn = rigid(self.recipe.base_turn, (0, 0, 0))
        known = {
            "base_link lidar": turn @ T_BASE_FROM_LIDAR,
            "base_link mount": turn @ T_BASE_FROM_MOUNT,
            "mount optical": T_MOUNT_FROM_OPTICAL,
            "ground base_link": rigid((0, 0, 0), (0.2, 0.0, 0.3)),
            "ground lidar": rigid((0, 0, 0), (0.2, 0.0, 0.3)) @ T_BASE_FROM_LIDAR,
            "odom base_link": pose(k * PERIOD / 1e9),
        }
        transforms = []
        for names in (*self.recipe.transforms, *["odom base_link"][: self.recipe.tf_topic == "/tf"]):
            parent, child = names.split()
            (x, y, z), turn = known[names][:3, 3], self.quaternion(known[names])
            z += 0.01 * k * (names == self.recipe.drifting)
            vector = self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
            transform = self.make("geometry_msgs/msg/Transform", translation=vector, rotation=turn)
            stamped = {"header": self.header(START, parent), "child_frame_id": child, "transform": transform}
            transforms.append(self.make("geometry_msgs/msg/TransformStamped", **stamped))
        return self.make("tf2_msgs/msg/TFMessage", transforms=transforms)

    def quaternion(self, T):
        x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
        return self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def odometry(self, stamp: int):
        T = pose((stamp - START) / 1e9)
        x, y, z = T[:3, 3]
        point = self.make("geometry_msgs/msg/Point", x=x, y=y, z=z)
        place = self.make("geometry_msgs/msg/Pose", position=point, orientation=self.quaternion(T))
        if self.recipe.pose_type.endswith("PoseStamped"):
            return self.make(self.recipe.pose_type, header=self.header(stamp, "map"), pose=place)
        doubt = np.zeros(36)
        unsure = self.make("geometry_msgs/msg/PoseWithCovariance", pose=place, covariance=doubt)
        if self.recipe.pose_type.endswith("PoseWithCovarianceStamped"):
            return self.make(self.recipe.pose_type, header=self.header(stamp, "map"), pose=unsure)
        zero = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        twist = self.make("geometry_msgs/msg/Twist", linear=zero, angular=zero)
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(stamp, "odom"),
            child_frame_id=self.recipe.base,
            pose=unsure,
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=doubt),
        )

    def image(self, k: int, stamp: int):
        header = self.header(stamp, "optical")
        pixels = IMAGES[k]
        if self.recipe.encoding.startswith("png"):
            file = BytesIO()
            pixels = pixels[..., 0].astype(np.uint16) if self.recipe.encoding == "png16" else pixels
            Image.fromarray(pixels).save(file, "PNG")
            data = np.frombuffer(file.getvalue(), np.uint8)
            return self.make("sensor_msgs/msg/CompressedImage", header=header, format="png", data=data)
        if self.recipe.encoding in ("bgr8", "bgra8", "8UC3"):
            pixels = pixels[..., ::-1]
        if self.recipe.encoding in ("rgba8", "bgra8"):
            pixels = np.dstack([pixels, np.full(SIZE, 200, np.uint8)])
        if self.recipe.encoding == "mono8":
            pixels = pixels[..., :1]
        rows = pixels.reshape(SIZE[0], -1)
        padded = np.hstack([rows, np.full((SIZE[0], 5), 99, np.uint8)])
        return self.make(
            "sensor_msgs/msg/Image", header=header, height=SIZE[0], width=SIZE[1], encoding=self.recipe.encoding,
            is_bigendian=0, step=padded.shape[1], data=padded.ravel(),
        )  # fmt: skip

    def info(self, stamp: int):
        roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        P = np.c_[K, [self.recipe.shift, 0, 0]].ravel()
        raw = K if not self.recipe.distortion else K + np.diag([3.0, 3.0, 0.0])
        calibration = {"d": np.full(5, self.recipe.distortion), "k": raw.ravel(), "r": np.eye(3).ravel(), "p": P}
        calibration = {name.upper() if self.is_ros1 else name: values for name, values in calibration.items()}
        return self.make(
            "sensor_msgs/msg/CameraInfo", header=self.header(stamp, "optical"), height=self.recipe.info_size[0],
            width=self.recipe.info_size[1], distortion_model=self.recipe.model, binning_x=0, binning_y=0,
            roi=self.make("sensor_msgs/msg/RegionOfInterest", **roi), **calibration,
        )  # fmt: skip

    def cloud(self, k: int, stamp: int):
        """The landmarks as the LIDAR sees them, far returns and two beams without one, in two padded rows."""
        T_lidar_from_world = np.linalg.inv(pose((stamp - START) / 1e9) @ T_BASE_FROM_LIDAR)
        points = LANDMARKS @ T_lidar_from_world[:3, :3].T + T_lidar_from_world[:3, 3]
        points = np.vstack([points, *[[200, 200, 0]] * self.recipe.n_far, [np.nan] * 3, [0, 0, 0]])
        points = points[: 0 if k in self.recipe.empty_scans else None]
        order = ">" if self.recipe.big_endian else "<"
        kind = {2: "u1", 4: "u2", 7: "f4", 8: "f8"}[self.recipe.intensity_type]
        layout = {"z": ("f4", 1, 7), "x": ("f8", 9, 8), "y": ("f4", 21, 7)}
        if self.recipe.intensity:
            layout[self.recipe.intensity] = (kind, 26, self.recipe.intensity_type)
        formats, offsets, types = zip(*layout.values(), strict=True)
        formats = [order + one for one in formats]
        records = np.zeros(
            len(points), {"names": list(layout), "formats": formats, "offsets": list(offsets), "itemsize": 40}
        )
        for name, column in zip("xyz", points.T, strict=True):
            records[name] = column
        if self.recipe.intensity:
            brightness = np.append(BRIGHTNESS, [7] * (self.recipe.n_far + 2)) * self.recipe.intensity_scale
            records[self.recipe.intensity] = brightness[: len(points)]
        rows = np.frombuffer(records.tobytes(), np.uint8).reshape(2, -1)
        padded = np.hstack([rows, np.full((2, 3), 7, np.uint8)])
        fields = [
            self.make("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=number, count=1)
            for name, offset, number in zip(layout, offsets, types, strict=True)
        ]
        return self.make(
            "sensor_msgs/msg/PointCloud2", header=self.header(stamp, "lidar"), height=2, width=len(points) // 2,
            fields=fields, is_bigendian=self.recipe.big_endian, point_step=40, row_step=padded.shape[1],
            data=padded.ravel(), is_dense=False,
        )  # fmt: skip
