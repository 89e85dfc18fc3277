"""What becomes of each cell by itself in the filter's steps: a rule is a loop over cells (paper, section 3.2)."""

import numpy as np
from numba import njit

from semgrid_edu.occupancy.state import State

FREE, STATIC, DYNAMIC, UNKNOWN = (int(state) for state in State)
CERTAIN = 1 - 1e-3
"""The most that arriving particles may claim of a cell: who is never quite certain can be contradicted."""


@njit(cache=True)
def make_room(probability, claimed):
    """Let its particles decide how much of a cell is dynamic; the other states share the rest as before.

    Parameters
    ----------
    probability : (4, H, W) float32
        The four states; what is DYNAMIC here is ignored.
    claimed : (H, W) float32
        Sum of the weights in each cell; above 1 where particles crowd.

    Returns
    -------
    probability : (4, H, W) float32
        With P(DYNAMIC) = min(claimed, 1). Where nothing else was possible, the rest is UNKNOWN.
    factor : (H, W) float32
        By which the weights change.
    """
    shared, factor = np.empty_like(probability), np.zeros_like(claimed)
    for r, c in np.ndindex(claimed.shape):
        free, static, _, unknown = probability[:, r, c]
        dynamic, others = min(claimed[r, c], 1), free + static + unknown  # 1 - P(DYNAMIC) may have no digits left
        share = (1 - dynamic) / others if others > 0 else 0.0
        shared[FREE, r, c] = share * free
        shared[STATIC, r, c] = share * static
        shared[DYNAMIC, r, c] = dynamic
        shared[UNKNOWN, r, c] = share * unknown if others > 0 else 1 - dynamic
        if dynamic > 0:
            factor[r, c] = dynamic / claimed[r, c]
    return shared, factor


@njit(cache=True)
def mix(probability, newborn, going, M):
    """Mix the states of each cell by the transition matrix: P(j) = sum_i M[i, j] P(i).

    Parameters
    ----------
    probability : (4, H, W) float32
        The four states at the previous instant.
    newborn : (H, W) float32
        The part of P(DYNAMIC) that no particle carries.
    going : (H, W) float32
        Sum of the weights after the matrix and after some have stopped: what stopped is STATIC.
    M : (4, 4) float
        M[i, j] = P(state j now | state i before).

    Returns
    -------
    probability : (4, H, W) float32
        Now, with all particles still in their cells.
    newborn : (H, W) float32
        Grown by what became DYNAMIC of the other states.
    """
    mixed, born = np.empty_like(probability), np.empty_like(newborn)
    for r, c in np.ndindex(newborn.shape):
        free, static, dynamic, unknown = probability[:, r, c]
        for j in range(4):
            others = M[FREE, j] * free + M[STATIC, j] * static + M[UNKNOWN, j] * unknown
            mixed[j, r, c] = others + M[DYNAMIC, j] * dynamic
            if j == DYNAMIC:
                born[r, c] = others + M[DYNAMIC, j] * newborn[r, c]
        stopped = max(mixed[DYNAMIC, r, c] - born[r, c] - going[r, c], 0)
        mixed[STATIC, r, c] += stopped
        mixed[DYNAMIC, r, c] = born[r, c] + going[r, c]
    return mixed, born


@njit(cache=True)
def meet(mixed, newborn, going, stays, arrives):
    """Let the dynamic mass that arrives in a cell meet what the cell holds: what can't both be is struck out.

    Parameters
    ----------
    mixed : (4, H, W) float32
        The four states before particles flew, from `mix`.
    newborn : (H, W) float32
        The part of P(DYNAMIC) that no particle carries.
    going, stays, arrives : (H, W) float32
        Sum of the weights in each cell before they flew; of those that are still there; of those that came in.

    Returns
    -------
    probability : (4, H, W) float32
        With a = min(arrives, CERTAIN) and s = P(STATIC): P(DYNAMIC) = [a (1 - s) + (1 - a) d] / (1 - a s) and, of
        the others, (1 - a) P / (1 - a s), where d is what is newborn or stays. What left is FREE.
    newborn : (H, W) float32
        Scaled like everything that was in the cell.
    factor : (2, H, W) float32
        By which the weights of particles change that stay, and that arrive.
    """
    probability, born, factor = np.empty_like(mixed), np.empty_like(newborn), np.zeros((2, *newborn.shape), np.float32)
    for r, c in np.ndindex(newborn.shape):
        free, static, _, unknown = mixed[:, r, c]
        claim = min(arrives[r, c], CERTAIN)
        consistent = 1 - claim * static
        own, arrived = (1 - claim) / consistent, claim * (1 - static) / consistent
        probability[FREE, r, c] = own * (free + going[r, c] - stays[r, c])
        probability[STATIC, r, c] = own * static
        probability[DYNAMIC, r, c] = own * (newborn[r, c] + stays[r, c]) + arrived
        probability[UNKNOWN, r, c] = own * unknown
        born[r, c] = own * newborn[r, c]
        factor[0, r, c] = own
        if arrives[r, c] > 0:
            factor[1, r, c] = arrived / arrives[r, c]
    return probability, born, factor


@njit(cache=True)
def bayes(prior, occupied, free):
    """Multiply by the likelihoods and normalise: P(state | z) = P(z | state) P(state) / P(z).

    Parameters
    ----------
    prior : (4, H, W) float32
        The four states.
    occupied, free : (H, W) float
        P(z | occupied) and P(z | free), not negative; UNKNOWN is as likely as free.

    Returns
    -------
    posterior : (4, H, W) float32
        Where nothing that was held possible explains the scan, UNKNOWN.
    factor : (H, W) float32
        P(DYNAMIC | z) / P(DYNAMIC): by which the weights change.
    """
    posterior, factor = np.zeros_like(prior), np.zeros_like(prior[0])
    for r, c in np.ndindex(factor.shape):
        best = max(occupied[r, c], free[r, c])  # however small both are, the better explanation counts as 1
        if_occupied, if_free = (occupied[r, c] / best, free[r, c] / best) if best > 0 else (0.0, 0.0)
        is_free, static, dynamic, unknown = prior[:, r, c]
        evidence = if_free * (is_free + unknown) + if_occupied * (static + dynamic)
        if evidence > 0:
            posterior[FREE, r, c] = if_free * is_free / evidence
            posterior[STATIC, r, c] = if_occupied * static / evidence
            posterior[DYNAMIC, r, c] = if_occupied * dynamic / evidence
            posterior[UNKNOWN, r, c] = if_free * unknown / evidence
            factor[r, c] = if_occupied / evidence
        else:
            posterior[UNKNOWN, r, c] = 1
    return posterior, factor


@njit(cache=True)
def represent(probability, carried):
    """Make particles carry each cell's dynamic probability; without particles it turns UNKNOWN.

    Parameters
    ----------
    probability : (4, H, W) float32
        The four states.
    carried : (H, W) float32
        Sum of the weights in each cell.

    Returns
    -------
    probability : (4, H, W) float32
        DYNAMIC only where particles are.
    factor : (H, W) float32
        By which the weights change.
    """
    represented, factor = probability.copy(), np.zeros_like(carried)
    for r, c in np.ndindex(carried.shape):
        if carried[r, c] > 0:
            factor[r, c] = probability[DYNAMIC, r, c] / carried[r, c]
        else:
            represented[UNKNOWN, r, c] += probability[DYNAMIC, r, c]
            represented[DYNAMIC, r, c] = 0
    return represented, factor
