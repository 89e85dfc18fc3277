"""One unit of an experiment's work, done once in its own folder; plans of such units, and the loop that does them."""

import contextlib
import json
import math
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import MISSING, dataclass, fields, is_dataclass
from datetime import UTC, datetime
from pathlib import Path

import numba
import torch
from tqdm.auto import tqdm

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import commit, versions
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.workplace import Workplace

CLAIM, OUTPUT, ENDED = "run.json", "output.txt", "ended.json"
"""The files of every run: its settings, its printed output, and, written last, when it ended and how long it took."""

THREADS = 1
"""Threads of a run. The order of sums depends on it, so it is fixed: the same run gives the same bytes everywhere. Two
processes of one thread keep two cores busier than one process of two."""


@dataclass(frozen=True)
class Run(ABC):
    """One unit of work. A subclass is a frozen dataclass whose fields decide the result, and nothing else does.

    Two experiments that need equal runs share them: equal runs have the same folder.

    Attributes
    ----------
    kind : str
        What such runs do, in one word: the first part of their folder's name.
    tag : str
        What distinguishes the run from others of its kind: the rest of its folder's name.
    steps : int
        How many steps its work has; all take about the same time.
    pace : str
        Runs of the same pace take the same time per step.
    trial_seconds : float
        Seconds per step on one core, for the estimate while no run of this pace has ended.
    is_training : bool
        Whether it trains a network, so that the device matters.
    """

    is_training = False

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"{self.kind}-{self.tag}"

    @property
    def needs(self) -> tuple["Run", ...]:
        """The runs that must have ended before this one starts: by default those among its fields."""
        return tuple(value for field in fields(self) if isinstance(value := getattr(self, field.name), Run))

    @abstractmethod
    def work(self, root: Path, device: str) -> None:
        """Do the work, or resume it after an interruption.

        Parameters
        ----------
        root : Path
            The folder of all runs. The run writes to `folder` and reads the folders of the runs that it needs.
        device : str
            The device of a training run, see `choose_device`.
        """

    def folder(self, root: str | Path) -> Path:
        """Return the run's folder.

        Parameters
        ----------
        root : path-like
            The folder of all runs.
        """
        return Path(root) / self.name

    def has_ended(self, root: str | Path) -> bool:
        """Return whether nothing is left to do. Parameters are those of `Run.folder`.

        A run whose large files others read, such as weights, counts as not ended once these were deleted.
        """
        return self.is_recorded(root)

    def is_recorded(self, root: str | Path) -> bool:
        """Return whether it has ended once, so that it has a `record`. Parameters are those of `Run.folder`."""
        return (self.folder(root) / ENDED).exists()

    def record(self, root: str | Path) -> dict:
        """Return what the run recorded when it ended. Parameters are those of `Run.folder`.

        Returns
        -------
        dict
            "seconds", "date", "device", "threads", "commit" and "versions".

        Raises
        ------
        DataError
            When the run hasn't ended, or the record is damaged.
        """
        path = self.folder(root) / ENDED
        return checked_record(path, read_json(path))

    def settings(self) -> dict:
        """Return the fields that decide the run, as JSON gives them back.

        Fields with their default values are left out, so that a run stays the same when a later version adds fields.
        """
        return json.loads(json.dumps(_unusual(self)))


def checked_record(path: str | Path, record: object) -> dict:
    """Return the record of a run, with its seconds as a number and its date as text.

    Parameters
    ----------
    path : path-like
        Where it comes from, for the error.
    record : object
        What was found there.

    Raises
    ------
    DataError
        When it is something else.
    """
    try:
        checked = record | {"seconds": float(record["seconds"]), "date": str(record.get("date", "unknown"))}
    except (ValueError, KeyError, TypeError, OverflowError, AttributeError) as error:
        raise DataError(path, "the record of a run that has ended", repr(record)[:100]) from error
    if not 0 <= checked["seconds"] < math.inf:
        raise DataError(path, "the record of a run that has ended", f"{checked['seconds']} seconds")
    return checked


def _unusual(thing: object) -> object:
    """Return the kind of a dataclass and its fields, without those at their defaults; anything else as it is."""
    if isinstance(thing, tuple):
        return [_unusual(part) for part in thing]
    if not is_dataclass(thing):
        return thing
    given = {field.name: (getattr(thing, field.name), field.default) for field in fields(thing)}
    unusual = {name: value for name, (value, usual) in given.items() if usual is MISSING or value != usual}
    return {"kind": type(thing).__name__} | {name: _unusual(value) for name, value in unusual.items()}


def with_needs(wanted: Iterable[Run]) -> list[Run]:
    """Return a plan: runs and all that they need, each once, after the runs that it needs.

    Parameters
    ----------
    wanted : iterable of Run
        The runs, the most urgent first.
    """
    return list(dict.fromkeys(one for run in wanted for one in (*with_needs(run.needs), run)))


def left_to_do(plan: Sequence[Run], root: str | Path) -> list[Run]:
    """Return the runs of a plan that have to be done.

    A run that hasn't ended is left out when only ended runs need it: data and weights may be deleted as soon as all
    that is read from them has been counted.

    Parameters
    ----------
    plan : sequence of Run
        From `with_needs`.
    root : path-like
        The folder of all runs.
    """
    needed = {one for run in plan for one in run.needs}
    left: list[Run] = []
    for run in reversed(plan):
        is_read = run not in needed or any(run in later.needs for later in left)
        if is_read and not run.has_ended(root):
            left.append(run)
    return left[::-1]


def estimate(plan: Sequence[Run], root: str | Path) -> dict[Run, float]:
    """Estimate how many seconds each run takes that is left to do.

    Parameters
    ----------
    plan : sequence of Run
        From `with_needs`.
    root : path-like
        The folder of all runs. Runs that have ended there give the time of a step.

    Raises
    ------
    DataError
        When the record of a run is damaged.
    """
    paces: dict[str, list[float]] = {}
    for run in plan:
        if run.is_recorded(root):
            paces.setdefault(run.pace, []).append(run.record(root)["seconds"] / run.steps)
    left = left_to_do(plan, root)
    for run in left:
        if run.pace not in paces:
            paces[run.pace] = [run.trial_seconds]
    return {run: sum(paces[run.pace]) / len(paces[run.pace]) * run.steps for run in left}


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
