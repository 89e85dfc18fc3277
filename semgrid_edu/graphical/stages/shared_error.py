"""One pose error in all returns of a scan: an error that evidence cell by cell takes for two independent ones.

Several rings of a LIDAR hit a wall in the same scan, so a wrong pose shifts all their returns together. Evidence cell
by cell takes these returns as independent, up to `SensorModel.max_returns` of them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.exact import eliminate
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.layout import in_rows
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.stages.beam import BINS_PER_CELL, MARGIN, BeamWorld, range_bins, range_state, reflection
from semgrid_edu.graphical.stages.beam_beliefs import beam_beliefs, occupied
from semgrid_edu.graphical.stages.stage_graph import CutEdge, StageGraph
from semgrid_edu.graphical.stages.thick_walls import package_row, same_sensor

CUT = (
    CutEdge(
        "e -> z1, z2",
        "Evidence cell by cell has no pose error, so returns that are wrong together count as if each were wrong by "
        "itself, and a second ring makes the grid much surer of a cell than it should be.",
    ),
)
"""The variable that the grid leaves out."""


def scan_with_pose_error(world: BeamWorld | None = None, rings: int = 2) -> StageGraph:
    """Build the graph of one scan whose rings share the pose error e: each range is z = r + e.

    Parameters
    ----------
    world : BeamWorld, optional
        The cells and the beam; eight cells with the package's sensor and a noise of one cell when left out. Its `noise`
        is the standard deviation of the pose along the beams, in cells; the rings' own noise is left out.
    rings : int
        Number of rings, each with one return in the scan; at least 1.

    Returns
    -------
    StageGraph
        Variables m1 ... mK, r1, r2, ... and z1, z2, ... as in `beam_over_cells`, and e in tenths of a cell.

    Raises
    ------
    ArgumentError
        When `rings` is below 1, or the noise is 0.
    """
    world = world or same_sensor(1.0)
    if rings < 1:
        raise ArgumentError("rings", "at least 1", rings)
    if world.noise == 0:
        raise ArgumentError("world", "a noise above 0: the pose error", world)
    names = [(f"r{b}", f"z{b}") for b in range(1, rings + 1)]
    factors = [Factor(cell, [1 - world.prior, world.prior]) for cell in world.cells]
    factors.append(Factor("e", _pose_error(world)))
    for r, z in names:
        factors += [reflection(world, r), Factor((r, "e", z), _shifted(world))]
    parents = dict.fromkeys((r for r, _ in names), world.cells) | {z: (r, "e") for r, z in names}
    reflected, measured = zip(*names, strict=True)
    return StageGraph(
        "One scan, one pose error",
        GraphicalModel(factors, parents),
        observed=measured,
        positions=in_rows(world.cells, (), reflected, measured, ["e"]),
        equations={"e": "pose error"},
        cut=CUT,
    )


def _offsets(world: BeamWorld) -> NDArray[np.int64]:
    margin = int(np.ceil(MARGIN * world.noise)) * BINS_PER_CELL
    return np.arange(-margin, margin + 1)


def _pose_error(world: BeamWorld) -> NDArray[np.float64]:
    """Return P(e): normal, in tenths of a cell."""
    density = np.exp(-0.5 * (_offsets(world) / BINS_PER_CELL / world.noise) ** 2)
    return density / density.sum()


def _shifted(world: BeamWorld) -> NDArray[np.float64]:
    """Return P(z | r, e): 1 for z = r + e, otherwise 0; the last state of r and of z is "none"."""
    ranges = np.arange(world.n_ranges)[:, None] * BINS_PER_CELL + _offsets(world)
    first = _offsets(world)[0]
    table = np.zeros((world.n_ranges + 1, len(_offsets(world)), len(range_bins(world)) + 1))
    table[:-1] = np.eye(table.shape[2])[ranges - first]
    table[-1, :, -1] = 1
    return table


class Counted(NamedTuple):
    """P(occupied) of the cell in which all returns of a scan lie, for one ring, two rings, and so on.

    Parameters
    ----------
    exact : (rings,) float64
        The exact probability, when all rings share one pose error.
    independent : (rings,) float64
        The exact probability if each ring had an error of its own.
    package : (rings,) float64
        The probability in the package's log-odds grid.
    """

    exact: NDArray[np.float64]
    independent: NDArray[np.float64]
    package: NDArray[np.float64]


def count_rings(noise: float = 1.0, rings: int = 3, z: int = 4) -> Counted:
    """Measure how sure one scan makes exact inference, and the package's grid, of the cell of its returns.

    With a pose error of one cell, 20 cm, the package's grid gives the cell P(occupied) = 0.80 after one ring and 0.97,
    its upper bound, after two. The exact probability is 0.40 after one ring and 0.46 after two, and a third ring adds
    nothing more. If each ring had an error of its own, it would be 0.57 after two rings and 0.69 after three.

    Parameters
    ----------
    noise : float
        Standard deviation of the pose along the beams, in cells.
    rings : int
        Largest number of rings, which all have a return at the same range.
    z : int
        That range, in cells, 0 for the middle of the nearest cell.

    Returns
    -------
    Counted
        P(occupied) for each number of rings.
    """
    world = same_sensor(noise)
    exact, package = [], []
    for count in range(1, rings + 1):
        stage = scan_with_pose_error(world, count)
        known = dict.fromkeys(stage.observed, range_state(world, z))
        exact.append(occupied(eliminate(stage.model, world.cells, known).normalised())[z])
        package.append(package_row([z], rings=count)[0, z])
    independent = beam_beliefs(world, [float(z)] * rings).exact[:, z]
    return Counted(np.array(exact), independent, np.array(package))
