"""What CMCDOT and the BOF do in each cell by itself: mix, strike out, Bayes' rule (paper, section 3.2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.state import State

FREE, STATIC, DYNAMIC, UNKNOWN = State

CERTAIN = 1 - 1e-3
"""The largest probability with which something arrives in a cell or has left it: below 1, so a scan can contradict."""


def ratio(part: NDArray, whole: NDArray) -> NDArray[np.floating]:
    """Return part / whole cell by cell, and 0 where the divisor is 0.

    Parameters
    ----------
    part, whole : (..., H, W) float
        Dividend and divisor, not negative.
    """
    out = np.zeros(np.broadcast_shapes(np.shape(part), np.shape(whole)), np.result_type(part, whole))
    return np.divide(part, whole, out=out, where=whole > 0)


def mix(
    probability: NDArray, newborn: NDArray, going: NDArray, M: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mix the states of each cell by the transition matrix: P(j) = sum_i M[i, j] P(i).

    Parameters
    ----------
    probability : (4, H, W) float
        The four states at the previous instant.
    newborn : (H, W) float
        The part of P(DYNAMIC) that has no particles.
    going : (H, W) float
        Sum of the weights in each cell, after the matrix and after some particles have stopped. What stopped is STATIC.
    M : (4, 4) float
        Transition matrix, M[i, j] = P(state j now | state i before).

    Returns
    -------
    probability : (4, H, W) float64
        The four states now, with all particles still in their cells.
    newborn : (H, W) float64
        The part of P(DYNAMIC) that has no particles: what other states have become DYNAMIC is included.
    """
    mixed = np.einsum("ij,ihw->jhw", M, probability)
    carried = M[DYNAMIC, DYNAMIC] * (probability[DYNAMIC] - newborn)
    mixed[STATIC] += np.maximum(carried - going, 0)
    without_particles = np.stack([probability[FREE], probability[STATIC], newborn, probability[UNKNOWN]])
    born = np.einsum("i,ihw->hw", M[:, DYNAMIC], without_particles)
    mixed[DYNAMIC] = born + going
    return mixed, born


def strike_out(arrives: NDArray, possible: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Strike out the arrivals that can't be true, and scale the rest to 1.

    Something arrives in a cell with probability a. Of the joint distribution of "it arrives" and what the cell holds,
    the impossible part i is struck out, such as an arrival in a cell that is STATIC: i = a P(STATIC). The
    rest, 1 - i, is scaled to 1: nothing arrives, 1 - a, and the cell keeps what it held; or the arrival is possible.

    Parameters
    ----------
    arrives : (H, W) float
        Dynamic mass that arrives in the cell. It may exceed 1 where particles crowd; then a is `CERTAIN`.
    possible : (H, W) float
        The part of it that can be true.

    Returns
    -------
    keep : (H, W) float64
        Factor of everything that the cell held, (1 - a) / (1 - i).
    take : (H, W) float64
        Factor of the possible arrivals, (a / arrives) / (1 - i).
    """
    a = np.minimum(arrives, CERTAIN)
    share = ratio(a, arrives)
    consistent = 1 - (a - share * possible)
    return (1 - a) / consistent, share / consistent


def bayes(prior: NDArray, evidence: Evidence) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Multiply by the likelihoods and normalise: P(state | z) = P(z | state) P(state) / P(z).

    STATIC and DYNAMIC share P(z | occupied), FREE and UNKNOWN share P(z | free).

    Parameters
    ----------
    prior : (4, H, W) float
        The four states before the scan.
    evidence : Evidence
        The likelihoods of the scan, (H, W).

    Returns
    -------
    posterior : (4, H, W) float64
        The four states given the scan. Where no state that was held possible explains the scan, all is UNKNOWN.
    factor : (H, W) float64
        P(DYNAMIC | z) / P(DYNAMIC), the factor of the weights of the cell's particles.
    """
    # Only the ratio of the likelihoods counts. The larger becomes 1, because products of tiny numbers would vanish.
    best = np.maximum(evidence.occupied, evidence.free).astype(np.float64)
    occupied = ratio(evidence.occupied, best)
    free = ratio(evidence.free, best)
    joint = np.stack([free, occupied, occupied, free]) * prior
    p_z = joint.sum(axis=0)
    posterior = ratio(joint, p_z)
    posterior[UNKNOWN] += p_z == 0
    return posterior, ratio(occupied, p_z)
