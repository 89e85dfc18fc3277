"""The filter over a whole drive: ego-motion from the poses of its frames (paper, section 3.2)."""

from collections.abc import Iterable, Iterator

import numpy as np

from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.cmcdot import Cmcdot
from semgrid_edu.occupancy.params import CmcdotParams
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.state import Belief

LIDAR_PERIOD = 0.1
"""Seconds between two scans of a scanner that turns at 10 Hz, as KITTI's does: the time step of the first frame."""


def track_drive(
    frames: Iterable[Frame],
    spec: GridSpec,
    params: CmcdotParams | None = None,
    seed: int | np.random.Generator = 0,
    keep_steps: bool = False,
) -> Iterator[Belief]:
    """Filter the scans of a drive, one after the other.

    Parameters
    ----------
    frames : iterable of Frame
        The frames of the drive in the order of time.
    spec : GridSpec
        The grid in which the filter hands out its beliefs, (H, W) cells.
    params : CmcdotParams, optional
        What the filter assumes of the world and of its sensor, and how it spends its particles.
    seed : int or numpy.random.Generator
        Seed or source of all random numbers that the filter draws.
    keep_steps : bool
        Whether each belief also tells what the filter's map held after each step (`Belief.steps`).

    Yields
    ------
    Belief
        The belief after each frame, in the grid frame of that instant.

    Raises
    ------
    ArgumentError
        When frames run backwards in time, or a scan or pose isn't finite.
    """
    tracker, before = Cmcdot(spec, params, seed, keep_steps), None
    for frame in frames:
        if before is None:
            motion, dt = PlanarMotion(), LIDAR_PERIOD
        else:
            motion = PlanarMotion.from_poses(before.T_world_from_lidar, frame.T_world_from_lidar)
            dt = frame.time - before.time
        yield tracker.step(frame.points_grid, motion, dt)
        before = frame
