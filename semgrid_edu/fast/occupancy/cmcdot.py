"""CMCDOT with compiled steps; another core computes the evidence of the scan at the same time."""

import math
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.fast.allocator import keep_step_memory
from semgrid_edu.fast.occupancy.cells import look_up
from semgrid_edu.fast.occupancy.cellwise import bayes
from semgrid_edu.fast.occupancy.particles import cells_of
from semgrid_edu.fast.occupancy.sensor import compiled_twin
from semgrid_edu.fast.occupancy.steps import initialise_unknown, move, predict, resample, update
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import cmcdot
from semgrid_edu.occupancy.planar_motion import PlanarMotion, map_around, scroll, turn_moments
from semgrid_edu.occupancy.sensor import Evidence, Sensor, evidence_of, take_scan
from semgrid_edu.occupancy.state import OUTSIDE, Belief, FilterState, Particles, State
from semgrid_edu.occupancy.steps import NOTHING_KNOWN
from semgrid_edu.occupancy.world import CmcdotParams, WorldModel


class Cmcdot(cmcdot.Cmcdot):
    """The book's filter with compiled steps. Parameters are those of `Cmcdot`.

    The package's sensor and resampling are replaced by their compiled twins; others are called unchanged, a sensor in a
    separate thread. After an error, the random generator is back where it was before the step.
    """

    def __init__(
        self,
        spec: GridSpec,
        params: CmcdotParams | None = None,
        seed: int | np.random.Generator = 0,
        keep_steps: bool = False,
    ) -> None:
        super().__init__(spec, params, seed, keep_steps)
        keep_step_memory()

    def step(self, points_grid: NDArray, motion: PlanarMotion, dt: float) -> Belief:
        """Process one scan. Parameters, result and errors are those of `Cmcdot.step`."""
        shift, pose = scroll(self._pose.then(motion), self.spec.cell)
        map_spec = map_around(self.spec, pose.dyaw)
        driven = self._pose.rotation @ (motion.dx, motion.dy)
        steps: dict[str, NDArray[np.float32]] = {}
        generator = self._rng.bit_generator.state
        try:
            # Evidence doesn't depend on `move` and `predict`, and takes about as long. Compiled loops release Python's
            # lock, so a thread is enough to use two cores.
            with ThreadPoolExecutor(1) as thread:
                sensor = compiled_twin(self.params.sensor)
                seen = thread.submit(observe, sensor, points_grid, pose, map_spec, self.spec)
                # One name for all intermediate states, so that the memory of each is freed and reused.
                state = self._noted(steps, "move", move(self._state, self.map_spec, shift, map_spec), map_spec, pose)
                state = predict(state, map_spec, self.params, dt, self._rng, driven)
                state = self._noted(steps, "predict", state, map_spec, pose)
                predicted = state.probability
                state = update(state, map_spec, seen.result()[0], self.params)
                state = self._noted(steps, "update", state, map_spec, pose)
                state = resample(state, map_spec, self.params, self._rng)
                state = self._noted(steps, "resample", state, map_spec, pose)
        except BaseException:
            # `predict` has drawn already when a sensor or a resampling fails. A drive that goes on should be the same.
            self._rng.bit_generator.state = generator
            raise
        self._state = state
        self._pose = pose
        self.map_spec = map_spec
        cells = cells_of(state.particles.position, map_spec)
        velocity = velocity_moments(state.particles, cells, map_spec.shape)
        belief = local_belief(predicted, velocity, seen.result()[1], pose, map_spec, self.spec, self.params)
        return replace(belief, steps=steps)

    def _noted(
        self, steps: dict[str, NDArray], name: str, state: FilterState, map_spec: GridSpec, pose: PlanarMotion
    ) -> FilterState:
        """Return the state; when steps are kept, note its probabilities at the centres of the vehicle's cells."""
        if self.keep_steps:
            steps[name] = look_up(state.probability, NOTHING_KNOWN, map_spec, self.spec, pose)
        return state


