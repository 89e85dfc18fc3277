"""A few cells in a row in front of the sensor: a world in which BOF and CMCDOT are compared with exact answers."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import BofParams, Evidence, State, VelocityLattice, Walls, WorldModel, transition_matrix

SPEED = 5.0
"""Speed of everything that moves, m/s: exactly one cell per step."""

CELL = 0.5
"""Side of a cell, metres."""

DT = 0.1
"""Time from one step to the next, seconds."""

NO_CHANGE = ((0.0,) * 4,) * 4
"""Rates of a world in which what stands goes on standing and what moves goes on moving."""

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
    """What is believed of a row of cells at first, each independent of the others, and what scans then see of it.

    The row is a grid of one row that lies across the view: cell 1 is the leftmost. Things that move have one of two
    velocities, one cell per step to the left or to the right; things that stand have velocity zero. What leaves the row
    is gone, and nothing comes in. Nothing is born moving, because its velocity could point out of the row.

    Parameters
    ----------
    cells : tuple of dict
        For each cell the probabilities of "static", "left", "right" and "unknown"; the rest is free.
    scans : tuple of str
        One per step, one letter per cell: "x" for a return, "." for a beam that passes, "?" for an unseen cell.
    rates : 4 x 4 floats
        Rates of change, 1/s, as in `WorldModel`; nothing becomes DYNAMIC.
    first_sight : (float, float, float)
        What UNKNOWN cells turn out to be when they are first seen: FREE, STATIC and DYNAMIC, the last 0.
    clearing_time : float
        How far back and ahead the filters look, seconds, as in `Walls`; exact inference doesn't need it. The
        default reaches five cells far, so it makes no difference in a row of at most five. `DT` reaches the next cell.
        (`clearing_cells` is 0 here, because everything that moves is equally fast.)

    Raises
    ------
    ArgumentError
        When a cell's numbers aren't probabilities, a scan doesn't fit the row, or something would be born moving.
    """

    cells: tuple[Mapping[str, float], ...]
    scans: tuple[str, ...]
    rates: tuple[tuple[float, ...], ...] = NO_CHANGE
    first_sight: tuple[float, float, float] = (0.85, 0.15, 0.0)
    clearing_time: float = Walls.clearing_time

    def __post_init__(self) -> None:
        """Refuse a world that the joint model doesn't describe."""
        for number, cell in enumerate(self.cells, start=1):
            known = set(cell) <= {"static", "left", "right", "unknown"}
            if not known or min(cell.values(), default=0) < 0 or sum(cell.values()) > 1:
                expected = "probabilities of static, left, right and unknown with a sum of at most 1"
                raise ArgumentError(f"cells, cell {number}", expected, dict(cell))
        for number, scan in enumerate(self.scans, start=1):
            if len(scan) != len(self.cells) or not set(scan) <= {HIT, PASS, NOT_SEEN}:
                expected = f"{len(self.cells)} letters, each {HIT} or {PASS} or {NOT_SEEN}"
                raise ArgumentError(f"scans, scan {number}", expected, scan)
        if any(row[State.DYNAMIC] for row in self.rates) or self.first_sight[State.DYNAMIC]:
            raise ArgumentError(
                "rates, first_sight", "none that makes anything DYNAMIC", (self.rates, self.first_sight)
            )

    @property
    def belief(self) -> NDArray[np.float64]:
        """(K, 5): the first belief of each cell, states in the order of `Cell`."""
        belief = np.array([[cell.get(state.name.lower(), 0.0) for state in Cell] for cell in self.cells])
        belief[:, Cell.FREE] = 1 - belief.sum(axis=1)
        return belief

    @property
    def params(self) -> BofParams:
        """What both filters assume: a lattice of zero and four velocities, of which the row uses left and right."""
        world = WorldModel(
            rates=self.rates,
            first_sight=self.first_sight,
            walls=Walls(clearing_time=self.clearing_time, clearing_cells=0.0),
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
        """Return a scan as the filters take it.

        Parameters
        ----------
        step : int
            Number of the scan, from 1.

        Returns
        -------
        Evidence
            The likelihoods of the scan in the cells of `spec`, float64.
        """
        sensor = self.params.world.sensor
        said = {
            HIT: (sensor.p_hit_occupied, sensor.p_hit_free),
            PASS: (sensor.p_pass_occupied, sensor.p_pass_free),
            NOT_SEEN: (1.0, 1.0),
        }
        occupied, free = np.array([said[letter] for letter in self.scans[step - 1]]).T
        return Evidence(occupied[None], free[None])
