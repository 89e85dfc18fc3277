"""What `Cmcdot.step` asks of the machine: a second core, an undo after errors, memory that stays.

Nothing here changes a number.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np


@contextmanager
def on_another_core(function: Callable, *arguments: object) -> Iterator[Future]:
    """Run a function in a thread while the body of `with` runs, and hand out its future result.

    Evidence doesn't depend on what `move` and `predict` do, and takes about as long. Both spend their time in compiled
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

    `predict` has drawn random numbers by the time a sensor or a resampling is refused. If these were lost, the same
    seed would give another drive after an error that was caught.

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

    On Linux, glibc hands idle memory back to the system as soon as it is more than twice the largest buffer that was
    ever freed, and what a step frees often is. The system clears each page before it lends it again: up to 5 ms a step.
    In a process that once freed a buffer of 25 MB, such as an image network's, up to 50 MB stay. So this function frees
    a buffer of that size.
    """
    np.empty(3 * 2**23, np.uint8)