def observe(
    sensor: Sensor, points_grid: NDArray, pose: PlanarMotion, map_spec: GridSpec, spec: GridSpec
) -> tuple[Evidence, Evidence]:
    """Return what a scan tells about the cells of the map, and about those around the vehicle.

    Parameters
    ----------
    sensor : Sensor
        Turns the scan into evidence.
    points_grid : (N, 3+) float
        The scan, as for `Cmcdot.step`.
    pose : PlanarMotion
        Pose of the vehicle in the frame of the map, metres and radians.
    map_spec, spec : GridSpec
        The cells of the map, and those of the grid around the vehicle.
    """
    scan = take_scan(sensor, points_grid)
    return evidence_of(scan, map_spec, pose), evidence_of(scan, spec, PlanarMotion())


class DriveTracker(cmcdot.DriveTracker):
    """The book's tracker with the compiled filter. Parameters are those of `DriveTracker`."""

    filter_class = Cmcdot


def track_drive(
    frames: Iterable[Frame],
    spec: GridSpec,
    params: CmcdotParams | None = None,
    seed: int | np.random.Generator = 0,
    keep_steps: bool = False,
) -> Iterator[Belief]:
    """Filter the scans of a drive by the compiled filter.

    Parameters, yields and errors are those of `track_drive`.
    """
    tracker = DriveTracker(spec, params, seed, keep_steps)
    for frame in frames:
        yield tracker.step(frame)


def local_belief(
    predicted: NDArray,
    velocity: tuple[NDArray, NDArray],
    in_grid: Evidence,
    pose: PlanarMotion,
    map_spec: GridSpec,
    spec: GridSpec,
    world: WorldModel,
) -> Belief:
    """Look up the map at the vehicle's cells and update them. Parameters are those of `local_belief`."""
    here = look_up(predicted, NOTHING_KNOWN, map_spec, spec, pose)
    prior, _ = initialise_unknown(here, in_grid.seen, world)
    probability, _ = bayes(prior, in_grid.occupied, in_grid.free)
    mean, covariance = velocity
    moments = np.concatenate([mean, covariance.reshape(4, *map_spec.shape)])
    moments = look_up(moments, np.full(6, np.nan, np.float32), map_spec, spec, pose)
    moments[:, probability[State.DYNAMIC] == 0] = np.nan
    return Belief(probability, *turn_moments(moments[:2], moments[2:].reshape(2, 2, *spec.shape), pose))


def velocity_moments(
    particles: Particles, cells: NDArray, shape: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return mean and covariance of the velocities in each cell, weighted by the weights of the particles.

    Parameters and result are those of `velocity_moments`; the result is float32.
    """
    mean, covariance = _moments(particles.velocity, particles.weight, cells, math.prod(shape))
    return mean.reshape(2, *shape), covariance.reshape(2, 2, *shape)


@njit(cache=True, nogil=True, error_model="numpy")
def _moments(velocity, weight, cells, n_cells):
    """Sum in double precision, in two passes: the covariance from differences to the mean, to keep its digits."""
    first = np.zeros((n_cells, 3))
    second = np.zeros((n_cells, 3))
    for i in range(len(cells)):
        c = cells[i]
        if c != OUTSIDE:
            w = np.float64(weight[i])
            first[c, 0] += w
            first[c, 1] += w * velocity[i, 0]
            first[c, 2] += w * velocity[i, 1]
    for c in range(n_cells):
        first[c, 1] /= first[c, 0]
        first[c, 2] /= first[c, 0]
    for i in range(len(cells)):
        c = cells[i]
        if c != OUTSIDE:
            x = velocity[i, 0] - first[c, 1]
            y = velocity[i, 1] - first[c, 2]
            second[c, 0] += weight[i] * x * x
            second[c, 1] += weight[i] * x * y
            second[c, 2] += weight[i] * y * y
    mean = np.empty((2, n_cells), np.float32)
    covariance = np.empty((2, 2, n_cells), np.float32)
    for c in range(n_cells):
        mean[0, c] = first[c, 1]
        mean[1, c] = first[c, 2]
        covariance[0, 0, c] = second[c, 0] / first[c, 0]
        covariance[0, 1, c] = second[c, 1] / first[c, 0]
        covariance[1, 0, c] = covariance[0, 1, c]
        covariance[1, 1, c] = second[c, 2] / first[c, 0]
    return mean, covariance
