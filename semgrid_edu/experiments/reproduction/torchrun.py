"""A training run in several processes, which torchrun starts, each with its share of every batch (section 4.1)."""

import os
import pickle
import subprocess
import sys
import threading
from pathlib import Path

from semgrid_edu.experiments.reproduction.runs import Run
from semgrid_edu.experiments.reproduction.threads import few_threads

STARTER = (sys.executable, "-m", "torch.distributed.run", "--standalone")
"""The command that starts processes; `torchrun` is its short name."""


def work_together(run: Run, root: Path, device: str, processes: int) -> None:
    """Do a run's work in several processes of this machine. They print where this one prints.

    Parameters
    ----------
    run : Run
        A training run: its work goes through `process_group`.
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
    task = ["-m", "semgrid_edu.experiments.reproduction.torchrun", pickle.dumps(run).hex(), str(root), device]
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
