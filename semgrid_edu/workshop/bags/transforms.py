"""Where things are in a bag: fixed transforms between the sensors, and the path of the vehicle."""

from collections import defaultdict
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import invert_rigid, rigid_transform
from semgrid_edu.errors import DataError

NS = 1e9
"""Nanoseconds in a second."""


FIXED = 1e-4
"""By how much the numbers of a fixed transform may differ from message to message, metres and parts of 1."""


def _numbers(vector: Any, quaternion: Any) -> tuple[float, ...]:
    """Return the seven numbers of a message's vector and quaternion."""
    return vector.x, vector.y, vector.z, quaternion.x, quaternion.y, quaternion.z, quaternion.w


def _rigid(numbers: tuple[float, ...], place: str) -> NDArray[np.float64]:
    """Return the (4, 4) transform of a vector and a quaternion."""
    if not (np.isfinite(numbers).all() and abs(np.linalg.norm(numbers[3:]) - 1) < 0.01):
        raise DataError(place, "finite positions and quaternions of length 1", list(numbers))
    return rigid_transform(Rotation.from_quat(numbers[3:]).as_matrix(), np.array(numbers[:3]))


class StaticTransforms:
    """The tree of coordinate frames, in which only transforms that never change are walked along.

    Parameters
    ----------
    place : str
        The topics, for errors.
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self.links: dict[str, tuple[str, tuple[float, ...]]] = {}
        self.changing: set[str] = set()

    def add(self, message: Any) -> None:
        """Take in what was sent.

        Parameters
        ----------
        message : tf2_msgs/TFMessage
            Transforms to any frames.
        """
        for one in message.transforms:
            child = one.child_frame_id.lstrip("/")
            parent = one.header.frame_id.lstrip("/")
            numbers = _numbers(one.transform.translation, one.transform.rotation)
            known_parent, known = self.links.setdefault(child, (parent, numbers))
            if parent != known_parent or not np.allclose(numbers, known, rtol=0, atol=FIXED):
                self.changing.add(child)

    def between(self, target: str, source: str) -> NDArray[np.float64]:
        """Return T_target_from_source, (4, 4), metres, along the chain of transforms between two frames.

        Parameters
        ----------
        target, source : str
            Names of coordinate frames.

        Raises
        ------
        DataError
            When no chain leads from one to the other; the error lists the transforms that there are.
        """
        neighbours = defaultdict(list)
        for child, (parent, numbers) in self.links.items():
            if child in self.changing:
                continue
            T_parent_from_child = _rigid(numbers, f"{self.place}, {parent} -> {child}")
            neighbours[child].append((parent, T_parent_from_child))
            neighbours[parent].append((child, invert_rigid(T_parent_from_child)))
        reached = {source: np.eye(4)}
        waiting = [source]
        for frame in waiting:  # grows while it is walked through
            for other, T_other_from_frame in neighbours[frame]:
                if other not in reached:
                    reached[other] = T_other_from_frame @ reached[frame]
                    waiting.append(other)
        if target not in reached:
            there = ", ".join(
                f"{parent} -> {child}" + " (changes)" * (child in self.changing)
                for child, (parent, _) in self.links.items()
            )
            raise DataError(self.place, f"a chain of fixed transforms between {source} and {target}", there or "none")
        return reached[target]


def pose_of(message: Any, place: str) -> NDArray[np.float64]:
    """Return a pose, (4, 4) T_world_from_base, metres.

    Parameters
    ----------
    message : nav_msgs/Odometry, geometry_msgs/PoseStamped or PoseWithCovarianceStamped
        The pose.
    place : str
        The topic, for the error.
    """
    pose = getattr(message.pose, "pose", message.pose)
    return _rigid(_numbers(pose.position, pose.orientation), place)


class RecordedPath:
    """Poses at any time: positions on straight lines and turns at a constant rate from one message to the next.

    Parameters
    ----------
    stamps : (M,) int64
        Their times, nanoseconds, rising; two at least.
    poses : (M, 4, 4) float64
        T_world_from_base, metres.
    """

    def __init__(self, stamps: NDArray[np.int64], poses: NDArray[np.float64]) -> None:
        self.stamps = stamps
        self.poses = poses

    def known(self, stamps: NDArray[np.int64], longest: float) -> NDArray[np.bool_]:
        """Return which times, (N,), are between two poses that aren't too far apart in time.

        Parameters
        ----------
        stamps : (N,) int64
            Times, nanoseconds.
        longest : float
            The longest time between two poses, seconds.
        """
        before = self._before(stamps)
        near = self.stamps[before + 1] - self.stamps[before] <= longest * NS
        return near & (stamps >= self.stamps[0]) & (stamps <= self.stamps[-1])

    def at(self, stamp: int) -> NDArray[np.float64]:
        """Return T_world_from_base, (4, 4), at a time; beyond the ends the motion goes on.

        Parameters
        ----------
        stamp : int
            Nanoseconds.
        """
        k = int(self._before(stamp))
        share = (stamp - self.stamps[k]) / (self.stamps[k + 1] - self.stamps[k])
        first = self.poses[k]
        second = self.poses[k + 1]
        turn = Rotation.from_matrix(first[:3, :3].T @ second[:3, :3]).as_rotvec()
        rotation = first[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
        return rigid_transform(rotation, first[:3, 3] + share * (second[:3, 3] - first[:3, 3]))

    def _before(self, stamps: NDArray | int) -> NDArray[np.intp]:
        """Return the last pose before each time that has a successor."""
        return np.clip(np.searchsorted(self.stamps, stamps, side="right") - 1, 0, len(self.stamps) - 2)
