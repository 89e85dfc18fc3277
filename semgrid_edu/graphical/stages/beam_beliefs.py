"""What an occupancy grid loses of the posterior of beams: it keeps one number per cell, exact inference all maps."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.products import product
from semgrid_edu.graphical.stages.beam import BeamWorld, beam_likelihood
from semgrid_edu.metrics import total_variation


class BeamBeliefs(NamedTuple):
    """Exact inference beside an occupancy grid with the same sensor, after each of n ranges.

    Parameters
    ----------
    exact, cell_by_cell : (n, K) float64
        P(occupied) of each cell: the marginals of the exact posterior, and those of a grid that keeps only marginals
        after each beam.
    coupling : (n,) float64
        Total variation between the exact posterior over maps and the product of its own marginals.
    loss : (n,) float64
        Total variation between the exact posterior over maps and the product of the grid's marginals.
    """

    exact: NDArray[np.float64]
    cell_by_cell: NDArray[np.float64]
    coupling: NDArray[np.float64]
    loss: NDArray[np.float64]


def beam_beliefs(world: BeamWorld, ranges: Sequence[float | None]) -> BeamBeliefs:
    """Take in ranges one after the other, exactly and cell by cell.

    For the ranges 4.0, 4.6, 3.6, 4.2 of a wall in the fifth of eight cells and the defaults of `BeamWorld`, `loss` is
    0.26 after one range and 0.40 after four. The cell behind the wall gets P(occupied) = 0.57 cell by cell, instead of
    the exact 0.34. `coupling` doesn't grow: it is 0.26 after one range and 0.23 after four.

    Parameters
    ----------
    world : BeamWorld
        The cells, and how the beam is reflected and measured.
    ranges : (n,) float or None
        The ranges in cells, 0 for the middle of the nearest cell; None when nothing came back.

    Returns
    -------
    BeamBeliefs
        What is believed after each range.
    """
    posterior = independent(world, np.full(world.n_cells, world.prior))
    kept, steps = posterior, []
    for z in ranges:
        seen = beam_likelihood(world, z)
        posterior = (posterior * seen).normalised()
        exact, grid = (occupied(belief) for belief in (posterior, (kept * seen).normalised()))
        kept = independent(world, grid)
        apart = _apart(posterior, independent(world, exact)), _apart(posterior, kept)
        steps.append((exact, grid, *apart))
    return BeamBeliefs(*map(np.array, zip(*steps, strict=True)))


def independent(world: BeamWorld, p: ArrayLike) -> Factor:
    """Return the distribution over maps in which cells are independent.

    Parameters
    ----------
    world : BeamWorld
        The cells, and how the beam is reflected and measured.
    p : (K,) float
        P(occupied) of each cell.

    Returns
    -------
    Factor
        A table over `world.cells`.
    """
    return product(Factor(cell, [1 - one, one]) for cell, one in zip(world.cells, np.asarray(p), strict=True))


def occupied(belief: Factor) -> NDArray[np.float64]:
    """Return the marginals P(occupied) of a distribution over maps.

    Parameters
    ----------
    belief : Factor
        A distribution over K cells, each 0 (free) or 1 (occupied).

    Returns
    -------
    (K,) float64
        P(occupied) of each cell.
    """
    tables = [belief.sum(*(other for other in belief.names if other != cell)).normalised() for cell in belief.names]
    return np.array([table.table[1] for table in tables])


def _apart(one: Factor, other: Factor) -> float:
    """Return the total variation of two distributions over the same variables."""
    return float(total_variation(one.table.ravel(), other.ordered(*one.names).table.ravel()))
