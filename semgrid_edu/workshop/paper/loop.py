"""The resumable loop behind `semgrid-edu reproduce`: every run of a plan, once, several at a time."""

import contextlib
import time
import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from datetime import UTC, datetime
from pathlib import Path

import numba
import torch
from tqdm.auto import tqdm

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import commit, versions
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.paper.run import CLAIM, ENDED, OUTPUT, Run, left_to_do
from semgrid_edu.workshop.workplace import Workplace

THREADS = 1
"""Threads of a run. The order of sums depends on it, so it is fixed: the same run gives the same bytes everywhere. Two
processes of one thread keep two cores busier than one process of two."""


def execute_plan(plan: Sequence[Run], root: str | Path, place: Workplace, device: str = "cpu") -> dict[Run, str]:
    """Do all runs that are left to do, each as soon as what it needs has ended.

    A run that fails stops only those that need it; a process that dies stops the plan. The command can be killed at any
    time: ended runs are kept, and a training run resumes from its checkpoint when the same command is given again.

    Parameters
    ----------
    plan : sequence of Run
        From `with_needs`.
    root : path-like
        The folder of all runs.
    place : Workplace
        Where the work is done. Threads and printed output belong to a process, so each process does one run at a time.
    device : str
        The device of the training runs, see `choose_device`.

    Returns
    -------
    dict of Run to str
        What went wrong, by run: the traceback, or the name of the run that would have been needed.
    """
    failed: dict[Run, str] = {}
    waiting = left_to_do(plan, root)
    under_way: dict[Future, Run] = {}
    with tqdm(total=len(plan), initial=len(plan) - len(waiting), desc="runs", unit="run") as bar:
        while waiting or under_way:
            missing = {*waiting, *under_way.values(), *failed}
            ready = [run for run in waiting if missing.isdisjoint(run.needs)]
            for run in ready[: max(place.slots - len(under_way), 0)]:
                waiting.remove(run)
                under_way[place.executor.submit(run_one, run, str(root), device)] = run
            bar.set_postfix_str(", ".join(run.name for run in under_way.values()))
            ended, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in ended:
                run = under_way.pop(future)
                if error := future.result():
                    failed[run] = error
                    tqdm.write(f"{run.name} failed: {error.strip().splitlines()[-1]}")
                bar.update()
            for run in list(waiting):  # in order of need, so that one pass also finds what a hopeless run stops
                if lacking := [needed.name for needed in run.needs if needed in failed]:
                    failed[run] = f"not done: it needs {lacking[0]}"
                    waiting.remove(run)
                    bar.update()
    return failed


def run_one(run: Run, root: str | Path, device: str = "cpu") -> str | None:
    """Do one run in this process.

    Parameters
    ----------
    run : Run
        The run; those that it needs have ended.
    root : path-like
        The folder of all runs.
    device : str
        The device of a training run, see `choose_device`.

    Returns
    -------
    str or None
        The traceback of what went wrong, as text so that it passes between processes; None when all went well.
    """
    if run.has_ended(root):
        return None
    began = time.perf_counter()
    with few_threads():
        try:
            claim_folder(run, root)
            with _printing_to(run.folder(root) / OUTPUT):
                run.work(Path(root), device)
            record = {
                "seconds": round(time.perf_counter() - began, 2),
                "date": f"{datetime.now(UTC):%Y-%m-%d}",
                "device": device,
                "threads": THREADS,
                "commit": commit(),
                "versions": versions("numpy", "torch", "numba"),
            }
            write_json(run.folder(root) / ENDED, record)
        except Exception:
            return traceback.format_exc()
    return None


@contextlib.contextmanager
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


def claim_folder(run: Run, root: str | Path) -> None:
    """Write a run's settings into its folder, or check those that are there.

    Parameters
    ----------
    run : Run
        The run that is about to start or to resume.
    root : path-like
        The folder of all runs.

    Raises
    ------
    DataError
        When the folder was made by a run with other settings.
    """
    path = run.folder(root) / CLAIM
    settings = run.settings()
    if not path.exists():
        write_json(path, settings)
        return
    found = read_json(path)
    if found != settings:
        differing = sorted(name for name in settings | found if settings.get(name) != found.get(name))
        theirs, ours = ({name: one.get(name) for name in differing} for one in (found, settings))
        raise DataError(path, f"the run {ours}", f"{theirs}: choose another folder for the runs, or remove this one")


@contextlib.contextmanager
def _printing_to(path: Path):
    """Append what the block prints, progress bars too, to a file."""
    with path.open("a", encoding="utf-8") as file, contextlib.redirect_stdout(file), contextlib.redirect_stderr(file):
        try:
            yield
        except Exception:
            file.write(traceback.format_exc())
            raise
