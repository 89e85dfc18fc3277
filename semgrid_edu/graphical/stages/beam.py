"""A beam over several cells: the forward model that an occupancy grid cuts into single cells (lecture 02).

A beam is reflected by the first cell that reflects, so a range tells of all cells up to there at once. Thrun, "Learning
occupancy grid maps with forward sensor models", Autonomous Robots 15, 2003.
"""

from dataclasses import dataclass
from itertools import product as every_combination

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.layout import in_rows
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.stages.stage_graph import CutEdge, StageGraph

BINS_PER_CELL = 10
"""Ranges are read to a tenth of a cell: 2 cm where cells have 0.2 m."""

MARGIN = 6
"""Ranges may be so many standard deviations before the first and behind the last cell: no probability is cut off."""

CUT = (
    CutEdge(
        "m4 - m5, once z is known",
        "The grid keeps one number per cell, so it forgets that one of the two explains the return already, and "
        "noisy returns raise the cell behind a wall again and again: after four to 0.57 instead of 0.34.",
    ),
)
"""The edge that an occupancy grid cuts: explaining away."""


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
        So many neighbouring cells stand side by side in the beam, at one range; divides K.
    prior : float
        P(occupied) of each cell.
    hit, clutter : float
        P(an occupied cell reflects the beam that reaches it), and a free one.

    Raises
    ------
    ArgumentError
        When a parameter can't be one.
    """

    n_cells: int = 8
    noise: float = 1.0
    width: int = 1
    prior: float = 0.2
    hit: float = 0.9
    clutter: float = 0.01

    def __post_init__(self) -> None:
        """Refuse what is no beam."""
        if not 1 <= self.n_cells <= 12:
            raise ArgumentError("n_cells", "from 1 to 12", self.n_cells)
        if not 1 <= self.width <= self.n_cells or self.n_cells % self.width:
            raise ArgumentError("width", f"a divisor of the number of cells, {self.n_cells}", self.width)
        if not (np.isfinite(self.noise) and (self.noise == 0 or self.noise * BINS_PER_CELL >= 1)):
            raise ArgumentError("noise", f"0, or at least {1 / BINS_PER_CELL} cells", self.noise)
        for name in ("prior", "hit", "clutter"):
            if not 0 <= getattr(self, name) <= 1:
                raise ArgumentError(name, "a probability", getattr(self, name))

    @property
    def cells(self) -> tuple[str, ...]:
        """The variables of the cells: m1 ... mK."""
        return tuple(f"m{k}" for k in range(1, self.n_cells + 1))

    @property
    def n_ranges(self) -> int:
        """How many ranges can reflect: K / width."""
        return self.n_cells // self.width

    @property
    def maps(self) -> NDArray[np.int64]:
        """Every map, (2^K, K): 1 is occupied; in the order of a table over `cells`."""
        return np.array(list(every_combination((0, 1), repeat=self.n_cells)))


def beam_over_cells(world: BeamWorld | None = None, beams: int = 1) -> StageGraph:
    """Build the graph of beams along the same cells: every cell points to r, the place that reflects; r to the range z.

    Parameters
    ----------
    world : BeamWorld, optional
        Eight cells and a noise of one cell when left out.
    beams : int
        How many, each with its own r and z.

    Returns
    -------
    StageGraph
        Variables m1 ... mK (0 free, 1 occupied); r1, r2, ...: the range that reflects, from 0, its last state is
        "none"; z1, z2, ...: see `range_state`.

    Raises
    ------
    ArgumentError
        When there is no beam.
    """
    if beams < 1:
        raise ArgumentError("beams", "at least 1", beams)
    world = world or BeamWorld()
    names = [(f"r{b}", f"z{b}") for b in range(1, beams + 1)]
    factors = [Factor(cell, [1 - world.prior, world.prior]) for cell in world.cells]
    for r, z in names:
        factors += [reflection(world, r), Factor((r, z), measurement(world))]
    parents = dict.fromkeys((r for r, _ in names), world.cells) | {z: (r,) for r, z in names}
    reflected, measured = zip(*names, strict=True)
    return StageGraph(
        f"{'A beam' if beams == 1 else f'{beams} beams'} over {world.n_cells} cells",
        GraphicalModel(factors, parents),
        observed=measured,
        positions=in_rows(world.cells, (), reflected, measured),
        equations={reflected[-1]: "which cell reflects", measured[-1]: "range"},
        plates={"beams": (*reflected, *measured)} if beams == 1 else {},
        cut=CUT,
    )


def reflection(world: BeamWorld, name: str = "r") -> Factor:
    """Return P(r | m1 ... mK): the beam passes every range until one reflects it.

    Parameters
    ----------
    world : BeamWorld
    name : str
        What r is called.

    Returns
    -------
    Factor
        Over the cells and r. The last state of r is "none": the beam passes all.
    """
    passes = np.where(world.maps == 1, 1 - world.hit, 1 - world.clutter)
    passes = passes.reshape(-1, world.n_ranges, world.width).prod(axis=2)
    reaches = np.cumprod(np.column_stack([np.ones(len(passes)), passes]), axis=1)
    table = np.column_stack([reaches[:, :-1] * (1 - passes), reaches[:, -1]])
    return Factor((*world.cells, name), table.reshape(*[2] * world.n_cells, -1))


def range_bins(world: BeamWorld) -> NDArray[np.float64]:
    """Return the ranges that can be read, in cells: 0 is the middle of the nearest cell, 1 that of the next.

    Parameters
    ----------
    world : BeamWorld

    Returns
    -------
    (B,) float64
        Tenths of a cell; whole cells when the range is exact.
    """
    if world.noise == 0:
        return np.arange(world.n_ranges, dtype=float)
    margin = int(np.ceil(MARGIN * world.noise))
    first, last = -margin * BINS_PER_CELL, (world.n_ranges - 1 + margin) * BINS_PER_CELL
    return np.arange(first, last + 1) / BINS_PER_CELL


def measurement(world: BeamWorld) -> NDArray[np.float64]:
    """Return P(z | r): normal around the range that reflects.

    Parameters
    ----------
    world : BeamWorld

    Returns
    -------
    (R + 1, B + 1) float64
        The last row and column are "none": without a reflection there is no range.
    """
    bins, places = range_bins(world), np.arange(world.n_ranges)[:, None]
    density = np.exp(-0.5 * ((bins - places) / world.noise) ** 2) if world.noise else (bins == places).astype(float)
    table = np.zeros((world.n_ranges + 1, len(bins) + 1))
    table[:-1, :-1] = density / density.sum(axis=1, keepdims=True)
    table[-1, -1] = 1
    return table


def range_state(world: BeamWorld, z: float | None) -> int:
    """Return the state of z for a range.

    Parameters
    ----------
    world : BeamWorld
    z : float or None
        In cells, 0 for the middle of the nearest; None when nothing came back.

    Returns
    -------
    int
        The nearest of `range_bins`.

    Raises
    ------
    ArgumentError
        When no reflection can give that range.
    """
    bins = range_bins(world)
    if z is None:
        return len(bins)
    state = int(np.argmin(abs(bins - z)))
    if not abs(bins[state] - z) <= 0.5:
        raise ArgumentError("z", f"a range from {bins[0]:g} to {bins[-1]:g} cells", z)
    return state


def beam_likelihood(world: BeamWorld, z: float | None) -> Factor:
    """Return P(z | m1 ... mK) of one range as a table over all maps: r is summed out.

    Parameters
    ----------
    world : BeamWorld
    z : float or None
        In cells; None when nothing came back.

    Returns
    -------
    Factor
        Over `world.cells`.
    """
    return (reflection(world) * Factor("r", measurement(world)[:, range_state(world, z)])).sum("r")
