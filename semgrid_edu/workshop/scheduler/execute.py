"""Carry out a plan: each run as soon as what it needs has ended, several at a time."""

from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from pathlib import Path

from tqdm.auto import tqdm

from semgrid_edu.storage.workplace import Workplace
from semgrid_edu.workshop.scheduler.one_run import run_one
from semgrid_edu.workshop.scheduler.runs import Run


def execute_plan(
    runs: Sequence[Run], root: str | Path, place: Workplace, device: str = "cpu", processes: int = 1
) -> dict[Run, str]:
    """Do all runs that haven't ended.

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
    waiting = [run for run in runs if not run.has_ended(root)]
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
    """Hand a run to the workplace, with all that `run_one` takes; when that has broken down, the future says so."""
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
    found = []
    for run in waiting:  # in order of need, so that one pass finds those that need a hopeless one too
        lacking = [needed.name for needed in run.needs if needed in failed]
        if lacking:
            failed[run] = f"not done: it needs {lacking[0]}"
            found.append(run)
    return found


def _error(future: Future) -> str | None:
    """Return what went wrong in a run, or with the process that did it."""
    error = future.exception()
    if error is None:
        return future.result().error
    return f"the process of the run ended: {type(error).__name__}: {error}"
