"""A few cells in a row in front of the sensor, and joint inference over all of them.

BOF and CMCDOT keep one distribution per cell. Here we compare them with joint inference.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from itertools import product as every_combination

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, GraphicalModel, eliminate
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    BofParams,
    Evidence,
    SensorModel,
    State,
    VelocityLattice,
    Walls,
    WorldModel,
    transition_matrix,
)
from worlds.lecture_00_stage_graph import directed

SPEED = 5.0
"""Speed of everything that moves, m/s: exactly one cell per step."""

CELL = 0.5
"""Side of a cell, metres."""

DT = 0.1
"""Time from one step to the next, seconds."""

NO_CHANGE = ((0.0,) * 4,) * 4
"""Rates of a world in which static things stay static and moving things keep moving."""

HIT, PASS, NOT_SEEN = "x.?"
"""The letters of a scan: a return from the cell, a beam that passes it, neither."""


class Cell(IntEnum):
    """The states of a cell: the package's four, with DYNAMIC split by its velocity."""

    FREE = 0
    STATIC = 1
    LEFT = 2
    RIGHT = 3
    UNKNOWN = 4


STATE_OF = (State.FREE, State.STATIC, State.DYNAMIC, State.DYNAMIC, State.UNKNOWN)
"""The package's state for each state of `Cell`."""


@dataclass(frozen=True, eq=False)
class CellsInARow:
    """The initial beliefs about a row of cells, independent of each other, and the scans that follow.

    The row is a grid of one row across the view; cell 1 is the leftmost. Moving things have one of two velocities, one
    cell per step to the left or to the right; static things have velocity zero. Whatever leaves the row is gone, and
    nothing comes in. Nothing is born moving, because its velocity could point out of the row.

    Parameters
    ----------
    cells : tuple of dict
        For each cell the probabilities of "static", "left", "right" and "unknown"; the rest is free.
    scans : tuple of str
        One per step, one letter per cell: "x" for a return, "." for a beam that passes, "?" for an unseen cell.
    rates : 4 x 4 floats
        Rates of change, 1/s, as in `WorldModel`; nothing becomes DYNAMIC.
    first_sight : (float, float, float)
        Probabilities of FREE, STATIC and DYNAMIC when an UNKNOWN cell is first seen; the last one 0.
    clearing_time : float
        How far back and ahead the filters look, seconds, as in `Walls`; exact inference doesn't need it. The
        default reaches five cells far, so it makes no difference in a row of at most five. `DT` reaches the next cell.
        (`clearing_cells` is 0 here, because everything that moves is equally fast.)
    """

    cells: tuple[Mapping[str, float], ...]
    scans: tuple[str, ...]
    rates: tuple[tuple[float, ...], ...] = NO_CHANGE
    first_sight: tuple[float, float, float] = (0.85, 0.15, 0.0)
    clearing_time: float = Walls.clearing_time

    def __post_init__(self) -> None:
        """Reject worlds that the joint model doesn't cover."""
        if any(row[State.DYNAMIC] for row in self.rates) or self.first_sight[State.DYNAMIC]:
            found = (self.rates, self.first_sight)
            raise ArgumentError("rates, first_sight", "none that makes anything DYNAMIC", found)

    @property
    def belief(self) -> NDArray[np.float64]:
        """(K, 5): the first belief of each cell, states in the order of `Cell`."""
        belief = np.array([[cell.get(state.name.lower(), 0.0) for state in Cell] for cell in self.cells])
        belief[:, Cell.FREE] = 1 - belief.sum(axis=1)
        return belief

    @property
    def params(self) -> BofParams:
        """The assumption of both filters: a lattice of zero and four velocities; the row uses left and right."""
        world = WorldModel(
            rates=self.rates,
            first_sight=self.first_sight,
            # In a row of cells there is nothing beside a path but the path itself.
            walls=Walls(clearing_time=self.clearing_time, clearing_cells=0.0, running_speed=1e6),
            max_acceleration=0.0,
            stop_rate=0.0,
        )
        return BofParams(VelocityLattice(max_speed=SPEED, spacing=SPEED), world)

    @property
    def spec(self) -> GridSpec:
        """A grid of shape (1, K)."""
        return GridSpec(0, CELL, 0, len(self.cells) * CELL, CELL)

    @cached_property
    def mixing(self) -> NDArray[np.float64]:
        """(5, 5): the package's transition matrix of one step; what stays DYNAMIC keeps its velocity."""
        M = transition_matrix(self.params.world, DT)[np.ix_(STATE_OF, STATE_OF)]
        M[[Cell.LEFT, Cell.RIGHT], [Cell.RIGHT, Cell.LEFT]] = 0
        return M

    def evidence(self, step: int) -> Evidence:
        """Return scan number `step`, from 1, as the filters take it: likelihoods in the cells of `spec`, float64."""
        sensor = self.params.world.sensor
        likelihoods = {
            HIT: (sensor.p_hit_occupied, sensor.p_hit_free),
            PASS: (sensor.p_pass_occupied, sensor.p_pass_free),
            NOT_SEEN: (1.0, 1.0),
        }
        occupied, free = np.array([likelihoods[letter] for letter in self.scans[step - 1]]).T
        return Evidence(occupied[None], free[None])


