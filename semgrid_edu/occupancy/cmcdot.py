"""CMCDOT, the Conditional Monte Carlo Dense Occupancy Tracker (paper, section 3.2; Rummelhard et al., ITSC 2015)."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy._runtime import keep_memory, on_another_core, undo_after_errors
from semgrid_edu.occupancy.local_belief import local_belief, observe, velocity_moments
from semgrid_edu.occupancy.particles import cells_of, transform
from semgrid_edu.occupancy.planar_motion import MAX_YAW, PlanarMotion, look_up, map_around, scroll
from semgrid_edu.occupancy.state import Belief, FilterState, Particles
from semgrid_edu.occupancy.steps import NOTHING_KNOWN, move, predict, resample, update
from semgrid_edu.occupancy.world import CmcdotParams


class Cmcdot:
    """The filter: give it scan after scan, and it tells free, static, dynamic and unknown cells apart.

    Inside, it keeps a map that is somewhat larger than the grid, stays aligned with the world, and scrolls under the
    vehicle by whole cells (`scroll`). For the belief that it hands out, it looks up in the vehicle's own cells what
    the map predicts, and updates those cells with the scan (`local_belief`). Nothing of that goes back to the map.

    Parameters
    ----------
    spec : GridSpec
        The grid in which the filter hands out its beliefs, (H, W) cells.
    params : CmcdotParams, optional
        What the filter assumes of the world and of its sensor, and how it spends its particles.
    seed : int or numpy.random.Generator
        Seed or source of all random numbers that the filter draws: the same seed gives the same bits.
    keep_steps : bool
        Whether each belief also holds what the map held after each step (`Belief.steps`). Apart from that, the
            beliefs are the same.

    Examples
    --------
    >>> tracker = Cmcdot(GridSpec.compact(), seed=0)
    >>> wall = np.array([[20.25, y, 1.0] for y in np.arange(-3, 3, 0.1)])
    >>> belief = tracker.step(wall, PlanarMotion(), dt=0.1)
    >>> belief.probability[:, 101, 31].argmax(), belief.probability[:, 120, 31].argmax()
    (np.int64(1), np.int64(0))
    """

    def __init__(
        self,
        spec: GridSpec,
        params: CmcdotParams | None = None,
        seed: int | np.random.Generator = 0,
        keep_steps: bool = False,
    ) -> None:
        self.spec = spec
        self.keep_steps = keep_steps
        self.params = params or CmcdotParams()
        self.map_spec = map_around(spec, MAX_YAW)
        self._rng = np.random.default_rng(seed)
        self._pose = PlanarMotion()
        self._state = FilterState.unknown(self.map_spec)
        keep_memory()

    @property
    def particles(self) -> Particles:
        """The particles in the grid frame of the vehicle. Some lie outside the grid, in the margin of the map."""
        return transform(self._state.particles, self._pose)

    def step(self, points_grid: NDArray, motion: PlanarMotion, dt: float) -> Belief:
        """Take in one scan: move, predict, update, resample.

        Parameters
        ----------
        points_grid : (N, 3+) float
            The scan's returns: x forward, y left, z above the ground on which the vehicle stands (m), in the grid
            frame of the vehicle now; then reflectance, where it is known.
        motion : PlanarMotion
            Motion of the vehicle since the last step, metres and radians. At the first step any motion will do, because
            nothing has been seen yet.
        dt : float
            Time since the last step, seconds; at the first step the time between two scans will do.

        Returns
        -------
        Belief
            What is believed of the cells of `spec`, in the grid frame of the vehicle now.

        Raises
        ------
        ArgumentError
            When the points aren't a table of finite coordinates, the time is negative or not finite, the sensor doesn't
            turn the scan into evidence, or the resampling doesn't return indices. The tracker then stays as it was.
        """
        shift, pose = scroll(self._pose.then(motion), self.map_spec.cell, MAX_YAW)
        scan = observe, self.params.sensor, points_grid, pose, self.map_spec, self.spec  # called on another core below
        steps: dict[str, NDArray[np.float32]] = {}
        with undo_after_errors(self._rng), on_another_core(*scan) as seen:
            # One name for what is between two steps: its memory, as large as what the filter keeps, is then used again.
            state = self._noted(steps, "move", move(self._state, self.map_spec, shift), pose)
            state = predict(state, self.map_spec, self.params, dt, self._rng, motion.dx)
            state = self._noted(steps, "predict", state, pose)
            predicted = state.probability
            state = self._noted(steps, "update", update(state, self.map_spec, seen.result().on_map, self.params), pose)
            state = self._noted(steps, "resample", resample(state, self.map_spec, self.params, self._rng), pose)
        self._state, self._pose = state, pose
        cells = cells_of(state.particles.position, self.map_spec)
        velocity = velocity_moments(state.particles, cells, self.map_spec.shape)
        belief = local_belief(predicted, velocity, seen.result(), self.map_spec, self.spec, self.params)
        return replace(belief, steps=steps)

    def _noted(self, steps: dict[str, NDArray], name: str, state: FilterState, pose: PlanarMotion) -> FilterState:
        """Return the state; when steps are kept, note what it holds at the centres of the vehicle's own cells."""
        if self.keep_steps:
            steps[name] = look_up(state.probability, NOTHING_KNOWN, self.map_spec, self.spec, pose)
        return state


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
        Whether each belief also holds what the filter's map held after each step (`Belief.steps`).

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
        yield tracker.step(frame.points_grid, *motion_since(before, frame))
        before = frame


def motion_since(before: Frame | None, now: Frame) -> tuple[PlanarMotion, float]:
    """Return the motion of the vehicle from one frame to another, and the time between them, seconds.

    Parameters
    ----------
    before : Frame or None
        The earlier frame; None when `now` is the first: then nothing moves, and the time is `LIDAR_PERIOD`.
    now : Frame
        The later frame.
    """
    if before is None:
        return PlanarMotion(), LIDAR_PERIOD
    return PlanarMotion.from_poses(before.T_world_from_lidar, now.T_world_from_lidar), now.time - before.time
