"""What sampling costs CMCDOT: its beliefs over a row of cells beside exact ones and BOF's (graph: `cmcdot_graph`).

Given where the moving things are, each cell changes independently of the others, so only motion has to be sampled. That
is the "conditional Monte Carlo" in the filter's name. The sampling error falls like N^-1/2 with the number N of
particles. What remains is BOF's own error.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.occupancy import CmcdotParams, FilterState, Particles, State, WorldModel, predict, resample, update
from semgrid_edu.occupancy.particles import cells_of, weight_in_cells
from semgrid_edu.stage_models.bof import bof_beliefs
from semgrid_edu.stage_models.cells_in_a_row import CELL, DT, SPEED, Cell, CellsInARow
from semgrid_edu.stage_models.joint_row import exact_beliefs

FORGETTING = tuple(
    tuple(0.0 if state == State.DYNAMIC else rate for state, rate in zip(State, row, strict=True))
    for row in WorldModel().rates
)
"""The filter's default rates, but nothing is born moving."""

NO_BIRTHS = 1e-9
"""Share of the particles that is kept for births; as good as none, because nothing is born in these worlds."""

LEFT_OR_RIGHT = CellsInARow(
    ({}, {"left": 0.5, "right": 0.5}, {"unknown": 0.5}, {"unknown": 1.0}), ("..x.", "...x"), FORGETTING
)
"""One thing that moves to the left or to the right, beside cells of which little is known; the scans see it go right.

The velocity is in doubt, so particles have something to sample. BOF isn't exact, because it takes cells 1 and 3 as
independent, although they may hold the same thing."""


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
        """The exponent of N in the error to BOF, fitted to the logarithms; about -1/2 by the central limit theorem."""
        return float(np.polyfit(np.log(self.numbers), np.log(self.to_bof), 1)[0])


def sampling_error(world: CellsInARow, numbers: Sequence[int], seeds: Sequence[int]) -> SamplingError:
    """Compare CMCDOT with joint inference and with BOF for several numbers of particles.

    Where BOF is exact, both errors are the same and fall like N^-1/2. Elsewhere only the error to BOF does, and the
    error to the exact answer tends to BOF's bias: the two add like independent errors, to_exact^2 = bias^2 + to_bof^2,
    within five per cent in `LEFT_OR_RIGHT`.

    Parameters
    ----------
    world : CellsInARow
        The row. Some velocity must be in doubt, because particles with one velocity per cell carry BOF's probabilities
        exactly.
    numbers : sequence of int
        Numbers of particles, N.
    seeds : sequence of int
        Seeds of the runs; the errors are averaged over them.

    Examples
    --------
    >>> error = sampling_error(LEFT_OR_RIGHT, [100, 1600], seeds=range(10))
    >>> bool(error.to_bof[1] < 0.5 * error.to_bof[0]), bool(error.to_exact[1] > 0.9 * error.bias)
    (True, True)
    """
    exact, bof = exact_beliefs(world), bof_beliefs(world)
    sampled = np.array([[particle_beliefs(world, number, seed) for seed in seeds] for number in numbers])
    to_exact, to_bof = (np.sqrt(np.square(sampled - target).mean(axis=(1, 2, 3, 4))) for target in (exact, bof))
    return SamplingError(np.array(numbers), to_exact, to_bof, float(np.sqrt(np.square(bof - exact).mean())))


def particle_beliefs(world: CellsInARow, number: int, seed: int) -> NDArray[np.float64]:
    """Run the package's `predict`, `update` and `resample` along a row.

    Parameters
    ----------
    world : CellsInARow
        A row of K cells with T scans.
    number : int
        Number of particles, N. At first they are shared out evenly among the cells in which something may move. Each
        lies anywhere in its cell, and goes left or right with the probabilities that the cell believes.
    seed : int
        Seed for everything that is drawn.

    Returns
    -------
    (T, K, 5) float64
        Each cell's distribution given the scans up to each step; states in the order of `Cell`.
    """
    rng, spending = np.random.default_rng(seed), CmcdotParams(n_particles=number, birth_share=NO_BIRTHS)
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
    cells, goes_left = cells_of(state.particles.position, world.spec), state.particles.velocity[:, 1] > 0
    left, right = (
        weight_in_cells(state.particles.weight * part, cells, world.spec.shape) for part in (goes_left, ~goes_left)
    )
    free, static, _, unknown = state.probability
    return np.concatenate([free, static, left, right, unknown]).T.astype(np.float64)
