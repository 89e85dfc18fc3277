"""The graph of CMCDOT: one cell of four states in two time slices, and the moving thing that may arrive in it."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, GraphicalModel, eliminate
from semgrid_edu.occupancy import N_STATES, State, transition_matrix
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, directed
from worlds.lecture_03_bof import bof_beliefs
from worlds.lecture_03_row import DT, NOT_SEEN, STATE_OF, Cell, CellsInARow, exact_beliefs, hit_probability
from worlds.lecture_04_cmcdot import FORGETTING, LEFT_OR_RIGHT, sampling_error

FREE, STATIC, DYNAMIC, UNKNOWN = State

FROM_BOTH_SIDES = CellsInARow(
    ({"right": 0.5, "static": 0.3}, {"static": 0.3, "unknown": 0.4}, {"left": 0.2}),
    (".x.",),
    FORGETTING,
    clearing_time=DT,
)
"""Something may move into cell 2 from the left or from the right, and something may already be there.

Cell 1 may be STATIC, and cell 3 may be STATIC or UNKNOWN by now. So a share of 0.011 of the arrivals from cell 1 is
suspect: cell 2 may be the next piece of a wall."""

ELSEWHERE = 0
"""State of the moving thing when it is neither in the cell nor beside it: far away, gone, or no longer moving."""

PLACES = [(place, velocity) for place in (-1, 0, 1) for velocity in (-1, 1)]
"""Its other states, from 1: place relative to the cell, cells, and velocity, cells per step; positive to the right."""

HERE = np.array([False, *(place == 0 for place, _ in PLACES)])
"""For each of its states, whether the thing is in the cell."""


def cmcdot_stage(world: CellsInARow = FROM_BOTH_SIDES, cell: int = 2) -> StageGraph:
    """Return the graph of two time slices: a cell of four states (m), and a moving thing with place and velocity (q).

    The edge from q1 to wall1: the place and velocity of a thing determine where it came from and where it goes. So it
    may come out of a wall and move along it (wall1). The edge from wall1 to one1: such a thing doesn't arrive in an
    UNKNOWN cell, because there it only shows that the wall continues. Two rules aren't in the graph: a hidden cell that
    something has left is empty (`update`); and a moving vehicle glimpses things in the gaps of a wall (`predict`). Here
    the vehicle doesn't move.

    There is at most one moving thing here, so if something arrives from the left, nothing arrives from the right. The
    filter makes the same assumption when it adds up the weights of arriving particles. When the cell itself holds
    nothing that moves, inference in this model gives what `predict` and `update` give for this cell, without sampling
    error.

    Parameters
    ----------
    world : CellsInARow
        The row, of which the first belief, the rates and the first scan are used.
    cell : int
        Number of the cell, from 1. At most one thing may move in it and its neighbours.

    Returns
    -------
    StageGraph
        Variables q0, q1 (`ELSEWHERE`, then `PLACES`), wall1 (1: comes out of a wall and goes on along it), m0, m1
        (`State`), one1 (1: nothing arrives in a STATIC cell, nor along a wall where no scan has seen) and z1 (0: pass,
        1: hit).
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
        cut=CUT,
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
    """P(wall1 | q1): it was in a STATIC cell `clearing_time` ago, and will be where one may be as well."""
    by_now = world.belief @ np.eye(N_STATES)[list(STATE_OF)] @ M
    last = len(world.belief) - 1
    steps = round(world.clearing_time / DT)
    doubt = np.zeros(len(HERE))
    for state, (place, velocity) in enumerate(PLACES, start=1):
        origin = cell - 1 - velocity * steps
        ahead = cell - 1 + velocity * steps
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


@cache
def left_by_bof() -> Price:
    """Measure the part of CMCDOT's error that no number of particles removes."""
    bof = bof_beliefs(LEFT_OR_RIGHT) - exact_beliefs(LEFT_OR_RIGHT)
    return Price(0.0, float(np.sqrt(np.square(bof).mean())), "root mean square error, N → ∞")


@cache
def sampling() -> Price:
    """Measure the additional error from sampling with 100 particles."""
    error = sampling_error(LEFT_OR_RIGHT, [100], seeds=range(40))
    return Price(0.0, float(error.to_bof[0]), "root mean square error, N = 100")


@cache
def out_of_a_wall() -> Price:
    """Query the arrival of a thing from a cell that may be STATIC."""
    unseen = {"unknown": 1.0}
    world = CellsInARow(({"static": 0.3, "right": 0.5}, unseen, unseen), ("???",), clearing_time=DT)
    found = eliminate(cmcdot_stage(world).model, "m1", {"one1": 1}).normalised().table
    return Price(exact_beliefs(world)[0, 1, Cell.RIGHT], found[State.DYNAMIC], "P(DYNAMIC) beside its origin")


CUT = (
    CutEdge(
        "m1,t - m2,t",
        "As in BOF, each cell is updated by itself, which leaves a root mean square error of 0.051 in a world where a "
        "thing goes left or right, however many particles there are.",
        ("m1", "neighbour"),
        left_by_bof,
    ),
    CutEdge(
        "q,t-1 -> q,t",
        "N particles represent the distribution over places and velocities; in the same world their sampling error is "
        "0.010 with 100 particles and 0.001 with 6400.",
        ("q0", "q1"),
        sampling,
    ),
    CutEdge(
        "q,t-1 -> wall,t",
        "Whether the origin is STATIC counts as independent of the thing that has flown away from there, so where "
        "cell 1 holds a thing that stands (0.3) or drives (0.5) towards cells 2 and 3, which are UNKNOWN, the filter "
        "expects it in cell 2 with 0.41 instead of 0.50.",
        ("q0", "wall1"),
        out_of_a_wall,
    ),
)
"""The edges that CMCDOT cuts."""
