"""Where independent tasks run: in a few processes of this machine."""

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, get_context, parent_process

from semgrid_edu.errors import ArgumentError

DIED = (
    'a worker process died. Either memory ran out, or your script starts workers outside `if __name__ == "__main__":`'
)
"""The message when a worker dies: each worker imports the script that started it."""


def _end_with_parent() -> None:
    """End this worker when the process that started it is killed: an orphan would write beside the one that resumes.

    Ctrl-C, which a terminal sends to all of them, is left to that process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        parent_process().join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@dataclass(frozen=True)
class Workplace:
    """What runs tasks, and how many at a time.

    Parameters
    ----------
    executor : concurrent.futures.Executor
        Takes functions and their arguments, and gives futures.
    slots : int
        The number of tasks that can be under way at the same time.
    """

    executor: Executor
    slots: int


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_workers(workers: int) -> None:
    """Check that this machine has cores for a number of processes.

    Parameters
    ----------
    workers : int
        Number of processes; two can share one core.
    """
    cores = usable_cores()
    if not 1 <= workers <= max(2, cores):
        expected = f"at least one process and at most {max(2, cores)}: {cores} cores can be used here"
        raise ArgumentError("--workers", expected, workers)


@contextmanager
def workplace(workers: int | None = None) -> Iterator[Workplace]:
    """Open the place where tasks run. When the block raises an error, work that hasn't begun is dropped.

    The processes are spawned. Forked ones would inherit the locks of torch's and numba's threads, and hang.

    Parameters
    ----------
    workers : int, optional
        Number of processes; one per core when left out.

    Yields
    ------
    Workplace
        Its processes end with the block, or when this process is killed.

    Raises
    ------
    ArgumentError
        When there are no workers or too many.
    ChildProcessError
        When a process ends before its work does.
    """
    number = usable_cores() if workers is None else workers
    check_workers(number)
    with ProcessPoolExecutor(number, mp_context=get_context("spawn"), initializer=_end_with_parent) as pool:
        try:
            yield Workplace(pool, number)
        except BrokenExecutor as error:
            raise ChildProcessError(DIED) from error
        except BaseException as error:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in active_children() if isinstance(error, KeyboardInterrupt) else ():
                worker.terminate()  # it may have an hour of work before it
            raise
