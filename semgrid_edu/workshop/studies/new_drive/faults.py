"""Faults of recorded drives, each made on purpose, so that one can see which check notices which."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import rigid_transform, transform_points
from semgrid_edu.frame import Frame
from semgrid_edu.metrics import total_variation
from semgrid_edu.workshop.studies.new_drive.domain import mean_histograms
from semgrid_edu.workshop.studies.new_drive.drive_checks import edge_contrast, ground_plane, time_gaps, with_scan
from semgrid_edu.workshop.studies.new_drive.ego_motion import AXES, axes_errors

TURN = 2.0
"""By how much a sensor is turned, degrees."""
LATE = 3
"""How many frames late a sensor's data are."""
YAWS = np.arange(-3.0, 3.01, 0.25)
"""Turns of the camera that are tried, degrees."""


def camera_turned(frame: Frame) -> Frame:
    """Let the calibration say that the camera looks 2 degrees further to the right than it does.

    Parameters
    ----------
    frame : Frame
        A frame.
    """
    turn = rigid_transform(Rotation.from_rotvec([0, -TURN, 0], degrees=True).as_matrix(), np.zeros(3))
    camera = replace(frame.camera, T_camera_from_lidar=turn @ frame.camera.T_camera_from_lidar)
    return replace(frame, camera=camera)


def lidar_tilted(frame: Frame) -> Frame:
    """Let the LIDAR lean back by 2 degrees, which the calibration doesn't know.

    Parameters
    ----------
    frame : Frame
        A frame.
    """
    tilt = rigid_transform(Rotation.from_rotvec([0, TURN, 0], degrees=True).as_matrix(), np.zeros(3))
    points = np.column_stack([transform_points(tilt, frame.points[:, :3]), frame.points[:, 3]])
    return replace(frame, points=points)


def _pose_in(axes: str) -> Callable[[Frame], Frame]:
    """Return a function that expresses the pose of a frame in wrong axes."""
    return lambda frame: replace(frame, T_world_from_lidar=AXES[axes](frame.T_world_from_lidar))


def _each(change: Callable[[Frame], Frame]) -> Callable[[Sequence[Frame]], list[Frame]]:
    return lambda frames: [change(frame) for frame in frames]


def _late(*names: str) -> Callable[[Sequence[Frame]], list[Frame]]:
    """Return a function that gives each frame what an earlier one has."""
    return lambda frames: [
        replace(now, **{name: getattr(then, name) for name in names})
        for then, now in zip(frames[:-LATE], frames[LATE:], strict=True)
    ]


FAULTS: dict[str, Callable[[Sequence[Frame]], list[Frame]]] = {
    "none": list,
    "two frames lost": lambda frames: [*frames[:7], *frames[9:]],
    "camera turned": _each(camera_turned),
    "images late": _late("image"),
    "LIDAR tilted": _each(lidar_tilted),
    "poses backwards": _each(_pose_in("backwards")),
    "poses mirrored": _each(_pose_in("left and right swapped")),
    "red and blue swapped": _each(lambda frame: replace(frame, image=frame.need_image()[..., ::-1])),
}
"""Functions that take the frames of a drive, more than ten, and return them with a fault, by name."""


def drive_readings(frames: Sequence[Frame], known: dict[str, NDArray], every: int = 4) -> dict[str, float]:
    """Read off every check of a drive.

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
    frames = with_scan(frames)
    some = frames[::every]
    contrast = np.mean([edge_contrast(frame, YAWS) for frame in some], axis=0)
    errors, seen = axes_errors(frames), mean_histograms([frame.need_image() for frame in some])
    return {
        "gaps": float(len(time_gaps([frame.time for frame in frames]))),
        "yaw": float(YAWS[contrast.argmax()]),
        "tilt": float(np.mean([ground_plane(frame.points, frame.camera.lidar_height).pitch for frame in some])),
        "motion": errors["as the poses say"] - min(errors.values()),
        "colours": colour_distance(seen, known),
    }


def colour_distance(a: dict[str, NDArray], b: dict[str, NDArray]) -> float:
    """Return how far the colours of two sets of images are apart.

    Parameters
    ----------
    a, b : dict of str to (n,) float
        From `mean_histograms`.

    Returns
    -------
    float
        The mean over red, green and blue of the total variation of the histograms, 0..1.
    """
    return float(np.mean([total_variation(a[name], b[name]) for name in ("red", "green", "blue")]))
