"""A beam over several cells: the forward model that an occupancy grid cuts into single cells (lecture 02).

A beam passes cells until one reflects it, so a single range says something about all the cells up to that one. See
Thrun, "Learning occupancy grid maps with forward sensor models", Autonomous Robots 15, 2003.
"""

from dataclasses import dataclass
from itertools import product as every_combination

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_fields
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.layout import in_rows
from semgrid_edu.stage_models.stage_graph import StageGraph, binary, cut_edges, directed

BINS_PER_CELL = 10
"""Number of ranges that can be read per cell: a range is read to a tenth of a cell, 2 cm for cells of 0.2 m."""

MARGIN = 6
"""Number of standard deviations by which a range may lie before the first or behind the last cell."""


@dataclass(frozen=True)
class BeamWorld:
    """Cells along a beam, nearest first, and how the beam is reflected and measured.

    Parameters
    ----------
    n_cells : int
        K, at most 12: a table over all maps has 2^K entries.
    noise : float
        Standard deviation of a range, in cells; 0 for an exact range.
    width : int
        Number of neighbouring cells that stand side by side in the beam, at the same range; it divides K.
    prior : float
        P(occupied) of each cell.
    hit, clutter : float
        Probability that an occupied cell, or a free one, reflects a beam that reaches it.
    """

    n_cells: int = 8
    noise: float = 1.0
    width: int = 1
    prior: float = 0.2
    hit: float = 0.9
    clutter: float = 0.01

    def __post_init__(self) -> None:
        """Refuse values that are impossible, and ranges too fine to be read."""
        check_fields(self, "from 1 to 12", lambda n: 1 <= n <= 12, "n_cells")
        if not 1 <= self.width <= self.n_cells or self.n_cells % self.width:
            raise ArgumentError("width", f"a divisor of the number of cells, {self.n_cells}", self.width)
        if not (np.isfinite(self.noise) and (self.noise == 0 or self.noise * BINS_PER_CELL >= 1)):
            raise ArgumentError("noise", f"0, or at least {1 / BINS_PER_CELL} cells", self.noise)
        check_fields(self, "a probability", lambda p: 0 <= p <= 1, "prior", "hit", "clutter")

    @property
    def cells(self) -> tuple[str, ...]:
        """The variables of the cells: m1 ... mK."""
        return tuple(f"m{k}" for k in range(1, self.n_cells + 1))

    @property
    def n_ranges(self) -> int:
        """Number of ranges at which the beam can be reflected: K / width."""
        return self.n_cells // self.width

    @property
    def maps(self) -> NDArray[np.int64]:
        """(2^K, K): every map, 1 for occupied cells, in the order of a table over `cells`."""
        return np.array(list(every_combination((0, 1), repeat=self.n_cells)))


def beam_over_cells(world: BeamWorld | None = None, beams: int = 1) -> StageGraph:
    """Build the graph of beams along the same cells: every cell -> r, where the beam is reflected -> z, the range.

    Parameters
    ----------
    world : BeamWorld, optional
        Eight cells and a noise of one cell when left out.
    beams : int
        Number of beams, each with its own r and z.

    Returns
    -------
    StageGraph
        Variables m1 ... mK (0 free, 1 occupied); r1, r2, ..., the range at which each beam is reflected, counted from
        0, whose last state is "none"; and z1, z2, ..., see `range_state`.
    """
    if beams < 1:
        raise ArgumentError("beams", "at least 1", beams)
    world = world or BeamWorld()
    names = [(f"r{b}", f"z{b}") for b in range(1, beams + 1)]
    factors = [binary(cell, world.prior) for cell in world.cells]
    for r, z in names:
        factors += [reflection(world, r), Factor((r, z), measurement(world))]
    reflected, measured = zip(*names, strict=True)
    return StageGraph(
        f"{'A beam' if beams == 1 else f'{beams} beams'} over {world.n_cells} cells",
        directed(factors),
        observed=measured,
        positions=in_rows(world.cells, (), reflected, measured),
        equations={reflected[-1]: "which cell reflects", measured[-1]: "range"},
        plates={"beams": (*reflected, *measured)} if beams == 1 else {},
        cut=cut_edges("beam"),
    )


def reflection(world: BeamWorld, name: str = "r") -> Factor:
    """Return P(r | m1 ... mK): the beam passes every range until one reflects it.

    Parameters
    ----------
    world : BeamWorld
        The cells, and how the beam is reflected and measured.
    name : str
        Name of the variable r.

    Returns
    -------
    Factor
        A table over the cells and r. The last state of r is "none": the beam passes all cells.
    """
    passes = np.where(world.maps == 1, 1 - world.hit, 1 - world.clutter)
    passes = passes.reshape(-1, world.n_ranges, world.width).prod(axis=2)
    reaches = np.cumprod(np.column_stack([np.ones(len(passes)), passes]), axis=1)
    table = np.column_stack([reaches[:, :-1] * (1 - passes), reaches[:, -1]])
    return Factor((*world.cells, name), table.reshape(*[2] * world.n_cells, -1))


def range_bins(world: BeamWorld) -> NDArray[np.float64]:
    """Return the ranges that can be read, in cells: 0 is the middle of the nearest cell, 1 that of the next.

    Parameters are those of `reflection`.

    Returns
    -------
    (B,) float64
        The ranges in ascending order: every tenth of a cell, or whole cells when the range is exact.
    """
    if world.noise == 0:
        return np.arange(world.n_ranges, dtype=float)
    margin = int(np.ceil(MARGIN * world.noise))
    first, last = -margin * BINS_PER_CELL, (world.n_ranges - 1 + margin) * BINS_PER_CELL
    return np.arange(first, last + 1) / BINS_PER_CELL


def measurement(world: BeamWorld) -> NDArray[np.float64]:
    """Return P(z | r): normal around the range at which the beam is reflected.

    Parameters are those of `reflection`.

    Returns
    -------
    (R + 1, B + 1) float64
        One row per state of r, one column per state of z. The last row and column are "none": without a reflection
        there is no range.
    """
    bins, places = range_bins(world), np.arange(world.n_ranges)[:, None]
    density = np.exp(-0.5 * ((bins - places) / world.noise) ** 2) if world.noise else (bins == places).astype(float)
    table = np.zeros((world.n_ranges + 1, len(bins) + 1))
    table[:-1, :-1] = density / density.sum(axis=1, keepdims=True)
    table[-1, -1] = 1
    return table


def range_state(world: BeamWorld, z: float | None) -> int:
    """Return the state of the variable z that stands for a range.

    Parameters
    ----------
    world : BeamWorld
        The cells, and how the beam is reflected and measured.
    z : float or None
        The range in cells, 0 for the middle of the nearest cell; None when nothing came back.

    Returns
    -------
    int
        Index of the nearest of `range_bins`, or of the state "none", which follows them.
    """
    bins = range_bins(world)
    if z is None:
        return len(bins)
    state = int(np.argmin(abs(bins - z)))
    if not abs(bins[state] - z) <= 0.5:  # NaN isn't either
        raise ArgumentError("z", f"a range from {bins[0]:g} to {bins[-1]:g} cells", z)
    return state


def beam_likelihood(world: BeamWorld, z: float | None) -> Factor:
    """Return P(z | m1 ... mK) of one range as a table over all maps: r is summed out.

    Parameters are those of `range_state`.
    """
    return (reflection(world) * Factor("r", measurement(world)[:, range_state(world, z)])).sum("r")
