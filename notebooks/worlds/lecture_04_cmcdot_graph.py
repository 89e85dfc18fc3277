"""The graph of CMCDOT: one cell of four states in two time slices, and the moving thing that may arrive in it."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, GraphicalModel
from semgrid_edu.occupancy import N_STATES, State, transition_matrix
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, directed
from worlds.lecture_03_bof import bof_beliefs
from worlds.lecture_03_row import DT, NOT_SEEN, Cell, CellsInARow, exact_beliefs, hit_probability
from worlds.lecture_04_cmcdot import FORGETTING, LEFT_OR_RIGHT

FREE, STATIC, DYNAMIC, UNKNOWN = State

FROM_BOTH_SIDES = CellsInARow(
    ({"right": 0.5, "static": 0.3}, {"static": 0.3, "unknown": 0.4}, {"left": 0.2}),
    (".x.",),
    FORGETTING,
    clearing_time=0.0,
)
"""Something may move into cell 2 from the left or from the right, and something may already be there."""

ELSEWHERE = 0
"""State of the moving thing when it is neither in the cell nor beside it: far away, gone, or no longer moving."""

PLACES = [(place, velocity) for place in (-1, 0, 1) for velocity in (-1, 1)]
"""Its other states, from 1: place relative to the cell, cells, and velocity, cells per step; positive to the right."""

HERE = np.array([False, *(place == 0 for place, _ in PLACES)])
"""For each of its states, whether the thing is in the cell."""


def cmcdot_stage(world: CellsInARow = FROM_BOTH_SIDES, cell: int = 2) -> StageGraph:
    """Return the graph of two time slices: a cell of four states (m), and a moving thing with place and velocity (q).

    This is the paper's filter; what `Walls` adds to it isn't drawn.

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
        Variables q0, q1 (`ELSEWHERE`, then `PLACES`), m0, m1 (`State`), one1 (1: nothing arrives in a STATIC cell) and
        z1 (0: pass, 1: hit).
    """
    evidence = ("one1",) if world.scans[0][cell - 1] == NOT_SEEN else ("one1", "z1")
    return StageGraph(
        "CMCDOT: particles and cells",
        _two_slices(world, cell),
        observed=evidence,
        positions={
            "q0": (0, 0.4),
            "q1": (3.4, 0.4),
            "one1": (1.7, -0.9),
            "m0": (0, -1.8),
            "m1": (3.4, -1.8),
            "z1": (3.4, -2.9),
        },
        labels={"q0": "$q_{t-1}^{(i)}$", "q1": "$q_t^{(i)}$", "one1": "fits"}
        | {"m0": "$m_k^{t-1}$", "m1": "$m_k^t$", "z1": "$z_k^t$", "neighbour": "$m_{k+1}^t$"},
        plates={"particles $i$": ("q0", "q1"), "cells $k$": ("m0", "m1", "one1", "z1")},
        cut=CUT,
        ghosts={"neighbour": (5.7, -1.8)},
    )


def _two_slices(world: CellsInARow, cell: int) -> GraphicalModel:
    M = transition_matrix(world.params.world, DT)
    first_sight = [*world.first_sight, 0] if world.scans[0][cell - 1] != NOT_SEEN else np.eye(N_STATES)[UNKNOWN]
    read = hit_probability(world.params.world.sensor)[[Cell.FREE, Cell.STATIC, Cell.LEFT, Cell.UNKNOWN]]
    factors = [
        Factor("q0", _first_place(world.belief, cell)),
        Factor(("q0", "m0"), _first_cell(world.belief[cell - 1])),
        Factor(("q0", "q1"), _flight(M[DYNAMIC, DYNAMIC])),
        Factor(("m0", "q1", "one1"), _alone(M)),
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


def _alone(M: NDArray) -> NDArray[np.float64]:
    """P(one1 | m0, q1): 0 where a thing arrives and the cell is STATIC by now."""
    meets = M[:, STATIC, None] * HERE
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


CUT = (
    CutEdge(
        "m1,t - m2,t",
        "As in BOF, each cell is updated by itself, which leaves a root mean square error of 0.051 in a world where a "
        "thing goes left or right, however many particles there are.",
        ("m1", "neighbour"),
        left_by_bof,
    ),
)
"""The edge that CMCDOT cuts. Particles are no deleted edge: their error falls with their number."""
