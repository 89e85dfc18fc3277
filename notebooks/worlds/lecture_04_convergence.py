"""How CMCDOT converges to the BOF with more particles, on two cars that pass each other (paper, section 3.2)."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu import occupancy
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import State
from semgrid_edu.occupancy.cmcdot import velocity_moments
from semgrid_edu.occupancy.sensor import likelihoods
from semgrid_edu.occupancy.state import cells_of
from worlds.lecture_02_boxes import Box, cells_in
from worlds.lecture_04_cmcdot import NO_BIRTHS

SPEC = GridSpec(0, 16, -4, 4, 0.5)
DT = 0.125
"""Duration of a step, seconds. At 4 m/s a step covers exactly one cell, so particles whose velocities lie on the BOF's
lattice move as its probability does."""
STEPS = 6
"""Number of steps."""
_RATES = ((0.0, 0.02, 0.0, 0.3), (0.02, 0.0, 0.0, 0.1), (0.1, 0.1, 0.0, 0.5), (0.0, 0.0, 0.0, 0.0))
_WORLD = occupancy.WorldModel(_RATES, first_sight=(0.85, 0.15, 0.0), max_acceleration=0.0)
PARAMS = occupancy.BofParams(occupancy.VelocityLattice(max_speed=8.0, spacing=4.0), _WORLD)
"""The default world, except that nothing accelerates or is born: such velocities wouldn't lie on the lattice."""
WORTH_COMPARING = 0.1
"""Cells are compared where the BOF's dynamic probability is above this; elsewhere a mean velocity says little."""


class Convergence(NamedTuple):
    """How far CMCDOT is from the BOF, for K numbers of particles.

    Parameters
    ----------
    numbers : (K,) int64
        Numbers of particles.
    dynamic : (K,) float64
        Root mean square difference of the dynamic probability.
    velocity : (K,) float64
        Root mean square length of the difference of mean velocities, m/s.
    """

    numbers: NDArray[np.int64]
    dynamic: NDArray[np.float64]
    velocity: NDArray[np.float64]

    @property
    def slopes(self) -> tuple[float, float]:
        """Slopes of both errors over N, fitted in log-log axes: -1/2 where an error falls like N^-1/2."""
        return tuple(float(np.polyfit(np.log(self.numbers), np.log(e), 1)[0]) for e in (self.dynamic, self.velocity))


def measure_convergence(numbers: Sequence[int], seeds: Sequence[int]) -> Convergence:
    """Compare CMCDOT with the exact filter for several numbers of particles.

    Two cars pass each other with unknown initial velocities. Particles start anywhere in their
    cells, with velocities drawn from the lattice's prior, so the BOF is the limit of `predict`, `update` and
    `resample`. By the central limit theorem the error of a mean over N particles falls like N^-1/2.

    Parameters
    ----------
    numbers : sequence of int
        Numbers of particles.
    seeds : sequence of int
        Seeds for the particles; errors are averaged over all of them.

    Returns
    -------
    Convergence
        Errors over all cells worth comparing, all steps and all seeds.

    Examples
    --------
    >>> few, many = measure_convergence([1000, 100_000], seeds=[0]).dynamic
    >>> bool(many < 0.2 * few)
    True
    """
    exact = list(run_bof())
    errors = np.zeros((len(numbers), 2))
    for k, number in enumerate(numbers):
        pairs = [pair for seed in seeds for pair in zip(exact, run_cmcdot(number, seed), strict=True)]
        errors[k] = np.sqrt(np.mean([_squared_errors(*pair) for pair in pairs], axis=0))
    return Convergence(np.array(numbers), *errors.T)


def passing_cars(step: int) -> list[Box]:
    """Return the positions of two cars: one drives ahead at 8 m/s, the other comes towards us at 8 m/s.

    Parameters
    ----------
    step : int
        Number of steps of `DT` since the start.

    Returns
    -------
    list of Box
        In the frame of the grid.
    """
    travelled = 8 * DT * step
    return [Box.around(3 + travelled, -1, 2, 1, 1.5), Box.around(13 - travelled, 1, 2, 1, 1.5)]


def evidence_of_boxes(boxes: list[Box]) -> occupancy.Evidence:
    """Return the evidence of a scan that hits each cell of the boxes once, and passes through every other cell.

    Parameters
    ----------
    boxes : list of Box
        The objects in the grid.

    Returns
    -------
    Evidence
        P(z | occupied) and P(z | free) over `SPEC`.
    """
    hit = np.any([cells_in(box, SPEC) for box in boxes], axis=0)
    return likelihoods(hit.astype(int), ~hit, occupancy.SensorModel())


