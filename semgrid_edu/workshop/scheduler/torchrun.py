"""A training run in several processes, which torchrun starts; each takes its share of every batch (section 4.1)."""

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numba
import torch

from semgrid_edu.workshop.scheduler.runs import Run

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


STARTER = (sys.executable, "-m", "torch.distributed.run", "--standalone")
"""The command that starts processes; `torchrun` is its short name."""


def work_together(run: Run, root: Path, device: str, processes: int) -> None:
    """Do a run's work in several processes of this machine. They print where this one prints.

    Parameters
    ----------
    run : Run
        A training run: its work goes through `open_fabric`.
    root : Path
        The folder of all runs.
    device : str
        The device of the training run, see `choose_device`: "cuda" gives each process a GPU of its own.
    processes : int
        How many processes there are.

    Raises
    ------
    RuntimeError
        When a process fails. It has printed why.
    """
    # The run goes to this process's own children, as multiprocessing would hand it over; no pickle is read from a file.
    task = ["-m", "semgrid_edu.workshop.scheduler.torchrun", pickle.dumps(run).hex(), str(root), device]
    command = [*STARTER, "--nproc-per-node", str(processes), *task]
    # The processes read a pipe into which nothing is written: it ends when this process does, and they with it.
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=sys.stdout, stderr=sys.stderr) as starter:
        status = starter.wait()
    if status:
        raise RuntimeError(f"torchrun's processes ended with status {status}")


def _end_with_starter() -> None:
    """End this process when the pipe ends, because an orphan would write beside the process that resumes the run."""
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


def main() -> None:
    """Do this process's share of the run that `work_together` hands over on the command line."""
    threading.Thread(target=_end_with_starter, daemon=True).start()
    run, root, device = sys.argv[1:]
    with few_threads():
        pickle.loads(bytes.fromhex(run)).work(Path(root), device)


if __name__ == "__main__":
    main()
