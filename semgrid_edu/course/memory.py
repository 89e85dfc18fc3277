"""How much memory a function needs."""

import tracemalloc
from collections.abc import Callable
from typing import Any


def peak_megabytes(function: Callable, *arguments: Any) -> tuple[Any, float]:
    """Call a function, and measure how much memory it holds at its worst moment.

    Parameters
    ----------
    function : callable
        The function. When it works in another process, as a student's answer does while it is graded, it has a method
        `peak_megabytes` that measures there.
    *arguments
        What it is called with.

    Returns
    -------
    result
        What the function returns.
    megabytes : float
        The most that Python's own allocators, numpy's among them, held in 10^6 bytes beyond what they held before.
    """
    if hasattr(function, "peak_megabytes"):
        return function.peak_megabytes(*arguments)
    tracemalloc.start()
    try:
        return function(*arguments), tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()
