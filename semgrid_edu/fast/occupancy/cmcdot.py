"""CMCDOT with compiled steps; another core computes the evidence of the scan at the same time."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.fast.occupancy._runtime import keep_memory, on_another_core, undo_after_errors
from semgrid_edu.fast.occupancy.local_belief import local_belief, observe, velocity_moments
from semgrid_edu.fast.occupancy.particles import cells_of, transform
from semgrid_edu.fast.occupancy.planar_motion import look_up
from semgrid_edu.fast.occupancy.steps import move, predict, resample, update
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import cmcdot
from semgrid_edu.occupancy.planar_motion import MAX_YAW, PlanarMotion, scroll
from semgrid_edu.occupancy.state import Belief, FilterState, Particles
from semgrid_edu.occupancy.steps import NOTHING_KNOWN
from semgrid_edu.occupancy.world import CmcdotParams


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
        keep_memory()

    @property
    def particles(self) -> Particles:
        """The particles in the grid frame of the vehicle. Some are outside the grid, in the margin of the map."""
        return transform(self._state.particles, self._pose)

    def step(self, points_grid: NDArray, motion: PlanarMotion, dt: float) -> Belief:
        """Process one scan. Parameters, result and errors are those of `Cmcdot.step`."""
        shift, pose = scroll(self._pose.then(motion), self.map_spec.cell, MAX_YAW)
        scan = observe, self.params.sensor, points_grid, pose, self.map_spec, self.spec  # called on another core below
        steps: dict[str, NDArray[np.float32]] = {}
        with undo_after_errors(self._rng), on_another_core(*scan) as seen:
            # One name for all intermediate states, so that the memory of each is freed and reused.
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
        """Return the state; when steps are kept, note its probabilities at the centres of the vehicle's cells."""
        if self.keep_steps:
            steps[name] = look_up(state.probability, NOTHING_KNOWN, self.map_spec, self.spec, pose)
        return state


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
