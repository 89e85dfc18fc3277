"""Ways to do the same, timed in turn, so that a busy machine slows all of them."""

import time
from collections.abc import Callable

import numpy as np


def best_times(functions: list[Callable[[], object]], rounds: int) -> list[float]:
    """Call the functions in turn; return each one's shortest time, in milliseconds."""
    times = np.empty((rounds, len(functions)))
    for row in times:
        for i, function in enumerate(functions):
            start = time.perf_counter()
            function()
            row[i] = 1e3 * (time.perf_counter() - start)
    return list(times.min(axis=0))
