"""What `Cmcdot.step` needs from the machine: a second core, an undo after errors, memory that is kept.

Nothing here changes a number.
"""

import ctypes
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
"""Numbers of glibc's `mallopt`, from malloc.h."""


@contextmanager
def on_another_core(function: Callable, *arguments: object) -> Iterator[Future]:
    """Run a function in a thread while the body of `with` runs, and hand out its future result.

    Evidence doesn't depend on `move` and `predict`, and takes about as long. Both spend their time in compiled
    loops, which release Python's lock, so a thread is enough to use two cores.

    Parameters
    ----------
    function, arguments : callable, objects
        What to call, and with what.
    """
    with ThreadPoolExecutor(1) as thread:
        yield thread.submit(function, *arguments)


@contextmanager
def undo_after_errors(rng: np.random.Generator) -> Iterator[None]:
    """Put the generator back when the body of `with` fails.

    `predict` has drawn random numbers by the time a sensor or a resampling fails. If these were lost, the same seed
    would give another drive after an error that was caught.

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
    """Let the memory of one step serve the next.

    On Linux, glibc hands idle memory back to the system as soon as it is more than `M_TRIM_THRESHOLD`, and a buffer
    larger than `M_MMAP_THRESHOLD` as soon as it is freed. The system clears each page before it lends it again: up to
    5 ms a step. Larger thresholds keep what a step frees. By itself glibc raises them only after a large buffer was
    freed, and never where the environment sets one of them. Other allocators are left as they are.
    """
    if mallopt := getattr(ctypes.CDLL(None) if sys.platform == "linux" else None, "mallopt", None):
        mallopt(M_MMAP_THRESHOLD, 2**25)
        mallopt(M_TRIM_THRESHOLD, 2**26)
