"""CMCDOT, the Conditional Monte Carlo Dense Occupancy Tracker (paper, section 3.2; Rummelhard et al., ITSC 2015)."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_seconds
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion, look_up, map_around, scroll, turn_moments
from semgrid_edu.occupancy.sensor import Evidence, evidence_of, take_scan
from semgrid_edu.occupancy.state import OUTSIDE, Belief, FilterState, Particles, State, cells_of, transform
from semgrid_edu.occupancy.steps import NOTHING_KNOWN, bayes, initialise_unknown, move, predict, resample, update
from semgrid_edu.occupancy.world import CmcdotParams, WorldModel


class Cmcdot:
    """The filter: give it scan after scan, and it tells free, static, dynamic and unknown cells apart.

    Inside, it keeps a map that stays aligned with the world: it scrolls under the vehicle by whole cells (`scroll`) and
    never turns. It has the cells that the turned grid needs (`map_around`). For the belief that the filter hands out,
    it looks up in the vehicle's own cells what the map predicts, and updates those cells with the scan
    (`local_belief`). Nothing of that goes back to the map.

    Parameters
    ----------
    spec : GridSpec
        The grid in which the filter hands out its beliefs, (H, W) cells.
    params : CmcdotParams, optional
        What the filter assumes about the world and its sensor, and how it spends its particles.
    seed : int or numpy.random.Generator
        Seed or source of all random numbers that the filter draws: the same seed gives the same bits.
    keep_steps : bool
        Whether each belief also contains the state of the map after each step (`Belief.steps`).

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
        self.map_spec = map_around(spec, yaw=0)
        self._rng = np.random.default_rng(seed)
        self._pose = PlanarMotion()
        self._state = FilterState.unknown(self.map_spec)

    @property
    def particles(self) -> Particles:
        """The particles in the grid frame of the vehicle. Some are outside the grid, in the margin of the map."""
        return transform(self._state.particles, self._pose)

    def step(self, points_grid: NDArray, motion: PlanarMotion, dt: float) -> Belief:
        """Process one scan: move, predict, update, resample.

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
            The belief about the cells of `spec`, in the grid frame of the vehicle now.

        Raises
        ------
        ArgumentError
            When the points aren't a table of finite coordinates, the time is negative or not finite, the sensor doesn't
            turn the scan into evidence, or the resampling doesn't return indices. The state then stays as it was;
            random numbers may have been drawn.
        """
        check_seconds(dt)
        shift, pose = scroll(self._pose.then(motion), self.spec.cell)
        map_spec = map_around(self.spec, pose.dyaw)
        scan = take_scan(self.params.sensor, points_grid)
        on_map = evidence_of(scan, map_spec, pose)
        in_grid = evidence_of(scan, self.spec, PlanarMotion())
        driven = self._pose.rotation @ (motion.dx, motion.dy)

        # The four steps of section 3.2, on the map.
        moved = move(self._state, self.map_spec, shift, map_spec)
        predicted = predict(moved, map_spec, self.params, dt, self._rng, driven)
        updated = update(predicted, map_spec, on_map, self.params)
        resampled = resample(updated, map_spec, self.params, self._rng)
        self._state = resampled
        self._pose = pose
        self.map_spec = map_spec

        # What the filter hands out: the prediction and the scan in the vehicle's own cells, and velocities.
        cells = cells_of(resampled.particles.position, map_spec)
        velocity = velocity_moments(resampled.particles, cells, map_spec.shape)
        belief = local_belief(predicted.probability, velocity, in_grid, pose, map_spec, self.spec, self.params)
        if self.keep_steps:
            states = {"move": moved, "predict": predicted, "update": updated, "resample": resampled}
            belief = replace(belief, steps={name: self._around_vehicle(state) for name, state in states.items()})
        return belief

    def _around_vehicle(self, state: FilterState) -> NDArray[np.float32]:
        """Return the probabilities of a state of the map at the centres of the vehicle's own cells."""
        probability = state.probability.astype(np.float32)
        return look_up(probability, NOTHING_KNOWN, self.map_spec, self.spec, self._pose)


def local_belief(
    predicted: NDArray,
    velocity: tuple[NDArray, NDArray],
    in_grid: Evidence,
    pose: PlanarMotion,
    map_spec: GridSpec,
    spec: GridSpec,
    world: WorldModel,
) -> Belief:
    """Look the map up in the vehicle's cells, and update those with the scan; nothing of this goes back to the map.

    The vehicle's cells don't coincide with the map's. Because they are updated with evidence on their own grid, each
    return counts for the very cell that it hit, however the vehicle is turned in the map. Cells about which the scan
    tells nothing keep the prediction, also where `update` has just cleared a wake on the map.

    Parameters
    ----------
    predicted : (4, H, W) float
        The belief on the map before the scan.
    velocity : (2, H, W) and (2, 2, H, W) float
        Mean and covariance of the velocity on the map, given the scan, along the axes of the map, m/s and m^2/s^2;
        NaN where nothing moves.
    in_grid : Evidence
        What the scan tells about the vehicle's cells, (H', W').
    pose : PlanarMotion
        Pose of the vehicle in the frame of the map, metres and radians.
    map_spec, spec : GridSpec
        The cells of the map, (H, W), and those of the vehicle, (H', W').
    world : WorldModel
        What UNKNOWN cells turn out to be, `first_sight`.
    """
    # The prediction comes from the map; the scan is counted in the vehicle's own cells.
    here = look_up(predicted, NOTHING_KNOWN, map_spec, spec, pose)
    prior, _ = initialise_unknown(here, in_grid.seen, world)
    probability = bayes(prior, in_grid)[0].astype(np.float32)
    mean, covariance = velocity
    moments = np.concatenate([mean, covariance.reshape(4, *map_spec.shape)]).astype(np.float32)
    moments = look_up(moments, np.full(6, np.nan, np.float32), map_spec, spec, pose)
    moments[:, probability[State.DYNAMIC] == 0] = np.nan
    return Belief(probability, *turn_moments(moments[:2], moments[2:].reshape(2, 2, *spec.shape), pose))


