"""A beam over several cells, which an occupancy grid treats separately; and several rings that share a pose error.

A beam passes cells until one reflects it, so a single range is evidence about all cells up to that one: Thrun,
"Learning occupancy grid maps with forward sensor models", Autonomous Robots 15, 2003.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product as every_combination
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, in_rows, product
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, binary, directed

BINS_PER_CELL = 10
"""Ranges have a resolution of a tenth of a cell: 2 cm for cells of 0.2 m."""

MARGIN = 6
"""Standard deviations by which a range may be in front of the first cell or behind the last cell."""


@dataclass(frozen=True)
class BeamWorld:
    """Cells along a beam, nearest first, and a model of the beam's reflection and range error.

    Parameters
    ----------
    n_cells : int
        K, at most 12: a table over all maps has 2^K entries.
    noise : float
        Standard deviation of a range, in cells; 0 for an exact range, else at least 0.1.
    prior : float
        P(occupied) of each cell.
    hit, clutter : float
        Probability that an occupied cell, or a free one, reflects a beam that reaches it.
    """

    n_cells: int = 8
    noise: float = 1.0
    prior: float = 0.2
    hit: float = 0.9
    clutter: float = 0.01

    @property
    def cells(self) -> tuple[str, ...]:
        """The variables of the cells: m1 ... mK."""
        return tuple(f"m{k}" for k in range(1, self.n_cells + 1))

    @property
    def maps(self) -> NDArray[np.int64]:
        """(2^K, K): every map, 1 for occupied cells, in the order of a table over `cells`."""
        return np.array(list(every_combination((0, 1), repeat=self.n_cells)))


def beam_over_cells(world: BeamWorld | None = None, beams: int = 1) -> StageGraph:
    """Build the graph of beams along the same cells: every cell -> r, where the beam is reflected -> z, the range.

    Variables are m1 ... mK (0 free, 1 occupied); r1, r2, ..., the range at which each beam is reflected, counted from
    0, whose last state is "none"; and z1, z2, ..., see `range_state`.
    """
    world = world or BeamWorld()
    reflected = [f"r{b}" for b in range(1, beams + 1)]
    measured = [f"z{b}" for b in range(1, beams + 1)]
    factors = [binary(cell, world.prior) for cell in world.cells]
    for r, z in zip(reflected, measured, strict=True):
        factors += [reflection(world, r), Factor((r, z), measurement(world))]
    return StageGraph(
        f"{'A beam' if beams == 1 else f'{beams} beams'} over {world.n_cells} cells",
        directed(factors),
        positions=in_rows(world.cells, (), reflected, measured),
        observed=tuple(measured),
        equations={reflected[-1]: "which cell reflects", measured[-1]: "range"},
        plates={"beams": (*reflected, *measured)} if beams == 1 else {},
        cut=CUT_BEAM,
    )


def reflection(world: BeamWorld, name: str = "r") -> Factor:
    """Return P(r | m1 ... mK): the beam passes every cell until one reflects it. The last state of r is "none"."""
    passes = np.where(world.maps == 1, 1 - world.hit, 1 - world.clutter)
    reaches = np.cumprod(np.column_stack([np.ones(len(passes)), passes]), axis=1)
    table = np.column_stack([reaches[:, :-1] * (1 - passes), reaches[:, -1]])
    return Factor((*world.cells, name), table.reshape(*[2] * world.n_cells, -1))


def range_bins(world: BeamWorld) -> NDArray[np.float64]:
    """Return the possible ranges, ascending, in cells: 0 is the middle of the nearest cell, 1 of the next cell.

    There is one every tenth of a cell, or one per cell when the range is exact.
    """
    if world.noise == 0:
        return np.arange(world.n_cells, dtype=float)
    margin = int(np.ceil(MARGIN * world.noise))
    first = -margin * BINS_PER_CELL
    last = (world.n_cells - 1 + margin) * BINS_PER_CELL
    return np.arange(first, last + 1) / BINS_PER_CELL


def measurement(world: BeamWorld) -> NDArray[np.float64]:
    """Return P(z | r), normal around the range at which the beam is reflected: a row per state of r.

    The last row and column are "none": without a reflection there is no range.
    """
    bins = range_bins(world)
    ranges = np.arange(world.n_cells)[:, None]
    density = np.exp(-0.5 * ((bins - ranges) / world.noise) ** 2) if world.noise else (bins == ranges).astype(float)
    table = np.zeros((world.n_cells + 1, len(bins) + 1))
    table[:-1, :-1] = density / density.sum(axis=1, keepdims=True)
    table[-1, -1] = 1
    return table


def range_state(world: BeamWorld, z: float | None) -> int:
    """Return the state of the variable z for a range in cells, or for None if nothing came back."""
    bins = range_bins(world)
    if z is None:
        return len(bins)
    state = int(np.argmin(abs(bins - z)))
    if not abs(bins[state] - z) <= 0.5:
        raise ArgumentError("z", f"a range from {bins[0]:g} to {bins[-1]:g} cells", z)
    return state


@cache
def beam_likelihood(world: BeamWorld, z: float | None) -> Factor:
    """Return P(z | m1 ... mK) of one range as a table over all maps: r is summed out."""
    return (reflection(world) * Factor("r", measurement(world)[:, range_state(world, z)])).sum("r")


class BeamBeliefs(NamedTuple):
    """Results of exact inference and of an occupancy grid with the same sensor, after each of n ranges.

    Parameters
    ----------
    exact, cell_by_cell : (n, K) float64
        P(occupied) of each cell: the marginals of the exact posterior, and those of a grid that keeps only marginals
        after each beam.
    """

    exact: NDArray[np.float64]
    cell_by_cell: NDArray[np.float64]


def beam_beliefs(world: BeamWorld, ranges: Sequence[float | None]) -> BeamBeliefs:
    """Update with one range after the other, exactly and cell by cell.

    For the ranges 4.0, 4.6, 3.6, 4.2 of a wall in the fifth of eight cells and the defaults of `BeamWorld`, the cell
    behind the wall gets P(occupied) = 0.57 cell by cell, instead of the exact 0.34.
    """
    posterior = kept = independent(world, np.full(world.n_cells, world.prior))
    steps = []
    for z in ranges:
        likelihood = beam_likelihood(world, z)
        posterior = (posterior * likelihood).normalised()
        grid = occupied((kept * likelihood).normalised())
        kept = independent(world, grid)
        steps.append((occupied(posterior), grid))
    return BeamBeliefs(*map(np.array, zip(*steps, strict=True)))


def independent(world: BeamWorld, p: ArrayLike) -> Factor:
    """Return the distribution over maps in which cells are independent with P(occupied) = p, (K,)."""
    return product(Factor(cell, [1 - one, one]) for cell, one in zip(world.cells, np.asarray(p), strict=True))


def occupied(belief: Factor) -> NDArray[np.float64]:
    """Return the marginals P(occupied) of a distribution over maps, (K,)."""
    return np.array([belief.marginal(cell).normalised().table[1] for cell in belief.names])


@cache
def behind_the_wall() -> Price:
    """P(occupied) of the cell behind a wall after four ranges."""
    beliefs = beam_beliefs(BeamWorld(), (4.0, 4.6, 3.6, 4.2))
    return Price(beliefs.exact[-1, 5], beliefs.cell_by_cell[-1, 5], "P(occupied) of the cell behind a wall")


CUT_BEAM = (
    CutEdge(
        "m5 - m6, once z is known",
        "The grid keeps one number per cell, so it forgets that one of the two cells already explains the return, and "
        "noisy returns raise the cell behind a wall again and again: after four to 0.57 instead of 0.34.",
        ("m5", "m6"),
        behind_the_wall,
        bend=0.55,
    ),
)
"""The edges that a grid cuts."""
