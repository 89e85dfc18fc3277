"""Keep freed memory in the process, so that the system doesn't clear the pages of every large buffer again."""

import ctypes
import sys

M_TRIM_THRESHOLD = -1
M_TOP_PAD = -2
M_MMAP_THRESHOLD = -3
M_MMAP_MAX = -4
"""Options of `mallopt`, as numbered in glibc's malloc.h."""


def keep_freed_memory() -> None:
    """Let this process keep the memory that it frees, for the next buffer of that size.

    On Linux, glibc returns freed buffers above 32 MB to the system at once, and the system clears every page of the
    next such buffer when it is touched. The twenty planes of a batch are larger than that. On the paper's grid,
    sampling them took 30 ms with glibc's defaults and 12 ms with kept memory. The price is that the process never
    shrinks below its peak. Without Linux and glibc this function does nothing.
    """
    _set_options({M_MMAP_MAX: 0, M_TRIM_THRESHOLD: 2**31 - 1, M_TOP_PAD: 2**26})


def keep_step_memory() -> None:
    """Reuse the memory of one step of the filter in the next.

    On Linux, glibc returns idle memory to the system when it exceeds `M_TRIM_THRESHOLD`, and a buffer above
    `M_MMAP_THRESHOLD` as soon as it is freed. The system clears each page before it hands it out again, which takes up
    to 5 ms a step. Larger thresholds keep what a step frees. By itself glibc raises them only after a large buffer was
    freed, and never if the environment sets one of them.
    """
    _set_options({M_MMAP_THRESHOLD: 2**25, M_TRIM_THRESHOLD: 2**26})


def _set_options(options: dict[int, int]) -> None:
    """Set options of glibc's allocator; leave others alone."""
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "mallopt"):
        for option, value in options.items():
            libc.mallopt(option, value)