def velocity_moments(
    particles: Particles, cells: NDArray, shape: tuple[int, int]
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return mean and covariance of the velocities in each cell, weighted by the weights of the particles.

    Parameters
    ----------
    particles : Particles
        N particles on the map.
    cells : (N,) int
        The cell of each particle, from `cells_of`.
    shape : (int, int)
        H, W of the map.

    Returns
    -------
    mean : (2, H, W) float64
        sum(w v) / sum(w), along the axes of the map, m/s; NaN in cells without particles.
    covariance : (2, 2, H, W) float64
        sum(w (v - mean) (v - mean)^T) / sum(w), m^2/s^2; zero for a single particle, NaN in cells without particles.
    """
    n_cells = shape[0] * shape[1]
    inside = cells != OUTSIDE
    cell = cells[inside]
    weight = particles.weight[inside].astype(np.float64)
    velocity = particles.velocity[inside].astype(np.float64)

    total = np.bincount(cell, weight, n_cells)

    def average(values: NDArray) -> NDArray[np.float64]:
        return np.bincount(cell, weight * values, n_cells) / total

    with np.errstate(invalid="ignore"):  # 0 / 0 is NaN, as it should be in cells without particles
        mean = np.stack([average(velocity[:, 0]), average(velocity[:, 1])])
        dx, dy = velocity.T - mean[:, cell]
        covariance = np.stack([average(dx * dx), average(dx * dy), average(dx * dy), average(dy * dy)])
    return mean.reshape(2, *shape), covariance.reshape(2, 2, *shape)


class DriveTracker:
    """A filter that takes frames: it finds the motion and the time since the previous frame by itself.

    Parameters
    ----------
    spec : GridSpec
        The grid in which the filter hands out its beliefs, (H, W) cells.
    params : CmcdotParams, optional
        What the filter assumes about the world and its sensor, and how it spends its particles.
    seed : int or numpy.random.Generator
        Seed or source of all random numbers that the filter draws.
    keep_steps : bool
        Whether each belief also contains the state of the filter's map after each step (`Belief.steps`).
    """

    filter_class = Cmcdot
    """The filter to run; the fast twin of this class runs the compiled one."""

    def __init__(
        self,
        spec: GridSpec,
        params: CmcdotParams | None = None,
        seed: int | np.random.Generator = 0,
        keep_steps: bool = False,
    ) -> None:
        self.filter = self.filter_class(spec, params, seed, keep_steps)
        self._before: Frame | None = None

    def step(self, frame: Frame) -> Belief:
        """Process the next frame of a drive.

        Parameters
        ----------
        frame : Frame
            The frame; its scan, pose and time are used.

        Returns
        -------
        Belief
            The belief after this frame, in the grid frame of that instant.

        Raises
        ------
        ArgumentError
            When time runs backwards, or a scan or pose isn't finite.
        """
        motion, dt = motion_since(self._before, frame)
        belief = self.filter.step(frame.points_grid, motion, dt)
        self._before = frame
        return belief


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
    spec, params, seed, keep_steps
        Parameters of the filter, as for `DriveTracker`.

    Yields
    ------
    Belief
        The belief after each frame, in the grid frame of that instant.

    Raises
    ------
    ArgumentError
        When frames run backwards in time, or a scan or pose isn't finite.
    """
    tracker = DriveTracker(spec, params, seed, keep_steps)
    for frame in frames:
        yield tracker.step(frame)


LIDAR_PERIOD = 0.1
"""Seconds between two scans of a scanner that turns at 10 Hz, as KITTI's does: the time step of the first frame."""


def motion_since(before: Frame | None, now: Frame) -> tuple[PlanarMotion, float]:
    """Return the motion of the vehicle from one frame to another, and the time between them, seconds.

    Parameters
    ----------
    before : Frame or None
        The earlier frame; None when `now` is the first: then nothing moves, and the time is `LIDAR_PERIOD`.
    now : Frame
        The later frame.

    Raises
    ------
    ArgumentError
        When time runs backwards.
    """
    if before is None:
        return PlanarMotion(), LIDAR_PERIOD
    dt = now.time - before.time
    if dt < 0:
        raise ArgumentError("frames", "frames in the order of time, and a new tracker for each drive", f"{dt:.4g} s")
    return PlanarMotion.from_poses(before.T_world_from_lidar, now.T_world_from_lidar), dt
