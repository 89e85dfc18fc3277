"""The cost of sampling in CMCDOT: its beliefs over a row of cells, compared with exact ones and BOF's.

Given where the moving things are, each cell changes independently of the others, so only motion has to be sampled. That
is the "conditional Monte Carlo" in the filter's name. The sampling error falls like N^-1/2 with the number N of
particles. What remains is BOF's own error.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.occupancy import CmcdotParams, FilterState, Particles, State, WorldModel, predict, resample, update
from semgrid_edu.occupancy.state import cells_of, weight_in_cells
from worlds.lecture_03_bof import bof_beliefs
from worlds.lecture_03_row import CELL, DT, SPEED, Cell, CellsInARow, exact_beliefs

FORGETTING = tuple(
    tuple(0.0 if state == State.DYNAMIC else rate for state, rate in zip(State, row, strict=True))
    for row in WorldModel().rates
)
"""The filter's default rates, except that nothing is born moving."""

NO_BIRTHS = 1e-9
"""Share of the particles that is kept for births: practically none, because nothing is born in these worlds."""

LEFT_OR_RIGHT = CellsInARow(
    ({}, {"left": 0.5, "right": 0.5}, {"unknown": 0.5}, {"unknown": 1.0}), ("..x.", "...x"), FORGETTING
)
"""One thing that moves left or right, beside uncertain cells; the scans see it go right.

The velocity is uncertain, so particles have something to sample. BOF isn't exact, because it assumes that cells 1 and 3
are independent, although the same thing may be in either."""


class SamplingError(NamedTuple):
    """How far CMCDOT is from joint inference and from BOF.

    Every error is a root mean square over steps, cells, states and seeds.

    Parameters
    ----------
    numbers : (n,) int64
        Numbers of particles, N.
    to_exact, to_bof : (n,) float64
        Error of CMCDOT's probabilities against the exact ones, and against BOF's.
    bias : float
        Error of BOF's probabilities against the exact ones.
    """

    numbers: NDArray[np.int64]
    to_exact: NDArray[np.float64]
    to_bof: NDArray[np.float64]
    bias: float

    @property
    def slope(self) -> float:
        """The exponent of N in the error to BOF, fitted in log-log axes; about -1/2 by the central limit theorem."""
        return float(np.polyfit(np.log(self.numbers), np.log(self.to_bof), 1)[0])


def sampling_error(world: CellsInARow, numbers: Sequence[int], seeds: Sequence[int]) -> SamplingError:
    """Compare CMCDOT with joint inference and with BOF for several numbers of particles.

    Where BOF is exact, both errors are the same and fall like N^-1/2. Elsewhere only the error to BOF does, and the
    error to the exact answer tends to BOF's bias: the two add like independent errors, to_exact^2 = bias^2 + to_bof^2,
    within five per cent in `LEFT_OR_RIGHT`. In `world` some velocity must be uncertain, because particles with one
    velocity per cell carry BOF's probabilities exactly.

    Examples
    --------
    >>> error = sampling_error(LEFT_OR_RIGHT, [100, 1600], seeds=range(10))
    >>> bool(error.to_bof[1] < 0.5 * error.to_bof[0]), bool(error.to_exact[1] > 0.9 * error.bias)
    (True, True)
    """
    exact = exact_beliefs(world)
    bof = bof_beliefs(world)
    sampled = np.array([[particle_beliefs(world, number, seed) for seed in seeds] for number in numbers])
    to_exact = np.sqrt(np.square(sampled - exact).mean(axis=(1, 2, 3, 4)))
    to_bof = np.sqrt(np.square(sampled - bof).mean(axis=(1, 2, 3, 4)))
    return SamplingError(np.array(numbers), to_exact, to_bof, float(np.sqrt(np.square(bof - exact).mean())))


def particle_beliefs(world: CellsInARow, number: int, seed: int) -> NDArray[np.float64]:
    """Run the package's `predict`, `update` and `resample` along a row: each cell's distribution, (T, K, 5).

    At first the particles are divided evenly among the cells in which something may move. Each is anywhere in its cell,
    and goes left or right with the probabilities that the cell believes.
    """
    rng = np.random.default_rng(seed)
    spending = CmcdotParams(n_particles=number, birth_share=NO_BIRTHS)
    state = _first_state(world, number, rng)
    beliefs = []
    for step in range(1, len(world.scans) + 1):
        predicted = predict(state, world.spec, world.params.world, DT, rng)
        updated = update(predicted, world.spec, world.evidence(step), world.params.world)
        state = resample(updated, world.spec, spending, rng)
        beliefs.append(_by_cell(state, world))
    return np.array(beliefs)


def _first_state(world: CellsInARow, number: int, rng: np.random.Generator) -> FilterState:
    belief = world.belief
    dynamic = belief[:, [Cell.LEFT, Cell.RIGHT]].sum(axis=1)
    where = np.resize(np.flatnonzero(dynamic), number)
    goes_left = rng.random(number) * dynamic[where] < belief[where, Cell.LEFT]
    y = world.spec.y_max - (where + rng.random(number)) * CELL
    position = np.stack([np.full(number, CELL / 2), y], axis=1)
    velocity = np.stack([np.zeros(number), np.where(goes_left, SPEED, -SPEED)], axis=1)
    weight = dynamic[where] / np.bincount(where)[where]
    particles = Particles(*(values.astype(np.float32) for values in (position, velocity, weight)))
    planes = np.stack([belief[:, Cell.FREE], belief[:, Cell.STATIC], dynamic, belief[:, Cell.UNKNOWN]])
    return FilterState(planes[:, None].astype(np.float32), particles, np.zeros(world.spec.shape, np.float32))


def _by_cell(state: FilterState, world: CellsInARow) -> NDArray[np.float64]:
    """Return (K, 5): the states of each cell, DYNAMIC split into LEFT and RIGHT by the velocities of its particles."""
    cells = cells_of(state.particles.position, world.spec)
    goes_left = state.particles.velocity[:, 1] > 0
    left = weight_in_cells(state.particles.weight * goes_left, cells, world.spec.shape)
    right = weight_in_cells(state.particles.weight * ~goes_left, cells, world.spec.shape)
    free, static, _, unknown = state.probability
    return np.concatenate([free, static, left, right, unknown]).T.astype(np.float64)
