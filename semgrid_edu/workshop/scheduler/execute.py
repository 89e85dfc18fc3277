"""Carry out a plan, each run as soon as what it needs has ended, several at a time, or one run (section 4)."""

import contextlib
import threading
import time
import traceback
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from datetime import UTC, datetime
from pathlib import Path

from tqdm.auto import tqdm

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import commit, versions
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.scheduler.plan import left_to_do
from semgrid_edu.workshop.scheduler.runs import CLAIM, ENDED, OUTPUT, Run
from semgrid_edu.workshop.scheduler.torchrun import THREADS, few_threads, work_together
from semgrid_edu.workshop.workplace import Workplace

_ONE_AT_A_TIME = threading.Lock()
"""Threads and printed output belong to a process, so it takes one run at a time, however many a cluster gives it."""


def execute_plan(
    runs: Sequence[Run], root: str | Path, place: Workplace, device: str = "cpu", processes: int = 1
) -> dict[Run, str]:
    """Do all runs that are left to do.

    A run that fails stops only those that need it. The command can be killed at any time: what has ended stays, and a
    training run goes on from its checkpoint when the same command is given again.

    Parameters
    ----------
    runs : sequence of Run
        A plan: each run after those that it needs.
    root : path-like
        The folder of all runs.
    place : Workplace
        What does the work.
    device : str
        The device of the training runs, see `choose_device`.
    processes : int
        In how many processes each training run is done, see `work_together`.

    Returns
    -------
    dict of Run to str
        What went wrong, by run: the traceback, or the name of the run that would have been needed.
    """
    failed: dict[Run, str] = {}
    waiting = left_to_do(runs, root)
    under_way: dict[Future, Run] = {}
    with tqdm(total=len(runs), initial=len(runs) - len(waiting), desc="runs", unit="run") as bar:
        while waiting or under_way:
            for run in _ready(waiting, under_way, failed, place.slots() - len(under_way)):
                waiting.remove(run)
                under_way[_begin(place, run, str(root), device, processes)] = run
            bar.set_postfix_str(", ".join(run.name for run in under_way.values()))
            ended, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in ended:
                run = under_way.pop(future)
                if error := _error(future):
                    failed[run] = error
                    tqdm.write(f"{run.name} failed: {error.strip().splitlines()[-1]}")
                bar.update()
            for run in _hopeless(waiting, failed):
                waiting.remove(run)
                bar.update()
    return failed


def _begin(place: Workplace, *arguments: object) -> Future:
    """Hand a run to the workplace, with what `run_one` takes; the future says so when the workplace has broken down."""
    try:
        return place.executor.submit(run_one, *arguments)
    except BrokenExecutor as error:
        future: Future = Future()
        future.set_exception(error)
        return future


def _ready(waiting: list[Run], under_way: dict[Future, Run], failed: dict[Run, str], places: int) -> list[Run]:
    """Return the first runs that need nothing more, as many as there are places for."""
    not_there = {*waiting, *under_way.values(), *failed}
    return [run for run in waiting if not_there.isdisjoint(run.needs)][: max(places, 0)]


def _hopeless(waiting: list[Run], failed: dict[Run, str]) -> list[Run]:
    """Return the runs that need a run that failed, and note so."""
    for run in waiting:  # in order of need, so that one pass finds those that need a hopeless one too
        if lacking := [needed.name for needed in run.needs if needed in failed]:
            failed[run] = f"not done: it needs {lacking[0]}"
    return [run for run in waiting if run in failed]


def _error(future: Future) -> str | None:
    """Return what went wrong in a run, or with the process that did it."""
    error = future.exception()
    return f"the process of the run ended: {type(error).__name__}: {error}" if error else future.result()


def run_one(run: Run, root: str | Path, device: str = "cpu", processes: int = 1) -> str | None:
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
    str or None
        The traceback of what went wrong; None when all went well. It is text, so that it passes between processes, and
        stands in the run's `output.txt` too.
    """
    if run.has_ended(root):
        return None
    began, processes = time.perf_counter(), processes if run.is_training else 1
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
            return traceback.format_exc()
    return None


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
