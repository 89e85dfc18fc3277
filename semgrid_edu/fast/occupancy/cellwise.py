"""What the filter's steps do in each cell, independently of its neighbours, in compiled loops.

The loops compute with plain numbers and select values without branching, so that the compiler can vectorise them.
"""

import numpy as np
from numba import njit

from semgrid_edu.occupancy.state import MAX_MOVE_PROBABILITY, TINY, State

FREE, STATIC, DYNAMIC, UNKNOWN = (int(state) for state in State)


@njit(cache=True, nogil=True, error_model="numpy")
def renormalise(probability, claimed):
    """Set P(DYNAMIC) to the weight of a cell's particles; the other states share the rest in their old proportions.

    Parameters
    ----------
    probability : (4, H, W) float32
        The four states; P(DYNAMIC) is ignored.
    claimed : (H, W) float32
        Sum of the weights of the particles in each cell; it may exceed 1 where particles crowd.

    Returns
    -------
    probability : (4, H, W) float32
        The four states, with P(DYNAMIC) = min(claimed, 1). If no other state had any mass, the rest is UNKNOWN.
    factor : (H, W) float32
        Factor of the weights of the cell's particles.
    """
    shared = np.empty_like(probability)
    factor = np.empty_like(claimed)
    for r in range(claimed.shape[0]):
        for c in range(claimed.shape[1]):
            dynamic = min(claimed[r, c], np.float32(1))
            others = probability[FREE, r, c] + probability[STATIC, r, c] + probability[UNKNOWN, r, c]
            share = (1 - dynamic) / others if others > 0 else 0.0  # others: 1 - P(DYNAMIC), with more digits
            shared[FREE, r, c] = share * probability[FREE, r, c]
            shared[STATIC, r, c] = share * probability[STATIC, r, c]
            shared[DYNAMIC, r, c] = dynamic
            shared[UNKNOWN, r, c] = share * probability[UNKNOWN, r, c] if others > 0 else 1 - dynamic
            factor[r, c] = dynamic / claimed[r, c] if claimed[r, c] > 0 else 0.0
    return shared, factor


@njit(cache=True, nogil=True, error_model="numpy")
def mix(probability, newborn, going, M):
    """Mix the states of each cell by the transition matrix: P(j) = sum_i M[i, j] P(i).

    Parameters
    ----------
    probability : (4, H, W) float32
        The four states at the previous instant.
    newborn : (H, W) float32
        The part of P(DYNAMIC) that no particle carries.
    going : (H, W) float32
        Sum of the weights in each cell after the matrix and after some particles stopped; what stopped is STATIC.
    M : (4, 4) float
        Transition matrix, M[i, j] = P(state j now | state i before).

    Returns
    -------
    probability : (4, H, W) float32
        The four states now, with all particles still in their cells.
    newborn : (H, W) float32
        The part of P(DYNAMIC) that no particle carries, including what the other states turned into DYNAMIC.
    """
    mixed = np.empty_like(probability)
    born = np.empty_like(newborn)
    for j in range(4):  # outermost, so that the compiler vectorises over cells: four times as fast
        from_free, from_static, from_dynamic, from_unknown = M[:, j]
        for r in range(newborn.shape[0]):
            for c in range(newborn.shape[1]):
                others = from_free * probability[FREE, r, c] + from_static * probability[STATIC, r, c]
                dynamic = newborn[r, c] if j == DYNAMIC else probability[DYNAMIC, r, c]  # particles are added below
                mixed[j, r, c] = others + from_dynamic * dynamic + from_unknown * probability[UNKNOWN, r, c]
    for r in range(newborn.shape[0]):
        for c in range(newborn.shape[1]):
            # The matrix leaves this much of the particles' weight DYNAMIC. A part of it keeps moving; the rest has
            # stopped.
            carried = M[DYNAMIC, DYNAMIC] * (probability[DYNAMIC, r, c] - newborn[r, c])
            born[r, c] = mixed[DYNAMIC, r, c]
            mixed[DYNAMIC, r, c] += going[r, c]
            mixed[STATIC, r, c] += max(carried - going[r, c], 0.0)
    return mixed, born