def row_model(world: CellsInARow, steps: int | None = None) -> GraphicalModel:
    """Build the joint model of all cells over time; `steps` is the number of scans when left out.

    At each step a cell first changes by the transition matrix (m, left out where nothing changes). Then everything that
    moves flies: the next state c of a cell follows from its own m and those of its two neighbours, its antecedents. A
    binary variable, always observed to be 1, is 1 when at most one thing claims the cell, which rules out all histories
    in which two things share a cell. Two things that swap their cells are allowed, as in BOF. The scan z depends on the
    cell alone.

    Cell k at step t has the variables "mk,t" (states as in `Cell`; t from 0) and, from step 1 on, "mixedk,t" (if
    anything changes), "onek,t" (0: several things, 1: at most one) and "zk,t" (0: pass, 1: hit).
    """
    steps = len(world.scans) if steps is None else steps
    factors = [Factor(f"m{k},0", belief) for k, belief in enumerate(world.belief, start=1)]
    for step in range(1, steps + 1):
        for k in range(1, len(world.cells) + 1):
            factors += _slice(world, k, step)
    return directed(factors)


def row_evidence(world: CellsInARow, steps: int) -> dict[str, int]:
    """Return the observations after some steps: the scans of the cells that they see, and that no cell is shared."""
    given = {}
    for step, scan in enumerate(world.scans[:steps], start=1):
        for k, letter in enumerate(scan, start=1):
            given[f"one{k},{step}"] = 1
            if letter != NOT_SEEN:
                given[f"z{k},{step}"] = int(letter == HIT)
    return given


def joint_belief(world: CellsInARow, step: int) -> Factor:
    """Return the joint distribution of all cells at a step, from 0, given all scans up to then: 5^K entries."""
    names = [f"m{k},{step}" for k in range(1, len(world.cells) + 1)]
    return eliminate(row_model(world, step), names, row_evidence(world, step)).normalised()


def exact_beliefs(world: CellsInARow) -> NDArray[np.float64]:
    """Return each cell's distribution given the scans up to each step, (T, K, 5): marginals of the joint distribution.

    The states are in the order of `Cell`.
    """
    joints = [joint_belief(world, step) for step in range(1, len(world.scans) + 1)]
    return np.array([[joint.marginal(name).table for name in joint.names] for joint in joints])


def flight() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a cell's next state when every moving thing flies one cell further.

    Returns
    -------
    next : (5, 5, 5, 5) float64
        P(state now | states before of the left neighbour, the cell itself, the right neighbour), 0 or 1. A cell that
        something has left is FREE; an UNKNOWN cell in which nothing arrives stays UNKNOWN.
    alone : (5, 5, 5, 2) float64
        P(at most one thing claims the cell | the same states). Where several things do, `next` doesn't matter.
    """
    n = len(Cell)
    following = np.zeros((n, n, n, n))
    alone = np.zeros((n, n, n, 2))
    for left, middle, right in every_combination(Cell, repeat=3):
        claims = [Cell.RIGHT] * (left == Cell.RIGHT) + [Cell.LEFT] * (right == Cell.LEFT)
        claims += [Cell.STATIC] * (middle == Cell.STATIC)
        empty = Cell.UNKNOWN if middle == Cell.UNKNOWN else Cell.FREE
        following[left, middle, right, claims[0] if claims else empty] = 1
        alone[left, middle, right, int(len(claims) <= 1)] = 1
    return following, alone


def hit_probability(sensor: SensorModel) -> NDArray[np.float64]:
    """Return P(z | cell), z = 0 for a beam that passes and 1 for a return: (5, 2), a row per state of `Cell`.

    The package has one pair of likelihoods for a hit and one for a pass, and Bayes' rule uses only the ratio of each
    pair. There is exactly one way to scale the two pairs so that P(hit) + P(pass) = 1 in each state. It is used here.
    UNKNOWN is like FREE.
    """
    likelihood = np.array([[sensor.p_pass_occupied, sensor.p_hit_occupied], [sensor.p_pass_free, sensor.p_hit_free]])
    occupied, free = likelihood * np.linalg.solve(likelihood, [1, 1])
    return np.array([free, occupied, occupied, occupied, free])


def _slice(world: CellsInARow, k: int, step: int) -> list[Factor]:
    """Return the factors of one cell at one step, the child of each last."""
    last = len(world.cells)
    first_sight = np.eye(len(Cell))
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
