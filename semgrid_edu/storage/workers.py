"""Worker processes that share the work on the drives of a data set and leave nothing behind (section 4)."""

import os
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process


@contextmanager
def worker_pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of processes; what waits in it is dropped when the block raises.

    The processes are spawned: forked ones would inherit the threads' locks of torch and numba, and hang.

    Parameters
    ----------
    workers : int
        How many processes.

    Yields
    ------
    concurrent.futures.ProcessPoolExecutor
        Its processes end with the block, and with this process when that is killed.
    """
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_end_with_parent) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _end_with_parent() -> None:
    """End this worker when the process that started it is killed: an orphan would write beside the one that resumes."""

    def watch() -> None:
        parent_process().join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
