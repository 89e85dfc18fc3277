"""The BOF's prediction and update in plain numpy, velocity by velocity (Coue et al., IJRR 2006; section 3.2).

The last three functions are the rules that the BOF shares with CMCDOT.
"""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.bof import origins, whole_cells
from semgrid_edu.occupancy.bof_state import BofParams, BofState
from semgrid_edu.occupancy.cellwise import CERTAIN, ratio
from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.literal.particles import free_beside_static, slow_down_literal
from semgrid_edu.occupancy.particles import keeps_pace
from semgrid_edu.occupancy.state import Particles, State
from semgrid_edu.occupancy.world import HALT, transition_matrix

FREE, STATIC, DYNAMIC, UNKNOWN = State


def bof_predict_literal(state: BofState, spec: GridSpec, params: BofParams, dt: float, driven: float = 0.0) -> BofState:
    """Predict by loops over cells and velocities: the literal twin of `bof_predict`.

    Parameters, result and errors are those of `bof_predict`; the arrays of the result are float64.
    """
    check_shape("state", state.occupied, (len(params.lattice), *spec.shape))
    M = transition_matrix(params.world, dt)
    of_each = Particles(np.zeros_like(state.velocity), state.velocity, np.ones(len(state.velocity)))
    kept = slow_down_literal(of_each, params.world.stop_rate, params.world.stop_speed, dt).weight
    changed = _accelerate(state, params, dt)
    cells, remainder = whole_cells(state, spec, dt)
    own, newborn, vacated = np.zeros((4, *spec.shape)), np.zeros(spec.shape), np.zeros(spec.shape)
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
                vacated[row, col] += moving * kept[k]
                if 0 <= to[0] < spec.shape[0] and 0 <= to[1] < spec.shape[1]:
                    arrives[k, *to] += moving * kept[k]
    stays += params.lattice.prior[:, None, None] * newborn
    keeps = keeps_pace(*state.velocity.T, params.world.pace(driven, dt, spec.cell))[:, None, None]
    back, halt = (origins(state.velocity, spec, params.world, part) for part in (1, HALT))
    out_of_a_wall, past_one = (elsewhere_literal(own[STATIC], way) for way in (back, halt))
    along_no_wall = elsewhere_literal(1 - own[STATIC] - own[UNKNOWN] - keeps * free_beside_static(own), -back)
    doubt, occupied = np.maximum(out_of_a_wall, keeps * past_one) * (1 - along_no_wall), np.zeros(state.occupied.shape)
    for row, col in np.ndindex(spec.shape):
        here = own[:, row, col], vacated[row, col], stays[:, row, col], arrives[:, row, col], doubt[:, row, col]
        own[:, row, col], occupied[:, row, col] = collide_in_cell(*here)
    return BofState(own[FREE], own[UNKNOWN], occupied, state.velocity, remainder)


def _accelerate(state: BofState, params: BofParams, dt: float) -> NDArray[np.float64]:
    """Return the mass of each velocity, (V, H, W), after some of it has changed to neighbouring velocities.

    Mass at the first velocity, zero, stays there: what stands doesn't set off by accelerating a little.
    """
    change = params.lattice.change_probability(params.world.max_acceleration, dt)
    changed = np.zeros(state.occupied.shape)
    for k, neighbours in enumerate(params.lattice.neighbours):
        changed[k] += (1 - 4 * change) * state.occupied[k]
        for neighbour in neighbours:
            changed[neighbour] += change * state.occupied[k]
    return changed