@njit(cache=True, nogil=True, error_model="numpy")
def largest_nearby(wall):
    """Return the largest value of each cell and its eight neighbours, (H, W).

    Parameters
    ----------
    wall : (H, W) float32
        How much each cell is a wall, 0 to 1.
    """
    height, width = wall.shape
    across = wall.copy()
    for r in range(height):
        for c in range(1, width):
            across[r, c] = max(across[r, c], wall[r, c - 1])
            across[r, c - 1] = max(across[r, c - 1], wall[r, c])
    nearby = across.copy()
    for r in range(1, height):
        for c in range(width):
            nearby[r, c] = max(nearby[r, c], across[r - 1, c])
            nearby[r - 1, c] = max(nearby[r - 1, c], across[r, c])
    return nearby


@njit(cache=True, nogil=True, error_model="numpy")
def collide(mixed, newborn, going, stays, arrives, doubtful):
    """Combine the dynamic mass that arrives in a cell with the cell's states, and remove contradictions.

    Parameters
    ----------
    mixed : (4, H, W) float32
        The four states before particles flew, from `mix`.
    newborn : (H, W) float32
        The part of P(DYNAMIC) that no particle carries.
    going, stays, arrives : (H, W) float32
        Sums of weights in each cell: of the particles that were there before they flew, that are still there, and that
        have come in.
    doubtful : (H, W) float32
        The part of `arrives` that comes out of a wall and moves along it.

    Returns
    -------
    probability : (4, H, W) float32
        Let a = min(arrives, MAX_MOVE_PROBABILITY), b its doubtful part, s = P(STATIC), u = P(UNKNOWN) plus what has
        left, and d the mass that is newborn or stays. P(DYNAMIC) is [a (1 - s) - b u + (1 - a) d] / (1 - a s - b u),
        and every other state is (1 - a) P / (1 - a s - b u). What has left becomes FREE.
    newborn : (H, W) float32
        Scaled like everything else that was in the cell.
    factor : (2, H, W) float32
        Factors of the weights of the particles that stay, and of those that arrive.
    less : (2, H, W) float32
        By how much these factors are smaller for the doubtful part of a weight; 0 for particles that stay.
    """
    probability = np.empty_like(mixed)
    born = np.empty_like(newborn)
    factor = np.empty((2, *newborn.shape), np.float32)
    less = np.zeros((2, *newborn.shape), np.float32)
    for r in range(newborn.shape[0]):
        for c in range(newborn.shape[1]):
            static = mixed[STATIC, r, c]
            claim = min(arrives[r, c], MAX_MOVE_PROBABILITY)
            vacated = going[r, c] - stays[r, c]
            unseen = mixed[UNKNOWN, r, c] + vacated
            share = claim / arrives[r, c] if arrives[r, c] > 0 else 0.0
            struck = share * doubtful[r, c] * unseen
            consistent = 1 - claim * static - struck
            keep = (1 - claim) / consistent
            arrived = max(claim * (1 - static) - struck, 0.0) / consistent
            probability[FREE, r, c] = keep * (mixed[FREE, r, c] + vacated)
            probability[STATIC, r, c] = keep * static
            probability[DYNAMIC, r, c] = keep * (newborn[r, c] + stays[r, c]) + arrived
            probability[UNKNOWN, r, c] = keep * mixed[UNKNOWN, r, c]
            born[r, c] = keep * newborn[r, c]
            factor[0, r, c] = keep
            factor[1, r, c] = share * (1 - static) / consistent
            less[1, r, c] = share * unseen / consistent
    return probability, born, factor, less


