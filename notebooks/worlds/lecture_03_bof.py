"""BOF as a graphical model: joint inference over a few cells, and the loss from filtering each cell separately.

The antecedents of a cell are the cells from which something may move into it. The package's BOF keeps one distribution
per cell, and combines arrivals from the antecedents by two rules. The probabilities of arrivals add up, as if at most
one of them could happen. And arrivals are assumed independent of what is already in the cell.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical import Factor
from semgrid_edu.occupancy import BofState, SensorModel, bof_predict, bof_update
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, directed
from worlds.lecture_03_row import DT, SPEED, Cell, CellsInARow, exact_beliefs, hit_probability, row_evidence, row_model

AT_THE_EDGE = CellsInARow(({"left": 0.3, "right": 0.5}, {}, {}, {"static": 0.4}), (".x..", "..x.", "...x"))
"""A thing in cell 1 either leaves the row at once or crosses it, towards cell 4, which may be STATIC.

BOF is exact here at all three steps: the cells are independent at first, the moving thing can arrive in only one cell
of the row, and the cell that it leaves is free whether it was there or not."""

STANDING_OR_DRIVING = CellsInARow(({"static": 0.5, "right": 0.5}, {}, {}, {}), (".x..", "..x.", "...x"))
"""One thing in cell 1, either parked or driving: after a step it is either in cell 1 or in cell 2.

The scans show it driving to the right. After the first scan, joint inference gives P(cell 1 is free) = 0.97. BOF
assumes that the two cells are independent, so it gives 0.70, and expects 1.24 things in the row."""

HEAD_ON = CellsInARow(({"right": 0.5}, {}, {"left": 0.5}, {}), ("????", "????", "????"))
"""Two things, each there with probability 1/2. Both would arrive in cell 2 at once, so at most one of them is there.

Three of the four combinations remain, so cell 2 is occupied with probability 2/3. BOF adds 1/2 and 1/2, and is certain
that the cell is occupied (0.999, its upper limit)."""

TOWARDS_A_FENCE = CellsInARow(({}, {"static": 0.3, "right": 0.6}, {"static": 0.5}, {}), ("????", "????", "????"))
"""A thing in cell 2 is parked, or drives into cell 3, where there may be a fence.

The thing and the fence can't share cell 3. So the thing is less likely to drive, and the probability that it is parked
in cell 2 rises from 0.3 to 3/7. BOF correctly rules out the impossible combination in cell 3, but cell 2 doesn't learn
of it and keeps 0.3."""


def bof_beliefs(world: CellsInARow) -> NDArray[np.float64]:
    """Run the package's BOF along a row in double precision: each cell's distribution after each scan, (T, K, 5).

    The states are in the order of `Cell`.
    """
    params = world.params
    state = _first_state(world)
    beliefs = []
    for step in range(1, len(world.scans) + 1):
        predicted = bof_predict(state, world.spec, params, DT)
        state = bof_update(predicted, world.spec, world.evidence(step), params)
        planes = [state.free, *state.occupied[_used(state.velocity)], state.unknown]
        beliefs.append(np.concatenate(planes).T)
    return np.array(beliefs)


def expected_things(beliefs: NDArray) -> NDArray[np.float64]:
    """Return the expected number of things in the row after each step, (T,): the sum of P(occupied) over all cells."""
    return beliefs[..., [Cell.STATIC, Cell.LEFT, Cell.RIGHT]].sum(axis=(1, 2))


def stands_or_drives() -> StageGraph:
    """Return the graph of one thing that stands in cell 1 or drives into cell 2: its past, two cells, their beams.

    It is `STANDING_OR_DRIVING` up to its first scan. The states of m1,0 are "stands" and "drives", those of the cells
    afterwards free and occupied, those of the scans pass and hit.
    """
    sees = hit_probability(SensorModel())[[Cell.FREE, Cell.STATIC]]
    factors = [
        Factor("m1,0", [0.5, 0.5]),
        Factor(("m1,0", "m1,1"), [[0, 1], [1, 0]]),
        Factor(("m1,0", "m2,1"), [[1, 0], [0, 1]]),
        Factor(("m1,1", "z1,1"), sees),
        Factor(("m2,1", "z2,1"), sees),
    ]
    places = {"m1,0": (0, 1.2), "m1,1": (0, 0), "m2,1": (1.9, 0), "z1,1": (0, -1.1), "z2,1": (1.9, -1.1)}
    return StageGraph(
        "one thing, two cells",
        directed(factors),
        positions=places,
        observed=("z1,1", "z2,1"),
        labels={name: f"${name[0]}_{name[1]}^{{{'t' if name[3] == '1' else 't-1'}}}$" for name in places},
        equations={"m1,0": "stands or drives", "m2,1": "free or occupied", "z2,1": "pass or return"},
        cut=CUT,
    )


def bof_stage(world: CellsInARow = STANDING_OR_DRIVING) -> StageGraph:
    """Return the graph of two time slices, from the row's first belief and first scan: cells, and their antecedents."""
    columns = range(1, len(world.cells) + 1)
    rows = {"one{},1": 1.5, "m{},0": 0.0, "m{},1": -1.4, "z{},1": -2.4}
    labels = {
        "one{},1": r"$\leq 1$",
        "m{},0": "$m_{{{}}}^{{t-1}}$",
        "m{},1": "$m_{{{}}}^{{t}}$",
        "z{},1": "$z_{{{}}}^{{t}}$",
    }
    words = {"one{},1": "at most one thing", "m{},0": "what the cell holds", "z{},1": "pass or hit"}
    return StageGraph(
        "BOF: a cell and its antecedents",
        row_model(world, 1),
        positions={name.format(k): (1.9 * k, y) for name, y in rows.items() for k in columns},
        observed=tuple(row_evidence(world, 1)),
        labels={name.format(k): text.format(k) for name, text in labels.items() for k in columns},
        equations={name.format(columns[-1]): text for name, text in words.items()},
    )


def _first_state(world: CellsInARow) -> BofState:
    belief = world.belief.T[:, None]
    lattice = world.params.lattice
    occupied = np.zeros((len(lattice), *world.spec.shape))
    occupied[_used(lattice.velocities)] = belief[[Cell.STATIC, Cell.LEFT, Cell.RIGHT]]
    remainder = np.zeros((len(lattice), 2))
    return BofState(belief[Cell.FREE], belief[Cell.UNKNOWN], occupied, lattice.velocities, remainder)


def _used(velocities: NDArray) -> list[int]:
    """Return the indices of a lattice's velocities for STATIC, LEFT and RIGHT."""
    wanted = ((0, 0), (0, SPEED), (0, -SPEED))
    return [int(np.flatnonzero((velocities == velocity).all(axis=1))[0]) for velocity in wanted]


@cache
def in_both_places() -> Price:
    """Return the expected number of things in a row where one thing is parked or drives."""
    exact = expected_things(exact_beliefs(STANDING_OR_DRIVING))
    bof = expected_things(bof_beliefs(STANDING_OR_DRIVING))
    return Price(exact[0], bof[0], "things in the row")


CUT = (
    CutEdge(
        "m1,t-1 -> m2,t",
        "BOF keeps each cell's marginal and forgets that both cells ask about the same past, so a thing that either "
        "stands or drives is believed to be in both places: 1.24 things instead of 1.",
        ("m1,0", "m2,1"),
        in_both_places,
    ),
)
"""The edge that BOF cuts: after the flight, cell 2 has a copy of cell 1's past."""
