"""What `Cmcdot.step` needs from the machine: a second core, an undo after errors, and kept memory.

Nothing here changes a result.
"""

import ctypes
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
"""Options of glibc's `mallopt`, as numbered in malloc.h."""


@contextmanager
def on_another_core(function: Callable, *arguments: object) -> Iterator[Future]:
    """Run a function in a thread while the body of `with` runs, and yield its future.

    Evidence doesn't depend on `move` and `predict`, and takes about as long. Both spend their time in compiled
    loops, which release Python's lock, so a thread is enough to use two cores.

    Parameters
    ----------
    function, arguments : callable, objects
        The function and its arguments.
    """
    with ThreadPoolExecutor(1) as thread:
        yield thread.submit(function, *arguments)


@contextmanager
def undo_after_errors(rng: np.random.Generator) -> Iterator[None]:
    """Restore the generator's state if the body of `with` fails.

    When a sensor or a resampling fails, `predict` has already drawn random numbers. Without the undo, a drive that goes
    on after a caught error would differ from one without the error.

    Parameters
    ----------
    rng : numpy.random.Generator
        The generator that the body draws from.
    """
    before = rng.bit_generator.state
    try:
        yield
    except BaseException:
        rng.bit_generator.state = before
        raise


def keep_memory() -> None:
    """Reuse the memory of one step in the next.

    On Linux, glibc returns idle memory to the system when it exceeds `M_TRIM_THRESHOLD`, and a buffer above
    `M_MMAP_THRESHOLD` as soon as it is freed. The system clears each page before it hands it out again, which takes up
    to 5 ms a step. Larger thresholds keep what a step frees. By itself glibc raises them only after a large buffer was
    freed, and never if the environment sets one of them. Other allocators are left alone.
    """
    if mallopt := getattr(ctypes.CDLL(None) if sys.platform == "linux" else None, "mallopt", None):
        mallopt(M_MMAP_THRESHOLD, 2**25)
        mallopt(M_TRIM_THRESHOLD, 2**26)
