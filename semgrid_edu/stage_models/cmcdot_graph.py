"""The graph of CMCDOT: one cell of four states in two time slices, and the moving thing that may arrive in it."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.occupancy import N_STATES, State, transition_matrix
from semgrid_edu.stage_models.cells_in_a_row import DT, NOT_SEEN, STATE_OF, Cell, CellsInARow
from semgrid_edu.stage_models.cmcdot import FORGETTING
from semgrid_edu.stage_models.joint_row import hit_probability
from semgrid_edu.stage_models.stage_graph import StageGraph, cut_edges, directed

FREE, STATIC, DYNAMIC, UNKNOWN = State

FROM_BOTH_SIDES = CellsInARow(
    ({"right": 0.5, "static": 0.3}, {"static": 0.3, "unknown": 0.4}, {"left": 0.2}),
    (".x.",),
    FORGETTING,
    clearing_time=DT,
)
"""Something may come into cell 2 from the left or from the right, and something may stand there already.

Something may also stand in cell 1, and cell 3 may be STATIC or UNKNOWN by now. So a little of what comes from cell 1
is doubtful, a share of 0.011: cell 2 may be the next piece of a wall."""

ELSEWHERE = 0
"""State of the moving thing when it is neither in the cell nor beside it: far away, gone, or no longer moving."""

PLACES = [(place, velocity) for place in (-1, 0, 1) for velocity in (-1, 1)]
"""Its other states, from 1: place relative to the cell, cells, and velocity, cells per step; positive to the right."""

HERE = np.array([False, *(place == 0 for place, _ in PLACES)])
"""For each of its states, whether it is then in the cell."""


def cmcdot_stage(world: CellsInARow = FROM_BOTH_SIDES, cell: int = 2) -> StageGraph:
    """Return the graph of two time slices: a cell of four states (m), and a moving thing with place and velocity (q).

    The edge from q1 to wall1 says: the place and the velocity of a thing tell where it came from and where it goes. So
    it may come out of a wall and go on along it (wall1). The edge from wall1 to one1 says: such a thing doesn't arrive
    in a cell that is UNKNOWN, because there it says only that the wall goes on. Two rules aren't in the graph: in a
    hidden cell that something has left, nothing stands (`update`); and a vehicle that drives glimpses what stands in
    the gaps of a wall (`predict`). Here the vehicle stands.

    There is at most one moving thing here, so if something arrives from the left, nothing arrives from the right. The
    filter makes the same assumption when it adds up the weights of arriving particles. When the cell itself holds
    nothing that moves, inference in this model gives what `predict` and `update` give for this cell, without sampling
    error.

    Parameters
    ----------
    world : CellsInARow
        The row, of which the first belief, the rates and the first scan are used.
    cell : int
        Number of the cell, from 1.

    Returns
    -------
    StageGraph
        Variables q0, q1 (`ELSEWHERE`, then `PLACES`), wall1 (1: comes out of a wall and goes on along it), m0, m1
        (`State`), one1 (1: nothing arrives where something stands, nor along a wall where no scan has seen) and z1
        (0: pass, 1: hit).

    Raises
    ------
    ArgumentError
        When more than one thing is expected to move in the cell and its neighbours.
    """
    evidence = ("one1",) if world.scans[0][cell - 1] == NOT_SEEN else ("one1", "z1")
    return StageGraph(
        "CMCDOT: particles and cells",
        _two_slices(world, cell),
        observed=evidence,
        positions={
            "q0": (0, 0.5),
            "q1": (3.4, 0.5),
            "wall1": (1.7, -0.7),
            "one1": (1.7, -2.1),
            "m0": (0, -3.1),
            "m1": (3.4, -3.1),
            "z1": (3.4, -4.1),
        },
        labels={"q0": "$q_{t-1}^{(i)}$", "q1": "$q_t^{(i)}$", "wall1": "along a wall?", "one1": r"$\leq 1$"}
        | {"m0": "$m_k^{t-1}$", "m1": "$m_k^t$", "z1": "$z_k^t$", "neighbour": "$m_{k+1}^t$"},
        plates={"particles $i$": ("q0", "q1", "wall1"), "cells $k$": ("m0", "m1", "one1", "z1")},
        cut=cut_edges("cmcdot"),
        ghosts={"neighbour": (5.7, -3.1)},
    )


def _two_slices(world: CellsInARow, cell: int) -> GraphicalModel:
    M = transition_matrix(world.params.world, DT)
    first_sight = [*world.first_sight, 0] if world.scans[0][cell - 1] != NOT_SEEN else np.eye(N_STATES)[UNKNOWN]
    read = hit_probability(world.params.world.sensor)[[Cell.FREE, Cell.STATIC, Cell.LEFT, Cell.UNKNOWN]]
    factors = [
        Factor("q0", _first_place(world.belief, cell)),
        Factor(("q0", "m0"), _first_cell(world.belief[cell - 1])),
        Factor(("q0", "q1"), _flight(M[DYNAMIC, DYNAMIC])),
        Factor(("q1", "wall1"), _along_a_wall(world, cell, M)),
        Factor(("m0", "q1", "wall1", "one1"), _alone(M)),
        Factor(("m0", "q1", "m1"), _next_cell(M) @ np.vstack([np.eye(N_STATES)[:UNKNOWN], first_sight])),
        Factor(("m1", "z1"), read),
    ]
    return directed(factors)


def _first_place(belief: NDArray, cell: int) -> NDArray[np.float64]:
    """P(q0): where the moving thing is, as the cell and its neighbours believe."""
    around = np.pad(belief, ((1, 1), (0, 0)))[cell - 1 : cell + 2]
    moving = around[:, [Cell.LEFT, Cell.RIGHT]].ravel()
    if moving.sum() > 1:
        raise ArgumentError("world", f"at most one moving thing around cell {cell}", f"{moving.sum():g} expected")
    return np.array([1 - moving.sum(), *moving])


def _first_cell(belief: NDArray) -> NDArray[np.float64]:
    """P(m0 | q0): DYNAMIC where the moving thing is, else one of the other three as the cell believes."""
    others = belief[[Cell.FREE, Cell.STATIC, Cell.LEFT, Cell.UNKNOWN]] * (1, 1, 0, 1)
    others = others / others.sum() if others.any() else np.eye(N_STATES)[FREE]
    return np.where(HERE[:, None], np.eye(N_STATES)[DYNAMIC], others)


def _flight(goes_on: float) -> NDArray[np.float64]:
    """P(q1 | q0): one cell further, or ELSEWHERE when it stops moving or would be two cells away."""
    flight = np.zeros((1 + len(PLACES),) * 2)
    for before, (place, velocity) in enumerate(PLACES, start=1):
        after = (place + velocity, velocity)
        if after in PLACES:
            flight[before, 1 + PLACES.index(after)] = goes_on
    flight[:, ELSEWHERE] = 1 - flight.sum(axis=1)
    return flight


def _along_a_wall(world: CellsInARow, cell: int, M: NDArray) -> NDArray[np.float64]:
    """P(wall1 | q1): it came from where something stands, `clearing_time` ago, and will be where that may, too."""
    by_now, last = world.belief @ np.eye(N_STATES)[list(STATE_OF)] @ M, len(world.belief) - 1
    steps, doubt = round(world.clearing_time / DT), np.zeros(len(HERE))
    for state, (place, velocity) in enumerate(PLACES, start=1):
        origin, ahead = cell - 1 - velocity * steps, cell - 1 + velocity * steps
        if place == 0 and steps > 0 and 0 <= origin <= last:
            wall = by_now[ahead, [STATIC, UNKNOWN]].sum() if 0 <= ahead <= last else 1.0
            doubt[state] = by_now[origin, STATIC] * wall
    return np.stack([1 - doubt, doubt], axis=-1)


def _alone(M: NDArray) -> NDArray[np.float64]:
    """P(one1 | m0, q1, wall1): 0 where a thing arrives and the cell is STATIC by now, or UNKNOWN while wall1 = 1."""
    meets = np.stack([M[:, STATIC], M[:, STATIC] + M[:, UNKNOWN]], axis=-1)[:, None] * HERE[:, None]
    return np.stack([meets, 1 - meets], axis=-1)


def _next_cell(M: NDArray) -> NDArray[np.float64]:
    """P(m1 | m0, q1), before the scan: DYNAMIC where the thing arrives, FREE where it has left, else by the matrix."""
    following = np.repeat(M[:, None], len(HERE), axis=1)
    following[DYNAMIC] = np.eye(N_STATES)[FREE]
    if M[DYNAMIC, DYNAMIC] < 1:
        following[DYNAMIC, ELSEWHERE] = M[DYNAMIC] * (1, 1, 0, 1) / (1 - M[DYNAMIC, DYNAMIC])
    following[:, HERE] = np.eye(N_STATES)[DYNAMIC]
    return following
