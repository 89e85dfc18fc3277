"""BOF as a graphical model: joint inference over four cells, and what is lost when each cell is filtered by itself.

The antecedents of a cell are the cells from which something may come into it. The package's BOF keeps one distribution
per cell, and combines what may arrive from the antecedents by two rules. The probabilities of arrivals add up, as if at
most one of them could happen. And whatever arrives is taken as independent of what stands in the cell already.
"""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.metrics import total_variation
from semgrid_edu.occupancy import BofState, bof_predict, bof_update
from semgrid_edu.stage_models.cells_in_a_row import DT, SPEED, Cell, CellsInARow
from semgrid_edu.stage_models.joint_row import exact_beliefs, row_evidence, row_model
from semgrid_edu.stage_models.stage_graph import StageGraph, cut_edges

AT_THE_EDGE = CellsInARow(({"left": 0.3, "right": 0.5}, {}, {}, {"static": 0.4}), (".x..", "..x.", "...x"))
"""Something in cell 1 either leaves the row at once or crosses it, towards something that may stand in cell 4.

BOF is exact here at all three steps: the cells are independent at first, what moves can arrive in only one cell of the
row, and the cell that it leaves is free whether it was there or not."""

STANDING_OR_DRIVING = CellsInARow(({"static": 0.5, "right": 0.5}, {}, {}, {}), (".x..", "..x.", "...x"))
"""One thing in cell 1, which either stands or drives: after a step it is either in cell 1 or in cell 2.

The scans show it driving to the right. After the first one, joint inference gives cell 1 a probability of 0.97 of being
free. BOF takes the two cells as independent, so it says 0.70, and expects 1.24 things in the row."""

HEAD_ON = CellsInARow(({"right": 0.5}, {}, {"left": 0.5}, {}), ("????", "????", "????"))
"""Two things, each there with probability 1/2. Both would arrive in cell 2 at once, so at most one of them is there.

Of the four combinations three are left, so cell 2 is occupied with probability 2/3. BOF adds 1/2 and 1/2, and is
certain that the cell is occupied (0.999, the most that it allows)."""

TOWARDS_A_FENCE = CellsInARow(({}, {"static": 0.3, "right": 0.6}, {"static": 0.5}, {}), ("????", "????", "????"))
"""Cell 2 holds something that stands, or drives into cell 3, where a fence may stand.

The thing and the fence can't share cell 3. So it is less probable that the thing drives, and the probability that it
stands in cell 2 rises from 0.3 to 3/7. BOF strikes the impossible combination out of cell 3, which is right, but
doesn't pass on to cell 2 what follows, so that cell 2 keeps 0.3."""


def bof_beliefs(world: CellsInARow) -> NDArray[np.float64]:
    """Run the package's BOF along a row, in double precision.

    Parameters
    ----------
    world : CellsInARow
        A row of K cells with T scans.

    Returns
    -------
    (T, K, 5) float64
        Each cell's distribution given the scans up to each step; states in the order of `Cell`.
    """
    params, state = world.params, _first_state(world)
    beliefs = []
    for step in range(1, len(world.scans) + 1):
        predicted = bof_predict(state, world.spec, params, DT)
        state = bof_update(predicted, world.spec, world.evidence(step), params)
        planes = [state.free, *state.occupied[_used(state.velocity)], state.unknown]
        beliefs.append(np.concatenate(planes).T)
    return np.array(beliefs)


def bof_errors(world: CellsInARow) -> NDArray[np.float64]:
    """Return the total variation between BOF's distribution of each cell and the exact one, (T, K).

    Parameters are those of `bof_beliefs`.

    Examples
    --------
    >>> bof_errors(AT_THE_EDGE).max() < 1e-9
    np.True_
    >>> bof_errors(STANDING_OR_DRIVING).max(axis=1).round(3)
    array([0.274, 0.154, 0.073])
    """
    return total_variation(bof_beliefs(world), exact_beliefs(world))


def expected_things(beliefs: NDArray) -> NDArray[np.float64]:
    """Return how many things are expected in the row after each step, (T,): the sum of P(occupied) over all cells.

    Parameters
    ----------
    beliefs : (T, K, 5) float
        Each cell's distribution, from `bof_beliefs` or `exact_beliefs`.
    """
    return beliefs[..., [Cell.STATIC, Cell.LEFT, Cell.RIGHT]].sum(axis=(1, 2))


def bof_stage(world: CellsInARow = STANDING_OR_DRIVING) -> StageGraph:
    """Return the graph of two time slices: each cell now, and its antecedents before.

    Parameters
    ----------
    world : CellsInARow
        The row, of which the first belief and the first scan are used.
    """
    columns = range(1, len(world.cells) + 1)
    rows = {"one{},1": 1.5, "m{},0": 0.0, "m{},1": -1.4, "z{},1": -2.4}
    before, now = ({f"m{k},{t}": f"$m_{{{k}}}^{{{when}}}$" for k in columns} for t, when in ((0, "t-1"), (1, "t")))
    return StageGraph(
        "BOF: a cell and its antecedents",
        row_model(world, 1),
        observed=tuple(row_evidence(world, 1)),
        positions={name.format(k): (1.9 * k, y) for name, y in rows.items() for k in columns},
        labels={f"one{k},1": r"$\leq 1$" for k in columns}
        | before
        | now
        | {f"z{k},1": f"$z_{{{k}}}^{{t}}$" for k in columns},
        equations={
            f"one{columns[-1]},1": "at most one thing",
            f"m{columns[-1]},0": "what the cell holds",
            f"z{columns[-1]},1": "pass or hit",
        },
        cut=cut_edges("bof"),
    )


def _first_state(world: CellsInARow) -> BofState:
    belief, lattice = world.belief.T[:, None], world.params.lattice
    occupied = np.zeros((len(lattice), *world.spec.shape))
    occupied[_used(lattice.velocities)] = belief[[Cell.STATIC, Cell.LEFT, Cell.RIGHT]]
    remainder = np.zeros((len(lattice), 2))
    return BofState(belief[Cell.FREE], belief[Cell.UNKNOWN], occupied, lattice.velocities, remainder)


def _used(velocities: NDArray) -> list[int]:
    """Return which velocities of a lattice are those of STATIC, LEFT and RIGHT."""
    wanted = ((0, 0), (0, SPEED), (0, -SPEED))
    return [int(np.flatnonzero((velocities == velocity).all(axis=1))[0]) for velocity in wanted]
