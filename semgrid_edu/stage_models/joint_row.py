"""Joint inference over all cells of a row: what BOF and CMCDOT would compute if they kept more than marginals."""

from itertools import product as every_combination

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical.exact import eliminate
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.occupancy import SensorModel
from semgrid_edu.stage_models.cells_in_a_row import HIT, NOT_SEEN, Cell, CellsInARow
from semgrid_edu.stage_models.stage_graph import directed


def row_model(world: CellsInARow, steps: int | None = None) -> GraphicalModel:
    """Build the joint model of all cells over time.

    At each step a cell first changes by the transition matrix (m, left out where nothing changes). Then everything that
    moves flies: the next state c of a cell follows from its own m and those of its two neighbours, its antecedents. A
    binary variable, always observed to be 1, says that at most one thing claims the cell, which strikes out all
    histories in which two things share a cell. Two things that swap their cells are allowed, as in BOF. The scan z
    depends on the cell alone.

    Parameters
    ----------
    world : CellsInARow
        A row of K cells.
    steps : int, optional
        Number of steps; that of the scans when left out.

    Returns
    -------
    GraphicalModel
        A directed model. Cell k at step t has the variables "mk,t" (states as in `Cell`; t from 0) and, from step 1 on,
        "mixedk,t" (if anything changes), "onek,t" (0: several things, 1: at most one) and "zk,t" (0: pass, 1: hit).
    """
    steps = len(world.scans) if steps is None else steps
    factors = [Factor(f"m{k},0", belief) for k, belief in enumerate(world.belief, start=1)]
    for step in range(1, steps + 1):
        for k in range(1, len(world.cells) + 1):
            factors += _slice(world, k, step)
    return directed(factors)


def row_evidence(world: CellsInARow, steps: int) -> dict[str, int]:
    """Return what is known after some steps: what each scan says of the cells it sees, and that no cell is shared.

    Parameters
    ----------
    world : CellsInARow
        The row, of which the scans are used.
    steps : int
        Number of steps.
    """
    given = {}
    for step, scan in enumerate(world.scans[:steps], start=1):
        for k, letter in enumerate(scan, start=1):
            given[f"one{k},{step}"] = 1
            if letter != NOT_SEEN:
                given[f"z{k},{step}"] = int(letter == HIT)
    return given


def joint_belief(world: CellsInARow, step: int) -> Factor:
    """Return the joint distribution of all cells at one step, given all scans up to then.

    Parameters
    ----------
    world : CellsInARow
        A row of K cells.
    step : int
        Number of the step, from 0.

    Returns
    -------
    Factor
        A normalised table over "m1,t" ... "mK,t", of 5^K entries.
    """
    names = [f"m{k},{step}" for k in range(1, len(world.cells) + 1)]
    return eliminate(row_model(world, step), names, row_evidence(world, step)).normalised()


def exact_beliefs(world: CellsInARow) -> NDArray[np.float64]:
    """Return each cell's distribution given the scans up to each step: the marginals of the joint distribution.

    Parameters
    ----------
    world : CellsInARow
        A row of K cells with T scans.

    Returns
    -------
    (T, K, 5) float64
        The distributions, with states in the order of `Cell`.
    """
    joints = [joint_belief(world, step) for step in range(1, len(world.scans) + 1)]
    return np.array([[joint.marginal(name).table for name in joint.names] for joint in joints])


def flight() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what becomes of a cell when everything that moves flies one cell further.

    Returns
    -------
    next : (5, 5, 5, 5) float64
        P(state now | states before of the left neighbour, the cell itself, the right neighbour), 0 or 1. A cell that
        something has left is FREE; an UNKNOWN cell in which nothing arrives stays UNKNOWN.
    alone : (5, 5, 5, 2) float64
        P(at most one thing claims the cell | the same states). Where several things do, `next` doesn't matter.
    """
    states = len(Cell)
    following, alone = np.zeros((states,) * 4), np.zeros((states,) * 3 + (2,))
    for left, own, right in every_combination(Cell, repeat=3):
        claims = [Cell.RIGHT] * (left == Cell.RIGHT) + [Cell.LEFT] * (right == Cell.LEFT)
        claims += [Cell.STATIC] * (own == Cell.STATIC)
        empty = Cell.UNKNOWN if own == Cell.UNKNOWN else Cell.FREE
        following[left, own, right, claims[0] if claims else empty] = 1
        alone[left, own, right, int(len(claims) <= 1)] = 1
    return following, alone


def hit_probability(sensor: SensorModel) -> NDArray[np.float64]:
    """Return P(z | cell), z = 0 for a beam that passes and 1 for a return, from the package's sensor model.

    The package has one pair of likelihoods for a hit and one for a pass, and Bayes' rule uses only the ratio of each
    pair. There is exactly one way to scale the two pairs so that P(hit) + P(pass) = 1 in each state. It is used here.

    Parameters
    ----------
    sensor : SensorModel
        The sensor, of which four probabilities are used: of a hit and of a pass, in an occupied and in a free cell.

    Returns
    -------
    (5, 2) float64
        One row per state, in the order of `Cell`; UNKNOWN is like FREE.
    """
    likelihood = np.array([[sensor.p_pass_occupied, sensor.p_hit_occupied], [sensor.p_pass_free, sensor.p_hit_free]])
    occupied, free = likelihood * np.linalg.solve(likelihood, [1, 1])
    return np.array([free, occupied, occupied, occupied, free])


def _slice(world: CellsInARow, k: int, step: int) -> list[Factor]:
    """Return the factors of one cell at one step, the child of each last."""
    last, first_sight = len(world.cells), np.eye(len(Cell))
    if world.scans[step - 1][k - 1] != NOT_SEEN:
        first_sight[Cell.UNKNOWN] = [*world.first_sight[:2], 0, 0, 0]
    following, alone = flight()
    # Beyond both ends of the row everything is FREE.
    inside = tuple(slice(None) if 1 <= j <= last else Cell.FREE for j in (k - 1, k, k + 1))
    changes = any(map(any, world.rates))
    before = [f"mixed{j},{step}" if changes else f"m{j},{step - 1}" for j in (k - 1, k, k + 1) if 1 <= j <= last]
    mixed = [Factor((f"m{k},{step - 1}", f"mixed{k},{step}"), world.mixing)] if changes else []
    return [
        *mixed,
        Factor((*before, f"m{k},{step}"), (following @ first_sight)[inside]),
        Factor((*before, f"one{k},{step}"), alone[inside]),
        Factor((f"m{k},{step}", f"z{k},{step}"), hit_probability(world.params.world.sensor)),
    ]
