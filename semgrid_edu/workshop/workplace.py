"""Where independent tasks run: in processes of this machine, or on a dask.distributed cluster."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, current_process, get_context, parent_process

from semgrid_edu.errors import ArgumentError


@contextmanager
def worker_pool(workers: int) -> Iterator[Executor]:
    """Yield a pool of processes. When the block raises an error, work that hasn't begun is dropped.

    The processes are spawned. Forked ones would inherit the locks of torch's and numba's threads, and hang. A worker of
    a dask.distributed cluster must not start processes; there one thread does all the work.

    Parameters
    ----------
    workers : int
        Number of processes.

    Yields
    ------
    concurrent.futures.Executor
        Its processes end with the block, or when this process is killed.

    Raises
    ------
    ChildProcessError
        When a process ends before its work does.
    """
    if current_process().daemon:
        with ThreadPoolExecutor(1) as pool:
            yield pool
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_end_with_parent) as pool:
        try:
            yield pool
        except BrokenExecutor as error:
            raise ChildProcessError(DIED) from error
        except BaseException as error:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in active_children() if isinstance(error, KeyboardInterrupt) else ():
                worker.terminate()  # it may have an hour of work before it
            raise


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
    slots : callable
        () -> the number of tasks that can be under way at the same time; a cluster may grow and shrink.
    """

    executor: Executor
    slots: Callable[[], int]


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
def workplace(workers: int | None = None, scheduler: str | None = None) -> Iterator[Workplace]:
    """Open the place where tasks run.

    Parameters
    ----------
    workers : int, optional
        Number of processes on this machine; one per core when left out.
    scheduler : str, optional
        Address of a dask.distributed scheduler, such as "tcp://10.0.0.1:8786", whose workers are used instead. They
        must see the same folders, under the same names, and have the same version of this package. When one of them
        dies, the scheduler gives its tasks to another one.

    Yields
    ------
    Workplace

    Raises
    ------
    ArgumentError
        When there are no workers or too many, both are given, or dask.distributed isn't installed.
    OSError
        When the scheduler doesn't answer.
    """
    if workers is not None:
        check_workers(workers)
    if workers is not None and scheduler:
        raise ArgumentError("--workers", "nothing beside --scheduler, which has workers of its own", workers)
    if scheduler:
        with _cluster(scheduler) as place:
            yield place
        return
    number = workers or usable_cores()
    with worker_pool(number) as pool:
        yield Workplace(pool, lambda: number)


@contextmanager
def _cluster(address: str) -> Iterator[Workplace]:
    """Connect to a cluster."""
    try:
        from distributed import Client
    except ImportError:
        missing = "dask.distributed (pip install 'semgrid_edu[cluster]')"
        raise ArgumentError("--scheduler", missing, "no module named distributed") from None
    try:
        connected = Client(address, set_as_default=False)
    except ValueError as error:
        raise ArgumentError("--scheduler", "an address like tcp://HOST:PORT", f"{address}: {error}") from error
    with connected as client, client.get_executor(pure=False) as executor:
        yield Workplace(executor, lambda: max(1, sum(client.nthreads().values())))
