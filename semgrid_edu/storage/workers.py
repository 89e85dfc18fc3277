"""Worker processes that share the work on the drives of a data set, and end with the process that started them."""

import os
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import current_process, get_context, parent_process


@contextmanager
def worker_pool(workers: int) -> Iterator[Executor]:
    """Yield a pool of processes. When the block raises, work that hasn't begun is dropped.

    The processes are spawned. Forked ones would inherit the locks of torch's and numba's threads, and hang. A worker of
    a dask.distributed cluster may start no processes of its own; there one thread does all the work.

    Parameters
    ----------
    workers : int
        Number of processes.

    Yields
    ------
    concurrent.futures.Executor
        Its processes end with the block, or when this process is killed.
    """
    if current_process().daemon:
        with ThreadPoolExecutor(1) as pool:
            yield pool
        return
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