def elsewhere_literal(plane: NDArray, cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Look a plane up, for each cell and velocity, in the cell where mass of that velocity is at another time.

    Parameters
    ----------
    plane : (H, W) or (V, H, W) float
        One number per cell, the same for all velocities or one for each.
    cells : (V, 2) int
        How far mass of each velocity moves until then, in cells along x and y: up and to the left.

    Returns
    -------
    (V, H, W) float64
        Zero where that is the same cell or lies outside.
    """
    height, width = plane.shape[-2:]
    planes, found = np.broadcast_to(plane, (len(cells), height, width)), np.zeros((len(cells), height, width))
    for k, row, col in np.ndindex(found.shape):
        there = row - cells[k, 0], col - cells[k, 1]
        if there != (row, col) and 0 <= there[0] < height and 0 <= there[1] < width:
            found[k, row, col] = planes[k, *there]
    return found


def collide_in_cell(
    own: NDArray, vacated: float, stays: NDArray, arrives: NDArray, doubt: NDArray
) -> tuple[NDArray, NDArray]:
    """Let the mass that arrives in one cell meet what the cell holds, by the rule of `predict`.

    Parameters
    ----------
    own : (4,) float
        P(FREE), P(STATIC) and P(UNKNOWN) of the cell; its dynamic mass is in `stays`.
    vacated : float
        Moving mass that has left the cell, and leaves it FREE.
    stays, arrives : (V,) float
        Moving mass of each velocity that is in the cell already, and that comes into it.
    doubt : (V,) float
        Which part of the mass of each velocity comes out of a wall and goes on along it.

    Returns
    -------
    own : (4,) float
        P(FREE), P(STATIC) and P(UNKNOWN) of the cell now.
    occupied : (V,) float
        P(occupied, velocity) of the cell now; the first velocity is zero, and its entry is P(STATIC).
    """
    unseen = own[UNKNOWN] + vacated
    factor, sure, less = strike_out(own[STATIC], arrives.sum(), unseen, (doubt * arrives).sum())
    occupied = stays * factor + arrives * (sure - doubt * less)
    occupied[0] = factor * own[STATIC]
    return factor * (own + vacated * np.eye(4)[FREE]), occupied


def bof_update_literal(state: BofState, spec: GridSpec, evidence: Evidence, params: BofParams) -> BofState:
    """Update by Bayes' rule over all that a cell can be: FREE, UNKNOWN, or occupied at one of the velocities.

        P(occupied, v | z) = P(z | occupied) P(occupied, v) / P(z),   P(free | z) = P(z | free) P(free) / P(z)

    All velocities share P(z | occupied), so a scan picks cells, and says nothing of velocities. First the UNKNOWN mass
    of cells that are seen is shared out, as in `update`; what becomes DYNAMIC takes the lattice's prior velocities.
    In hidden cells, what moves says that nothing stands where it was. This is the literal twin of `bof_update`.
    Parameters, result and errors are those of `bof_update`.
    """
    check_shape("state", state.occupied, (len(params.lattice), *spec.shape))
    check_shape("evidence", evidence.free, spec.shape)
    if_free, if_static, if_dynamic = params.world.first_sight
    revealed = np.where(evidence.occupied != evidence.free, state.unknown, 0).astype(np.float64)
    free, unknown = state.free + if_free * revealed, state.unknown - revealed
    occupied = state.occupied + if_dynamic * params.lattice.prior[:, None, None] * revealed
    occupied[0] += if_static * revealed
    of_occupied, of_free = relative_likelihoods(evidence)
    p_z = of_free * (free + unknown) + of_occupied * occupied.sum(axis=0)
    free, unknown = ratio(of_free * free, p_z), ratio(of_free * unknown, p_z)
    unknown += p_z == 0  # nothing that was held possible explains the scan
    occupied = ratio(of_occupied * occupied, p_z)
    left = mass_that_left(occupied, origins(state.velocity, spec, params.world))
    static = clear_wakes_literal(occupied[0], left, evidence.occupied == evidence.free)
    free, occupied[0] = free + occupied[0] - static, static
    return BofState(free, unknown, occupied, state.velocity, state.remainder)


def mass_that_left(occupied: NDArray, cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Add up in each cell the moving mass that was there some time ago and isn't any more.

    Parameters
    ----------
    occupied : (V, H, W) float
        P(occupied, velocity).
    cells : (V, 2) int
        Where mass of each velocity was then, in cells along x and y from where it is: up and to the left.

    Returns
    -------
    (H, W) float64
        The sums.
    """
    return elsewhere_literal(occupied, -cells).sum(axis=0)


def relative_likelihoods(evidence: Evidence) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Scale the two likelihoods of each cell so that the larger is 1, because products of tiny numbers would vanish.

    Parameters
    ----------
    evidence : Evidence
        The likelihoods of a scan, (H, W).

    Returns
    -------
    occupied, free : (H, W) float64
        Numbers from 0 to 1 in the ratio of P(z | occupied) to P(z | free): Bayes' rule needs no more.
    """
    best = np.maximum(evidence.occupied, evidence.free).astype(np.float64)
    return ratio(evidence.occupied, best), ratio(evidence.free, best)


def strike_out(
    static: NDArray, arrival: NDArray, unseen: NDArray, doubtful: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Combine "something arrives" with what a cell holds, and strike out the combinations that are impossible.

    With probability a something arrives, and with probability s the cell is STATIC. Both at once, a s, is impossible,
    because two solid things can't share a cell. With probability b something arrives that comes out of a wall and goes
    on along it, and with probability u the cell hasn't been seen to be free: b u is struck out too, because this only
    says that the wall goes on. The rest, 1 - a s - b u, is scaled to 1.

    Parameters
    ----------
    static : (...) float
        P(STATIC) of the cell, s.
    arrival : (...) float
        Dynamic mass that arrives in it; a is at most `CERTAIN`, so that no arrival is ever beyond doubt.
    unseen : (...) float
        P(UNKNOWN) of the cell, and what has only been left just now, u.
    doubtful : (...) float
        The part of the arrival that comes out of a wall and goes on along it; b is scaled as a is.

    Returns
    -------
    own : (...) float
        Factor of everything that the cell held, (1 - a) / (1 - a s - b u).
    sure : (...) float
        Factor of arriving mass that is beyond doubt, (a / arrival) (1 - s) / (1 - a s - b u).
    less : (...) float
        By how much the factor of doubtful mass is smaller, (a / arrival) u / (1 - a s - b u).
    """
    a = np.minimum(arrival, CERTAIN)
    share = ratio(a, arrival)
    consistent = 1 - a * static - share * doubtful * unseen
    return (1 - a) / consistent, share * (1 - static) / consistent, share * unseen / consistent


def clear_wakes_literal(static: NDArray, left: NDArray, hidden: NDArray) -> NDArray[np.float64]:
    """Return how much of P(STATIC) remains where moving things have been: the literal twin of `clear_wakes`.

    Of "a thing has gone from here", with probability a, and "it stands here", with probability s, both at once is
    impossible. Struck out, that leaves (1 - a) s / (1 - a s).

    Parameters
    ----------
    static : (H, W) float
        P(STATIC) given the scan, s.
    left : (H, W) float
        Dynamic mass that has left each cell; a is at most `CERTAIN`.
    hidden : (H, W) bool
        Whether the scan says nothing of the cell; nothing changes where it does.

    Returns
    -------
    (H, W) float64
        P(STATIC) now; FREE gets what is missing.
    """
    a = np.where(hidden, np.minimum(left, CERTAIN), 0)
    return (1 - a) * static / (1 - a * static)