@njit(cache=True, nogil=True, error_model="numpy")
def bayes(prior, occupied, free):
    """Multiply by the likelihoods and normalise: P(state | z) = P(z | state) P(state) / P(z).

    Parameters
    ----------
    prior : (4, H, W) float32
        The four states before the scan.
    occupied, free : (H, W) float
        P(z | occupied) and P(z | free), not negative; UNKNOWN is as likely as free.

    Returns
    -------
    posterior : (4, H, W) float32
        The four states given the scan. If no state with any mass explains the scan, the cell is UNKNOWN.
    factor : (H, W) float64
        P(DYNAMIC | z) / P(DYNAMIC), the factor of the weights of the cell's particles.
    """
    posterior = np.empty_like(prior)
    factor = np.empty(prior.shape[1:])
    for r in range(prior.shape[1]):
        for c in range(prior.shape[2]):
            best = max(occupied[r, c], free[r, c])  # scale so that the better explanation is 1, however small both are
            if_occupied = occupied[r, c] / best if best > 0 else 1.0  # two zeros are equal: nothing known
            if_free = free[r, c] / best if best > 0 else 1.0
            empty = np.float64(prior[FREE, r, c]) + prior[UNKNOWN, r, c]
            full = np.float64(prior[STATIC, r, c]) + prior[DYNAMIC, r, c]
            evidence = if_free * empty + if_occupied * full
            explained = evidence >= TINY
            if_free = if_free / evidence if explained else 0.0
            if_occupied = if_occupied / evidence if explained else 0.0
            posterior[FREE, r, c] = if_free * prior[FREE, r, c]
            posterior[STATIC, r, c] = if_occupied * prior[STATIC, r, c]
            posterior[DYNAMIC, r, c] = if_occupied * prior[DYNAMIC, r, c]
            posterior[UNKNOWN, r, c] = if_free * prior[UNKNOWN, r, c] if explained else 1.0
            factor[r, c] = if_occupied
    return posterior, factor


@njit(cache=True, nogil=True, error_model="numpy")
def clear_wakes(probability, left, hidden):
    """Remove STATIC where a moving thing has just been, in cells that the scan doesn't observe.

    Parameters
    ----------
    probability : (4, H, W) float32
        The four states given the scan.
    left : (H, W) float32
        Sum of the weights of the particles that have left each cell.
    hidden : (H, W) bool
        Whether the scan doesn't observe the cell.

    Returns
    -------
    (4, H, W) float32
        In hidden cells, with a = min(left, MAX_MOVE_PROBABILITY) and s = P(STATIC): STATIC is (1 - a) s / (1 - a s),
        and FREE gets what STATIC loses. All other cells are unchanged.
    """
    cleared = probability.copy()
    for r in range(left.shape[0]):
        for c in range(left.shape[1]):
            static = probability[STATIC, r, c]
            gone = min(left[r, c], MAX_MOVE_PROBABILITY) if hidden[r, c] else 0.0
            cleared[STATIC, r, c] = (1 - gone) * static / (1 - gone * static)
            cleared[FREE, r, c] += static - cleared[STATIC, r, c]
    return cleared


@njit(cache=True, nogil=True, error_model="numpy")
def rescale_weights(probability, carried):
    """Scale the weights in each cell to sum to P(DYNAMIC); where no particle is, this mass becomes UNKNOWN.

    Parameters
    ----------
    probability : (4, H, W) float32
        The four states.
    carried : (H, W) float32
        Sum of the weights of the particles in each cell.

    Returns
    -------
    probability : (4, H, W) float32
        The four states, with P(DYNAMIC) = 0 where no particle is.
    factor : (H, W) float64
        Factor of the weights of the cell's particles.
    """
    represented = probability.copy()
    factor = np.empty(carried.shape)
    for r in range(carried.shape[0]):
        for c in range(carried.shape[1]):
            dynamic = np.float64(probability[DYNAMIC, r, c])
            represented[DYNAMIC, r, c] = dynamic if carried[r, c] > 0 else 0.0
            represented[UNKNOWN, r, c] += 0.0 if carried[r, c] > 0 else dynamic
            factor[r, c] = dynamic / carried[r, c] if carried[r, c] > 0 else 0.0
    return represented, factor
