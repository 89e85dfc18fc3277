"""Faults of recorded drives, injected on purpose to see which check detects which fault."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import rigid_transform, transform_points
from semgrid_edu.frame import Frame
from worlds import lecture_13_checks as checks
from worlds.lecture_13_domain import colour_distance, mean_histograms
from worlds.lecture_13_scan_borders import edge_contrast

TURN = 2.0
"""By how much a sensor is turned, degrees."""
LATE = 3
"""How many frames late a sensor's data are."""
YAWS = np.arange(-3.0, 3.01, 0.25)
"""Turns of the camera that are tried, degrees."""

Fault = Callable[[Sequence[Frame]], list[Frame]]
"""Takes the frames of a drive, more than ten, and returns them with a fault."""


def _turn(degrees: ArrayLike) -> NDArray[np.float64]:
    """Return a turn about x, y and z, degrees, as (4, 4)."""
    return rigid_transform(Rotation.from_rotvec(degrees, degrees=True).as_matrix(), np.zeros(3))


def camera_turned(frame: Frame, degrees: ArrayLike = (0, -TURN, 0)) -> Frame:
    """Turn the camera in the calibration alone, by 2 degrees to the right or by another turn.

    Parameters
    ----------
    frame : Frame
        A frame.
    degrees : (3,) float
        The turn about the camera's axes: pitch, yaw and roll.
    """
    turned = _turn(degrees) @ frame.camera.T_camera_from_lidar
    return replace(frame, camera=replace(frame.camera, T_camera_from_lidar=turned))


def image_mirrored(frame: Frame) -> Frame:
    """Swap left and right of the image alone, so that borders of the scan don't fall on their own.

    Parameters
    ----------
    frame : Frame
        A frame with an image.
    """
    return replace(frame, image=np.ascontiguousarray(frame.need_image()[:, ::-1]))


def lidar_turned(frame: Frame, degrees: ArrayLike = (0, TURN, 0)) -> Frame:
    """Turn the LIDAR without changing the calibration: tilt it back by 2 degrees, or by another turn.

    Parameters
    ----------
    frame : Frame
        A frame.
    degrees : (3,) float
        The turn about the LIDAR's axes, ahead, to the left and up: roll, pitch and yaw.
    """
    turned = transform_points(_turn(degrees), frame.points[:, :3])
    return replace(frame, points=np.column_stack([turned, frame.points[:, 3]]))


def _each(change: Callable[[Frame], Frame]) -> Fault:
    return lambda frames: [change(frame) for frame in frames]


def _pose_in(axes: str) -> Fault:
    """Return a fault that expresses the poses in wrong axes."""
    return _each(lambda frame: replace(frame, T_world_from_lidar=checks.AXES[axes](frame.T_world_from_lidar)))


def _images_late(frames: Sequence[Frame]) -> list[Frame]:
    """Give each frame the image of an earlier one."""
    return [replace(now, image=before.image) for before, now in zip(frames[:-LATE], frames[LATE:], strict=True)]


FAULTS: dict[str, Fault] = {
    "none": list,
    "two frames lost": lambda frames: [*frames[:7], *frames[9:]],
    "camera turned": _each(camera_turned),
    "images late": _images_late,
    "LIDAR tilted": _each(lidar_turned),
    "poses backwards": _pose_in("backwards"),
    "poses mirrored": _pose_in("left and right swapped"),
    "red and blue swapped": _each(lambda frame: replace(frame, image=frame.need_image()[..., ::-1])),
}
"""Every fault by name."""


def drive_readings(frames: Sequence[Frame], known: dict[str, NDArray], every: int = 4) -> dict[str, float]:
    """Return the reading of every check on a drive.

    Parameters
    ----------
    frames : sequence of Frame
        Successive frames with images, more than five.
    known : dict of str to (n,) float
        `mean_histograms` of the images that a network has learned from.
    every : int
        Images and ground are checked in each frame of this number.

    Returns
    -------
    dict of str to float
        "gaps": number of gaps in the times of the scans. "yaw": the turn of the camera at which borders in scan and
        image agree best, degrees. "tilt": the rise of the ground ahead, degrees. "motion": how much worse than the best
        motion of `AXES` that of the poses is, metres. "colours": how far the colours are from the known ones, total
        variation 0..1.
    """
    frames = checks.with_scan(frames)
    some = frames[::every]
    contrast = np.mean([edge_contrast(frame, YAWS) for frame in some], axis=0)
    errors = checks.axes_errors(frames)
    return {
        "gaps": float(len(checks.time_gaps([frame.time for frame in frames]))),
        "yaw": float(YAWS[contrast.argmax()]),
        "tilt": float(np.mean([checks.ground_plane(frame.points, frame.camera.lidar_height).pitch for frame in some])),
        "motion": errors["as the poses say"] - min(errors.values()),
        "colours": colour_distance(mean_histograms([frame.need_image() for frame in some]), known),
    }
