"""How many threads a run computes with."""

from collections.abc import Iterator
from contextlib import contextmanager

import numba
import torch

THREADS = 1
"""Threads of a run. It is fixed because the order of sums depends on it: the same run gives the same bytes everywhere.
Runs are independent of each other, so two processes of one thread keep two cores busier than one process of two."""


@contextmanager
def few_threads() -> Iterator[None]:
    """Compute with `THREADS` threads inside the block, and with as many as before after it."""
    before = torch.get_num_threads(), numba.get_num_threads()
    torch.set_num_threads(THREADS)
    numba.set_num_threads(THREADS)
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        numba.set_num_threads(before[1])
