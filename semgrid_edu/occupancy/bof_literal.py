"""The BOF's prediction cell by cell, velocity by velocity (Coue et al., IJRR 2006; paper, section 3.2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.bof_state import BofParams, BofState
from semgrid_edu.occupancy.bof_steps import going_on, whole_cells
from semgrid_edu.occupancy.cellwise import CERTAIN
from semgrid_edu.occupancy.state import State
from semgrid_edu.occupancy.world import transition_matrix

FREE, STATIC, DYNAMIC, UNKNOWN = State


def bof_predict_literal(state: BofState, spec: GridSpec, params: BofParams, dt: float) -> BofState:
    """Predict by loops over cells and velocities, in double precision: the literal twin of `bof_predict`.

    Parameters and result are those of `bof_predict`.
    """
    M, kept = transition_matrix(params.world, dt), going_on(state, params, dt).astype(np.float64)
    changed = accelerate(state, params, dt)
    cells, remainder = whole_cells(state, spec, dt)
    own, newborn = np.zeros((4, *spec.shape)), np.zeros(spec.shape)
    stays, arrives = np.zeros((2, *state.occupied.shape))
    for row, col in np.ndindex(spec.shape):
        before = state.probability[:, row, col].astype(np.float64)
        own[:, row, col] += before @ M
        newborn[row, col] = before[[FREE, STATIC, UNKNOWN]] @ M[[FREE, STATIC, UNKNOWN], DYNAMIC]
        for k in range(1, len(cells)):
            moving = M[DYNAMIC, DYNAMIC] * changed[k, row, col]
            own[STATIC, row, col] += moving * (1 - kept[k])
            to = row - cells[k, 0], col - cells[k, 1]
            if to == (row, col):
                stays[k, row, col] += moving * kept[k]
            else:
                own[FREE, row, col] += moving * kept[k]
                if 0 <= to[0] < spec.shape[0] and 0 <= to[1] < spec.shape[1]:
                    arrives[k, *to] += moving * kept[k]
    stays += params.lattice.prior[:, None, None] * newborn
    occupied = np.zeros(state.occupied.shape)
    for row, col in np.ndindex(spec.shape):
        here = meet_literal(own[:, row, col], stays[:, row, col], arrives[:, row, col])
        own[:, row, col], occupied[:, row, col] = here
    return BofState(own[FREE], own[UNKNOWN], occupied, state.velocity, remainder)


def accelerate(state: BofState, params: BofParams, dt: float) -> NDArray[np.float64]:
    """Return the mass of each velocity after some has changed to neighbouring velocities.

    Parameters
    ----------
    state : BofState
        Before.
    params : BofParams
        Lattice and acceleration.
    dt : float
        Seconds.

    Returns
    -------
    (V, H, W) float64
    """
    change = params.lattice.change_probability(params.world.max_acceleration, dt)
    changed = np.zeros(state.occupied.shape)
    for k, neighbours in enumerate(params.lattice.neighbours):
        changed[k] += (1 - 4 * change) * state.occupied[k]
        for neighbour in neighbours:
            changed[neighbour] += change * state.occupied[k]
    return changed


def meet_literal(own: NDArray, stays: NDArray, arrives: NDArray) -> tuple[NDArray, NDArray]:
    """Let mass that arrives in a cell meet what the cell holds, as `predict` says.

    Parameters
    ----------
    own : (4,) float
        The cell's own FREE, STATIC and UNKNOWN; its DYNAMIC is in `stays`.
    stays, arrives : (V,) float
        Moving mass that is in the cell already, and that comes in.

    Returns
    -------
    own : (4,) float
    occupied : (V,) float
        Its first entry is STATIC.
    """
    arrival = arrives.sum()
    claim = min(arrival, CERTAIN)
    consistent = 1 - claim * own[STATIC]
    occupied = stays * (1 - claim) / consistent
    if arrival > 0:
        occupied += arrives / arrival * claim * (1 - own[STATIC]) / consistent
    own = own * (1 - claim) / consistent
    occupied[0] = own[STATIC]
    return own, occupied
