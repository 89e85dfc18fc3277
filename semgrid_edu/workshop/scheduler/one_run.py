"""Doing one run: its folder claimed, what it prints kept, its end recorded (section 4)."""

import contextlib
import threading
import time
import traceback
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import commit, versions
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.scheduler.runs import CLAIM, ENDED, OUTPUT, Run
from semgrid_edu.workshop.scheduler.torchrun import THREADS, few_threads, work_together

_ONE_AT_A_TIME = threading.Lock()
"""Threads and printed output belong to a process, so it takes one run at a time, however many a cluster gives it."""


class Outcome(NamedTuple):
    """How a run ended.

    Parameters
    ----------
    seconds : float
        How long it took this time.
    error : str or None
        The traceback of what went wrong; None when all went well. It is text, so that it passes between processes.
    """

    seconds: float
    error: str | None


def run_one(run: Run, root: str | Path, device: str = "cpu", processes: int = 1) -> Outcome:
    """Do one run; this is what every process and every machine of a cluster is asked to do.

    Parameters
    ----------
    run : Run
        The run; those that it needs have ended.
    root : path-like
        The folder of all runs, the same for all machines.
    device : str
        The device of a training run, see `choose_device`.
    processes : int
        In how many processes a training run is done, see `work_together`; other runs take one.

    Returns
    -------
    Outcome
        An error is returned, not raised, and stands in the run's `output.txt` too.
    """
    began, processes = time.perf_counter(), processes if run.is_training else 1
    if run.has_ended(root):
        return Outcome(0.0, None)
    with _ONE_AT_A_TIME, few_threads():
        try:
            claim_folder(run, root)
            with _printing_to(run.folder(root) / OUTPUT):
                if processes > 1:
                    work_together(run, Path(root), device, processes)
                else:
                    run.work(Path(root), device)
            _record_end(run, root, device, processes, time.perf_counter() - began)
        except Exception:
            return Outcome(time.perf_counter() - began, traceback.format_exc())
    return Outcome(time.perf_counter() - began, None)


def claim_folder(run: Run, root: str | Path) -> None:
    """Mark a folder as that of a run, or refuse it when another run has it.

    Parameters
    ----------
    run : Run
        The run that is about to start or to go on.
    root : path-like
        The folder of all runs.

    Raises
    ------
    DataError
        When the folder was made by a run with other settings.
    """
    path, settings = run.folder(root) / CLAIM, run.settings()
    if not path.exists():
        write_json(path, settings)
        return
    found = read_json(path)
    if found != settings:
        differing = sorted(name for name in settings | found if settings.get(name) != found.get(name))
        theirs, ours = ({name: one.get(name) for name in differing} for one in (found, settings))
        raise DataError(path, f"the run {ours}", f"{theirs}: choose another folder for the runs, or remove this one")


def _record_end(run: Run, root: str | Path, device: str, processes: int, seconds: float) -> None:
    """Write the last file of a run, which says that all others are there."""
    record = {
        "seconds": round(seconds, 2),
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "device": device,
        "threads": THREADS,
        "commit": commit(),
        "versions": versions("numpy", "torch", "numba"),
        **({"processes": processes} if processes > 1 else {}),
    }
    write_json(run.folder(root) / ENDED, record)


@contextlib.contextmanager
def _printing_to(path: Path):
    """Send what the block prints, progress bars too, to the end of a file: the runs beside it have their own."""
    with path.open("a", encoding="utf-8") as file, contextlib.redirect_stdout(file), contextlib.redirect_stderr(file):
        try:
            yield
        except Exception:
            file.write(traceback.format_exc())
            raise


def check_runs_folder(root: str | Path) -> Path:
    """Return the folder of all runs as an absolute path, under which every machine finds it; it is made when missing.

    Parameters
    ----------
    root : path-like
        The folder.

    Raises
    ------
    ArgumentError
        When a file is in its place.
    """
    root = Path(root).resolve()
    if root.exists() and not root.is_dir():
        raise ArgumentError("--runs", "a folder", f"the file {root}")
    root.mkdir(parents=True, exist_ok=True)
    return root