def first_belief() -> NDArray[np.float64]:
    """Return the initial belief: cells with the cars are probably DYNAMIC, all others probably FREE.

    Returns
    -------
    (4, H, W) float64
        FREE, STATIC, DYNAMIC, UNKNOWN over `SPEC`.
    """
    hit = np.any([cells_in(box, SPEC) for box in passing_cars(0)], axis=0)
    return np.where(hit, np.array([0.1, 0.2, 0.6, 0.1])[:, None, None], np.array([0.8, 0.1, 0, 0.1])[:, None, None])


def run_bof() -> Iterator[tuple[NDArray, NDArray]]:
    """Run the BOF past the two cars.

    Yields
    ------
    dynamic : (H, W) float32
        P(DYNAMIC) after each step.
    velocity : (2, H, W) float32
        Mean velocity, m/s; NaN where nothing moves.
    """
    belief, lattice = first_belief().astype(np.float32), PARAMS.lattice
    occupied = belief[State.DYNAMIC] * lattice.prior[:, None, None].astype(np.float32)
    occupied[0] = belief[State.STATIC]
    remainder = np.zeros((len(lattice), 2))
    state = occupancy.BofState(belief[State.FREE], belief[State.UNKNOWN], occupied, lattice.velocities, remainder)
    for step in range(1, STEPS + 1):
        predicted = occupancy.bof_predict(state, SPEC, PARAMS, DT)
        state = occupancy.bof_update(predicted, SPEC, evidence_of_boxes(passing_cars(step)), PARAMS)
        yield state.probability[State.DYNAMIC], occupancy.bof_velocity(state)[0]


def run_cmcdot(number: int, seed: int) -> Iterator[tuple[NDArray, NDArray]]:
    """Run CMCDOT past the two cars.

    Parameters
    ----------
    number : int
        Number of particles.
    seed : int
        Seed for all random numbers.

    Yields
    ------
    dynamic : (H, W) float
        Dynamic probability after each step.
    velocity : (2, H, W) float
        Mean velocity, m/s; NaN without dynamic mass.
    """
    rng, spending = np.random.default_rng(seed), occupancy.CmcdotParams(n_particles=number, birth_share=NO_BIRTHS)
    state = _first_particles(number, rng)
    for step in range(1, STEPS + 1):
        predicted = occupancy.predict(state, SPEC, PARAMS.world, DT, rng)
        updated = occupancy.update(predicted, SPEC, evidence_of_boxes(passing_cars(step)), PARAMS.world)
        state = occupancy.resample(updated, SPEC, spending, rng)
        cells = cells_of(state.particles.position, SPEC)
        yield state.probability[State.DYNAMIC], velocity_moments(state.particles, cells, SPEC.shape)[0]


def _first_particles(number: int, rng: np.random.Generator) -> occupancy.FilterState:
    """Spread particles over the cells where something moves, with velocities from the lattice's prior."""
    belief = first_belief().astype(np.float32)
    dynamic = belief[State.DYNAMIC].ravel()
    cells = np.resize(np.flatnonzero(dynamic), number)
    corner = np.stack(np.divmod(cells, SPEC.shape[1]), axis=1) + rng.random((number, 2))
    velocity = PARAMS.lattice.velocities[rng.choice(len(PARAMS.lattice), number, p=PARAMS.lattice.prior)]
    weight = dynamic[cells] / np.bincount(cells, minlength=dynamic.size)[cells]
    position = (SPEC.x_max, SPEC.y_max) - corner * SPEC.cell
    particles = occupancy.Particles(*(a.astype(np.float32) for a in (position, velocity, weight)))
    return occupancy.FilterState(belief, particles, np.zeros(SPEC.shape, np.float32))


def _squared_errors(exact: tuple[NDArray, NDArray], sampled: tuple[NDArray, NDArray]) -> tuple[float, float]:
    """Return the mean squared errors of dynamic probability and mean velocity."""
    worth = exact[0] > WORTH_COMPARING
    dynamic = np.square(sampled[0] - exact[0])[worth]
    velocity = np.square(sampled[1] - exact[1]).sum(axis=0)[worth]
    return dynamic.mean(), np.nanmean(velocity)
