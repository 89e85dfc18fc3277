"""What approximate inference returns: marginals, and how far they can be trusted."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

TOLERANCE = 1e-10
"""Iterations have converged when none of their probabilities changes by more than this."""


@dataclass(frozen=True, eq=False)
class Beliefs:
    """Marginals of all variables that weren't given.

    Parameters
    ----------
    marginals : dict of str to (K,) float64
        A probability for each state, summing to 1.
    converged : bool
        Whether the last iteration changed nothing by more than `TOLERANCE`.
    iterations : int
        How many were run.
    exact : bool
        Whether the marginals are known to be exact: they have converged, and the factors leave no loop
        (sum-product) or no coupling at all (mean field).
    messages : dict of (str, str) to (K,) float64
        Sum-product's messages by (source, target), normalised; empty from mean field.
    free_energy : (iterations,) float64
        Mean field's, in nats, after each sweep; empty from sum-product.
    """

    marginals: Mapping[str, NDArray[np.float64]]
    converged: bool
    iterations: int
    exact: bool
    messages: Mapping[tuple[str, str], NDArray[np.float64]] = field(default_factory=dict)
    free_energy: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
