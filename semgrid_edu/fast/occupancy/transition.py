"""The transition matrix without BLAS, whose threads would get in the way of the filter's second one."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, not_negative
from semgrid_edu.occupancy.world import WorldModel


def transition_matrix(world: WorldModel, dt: float) -> NDArray[np.float64]:
    """Return the transition matrix of a time step, M = exp(R dt), by uniformisation.

    With r the largest rate at which a state is left, A = (R + r I) dt has no negative entry, and exp(R dt) is the sum
    of A^k / k! with its rows scaled to 1. The sum is taken over a small part of the time step, which is then doubled.
    `scipy.linalg.expm` wakes the threads of its BLAS, which keep spinning on the core that processes the scan: a step
    took 28 ms with it instead of 18. Parameters and result are those of `transition_matrix`.
    """
    if not not_negative(dt):
        raise ArgumentError("dt", "seconds, not negative", dt)
    R = np.array(world.rates, dtype=np.float64)
    np.fill_diagonal(R, 0)
    leaving = R.sum(axis=1)
    np.fill_diagonal(R, leaving.max() - leaving)
    doublings = max(0, np.frexp(leaving.max())[1] + np.frexp(dt)[1] + 1)
    A = R * np.ldexp(dt, -doublings)
    M = np.eye(4)
    for k in range(14, 0, -1):
        M = np.eye(4) + A @ M / k
    M /= M.sum(axis=1, keepdims=True)
    for _ in range(doublings):
        M = M @ M
        M /= M.sum(axis=1, keepdims=True)
    return M
