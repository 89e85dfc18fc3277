"""A run: one unit of an experiment's work, in a folder of its own, done once and kept (section 4)."""

import contextlib
import json
import subprocess
import threading
import time
import traceback
from dataclasses import MISSING, dataclass, fields, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.experiments.reproduction.threads import THREADS, few_threads
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import versions

CLAIM, OUTPUT, ENDED = "run.json", "output.txt", "ended.json"
"""The files that every run has: what decides it, what it printed, and, last of all, when it ended and how long it took.
"""

_ONE_AT_A_TIME = threading.Lock()
"""Threads and printed output belong to a process, so it takes one run at a time, however many a cluster gives it."""


@dataclass(frozen=True)
class Run:
    """One unit of work. A subclass is a frozen dataclass whose fields decide the result, and nothing else does.

    Two experiments that need equal runs share them: equal runs have the same folder.
    """

    @property
    def name(self) -> str:
        """The name of its folder."""
        raise NotImplementedError

    @property
    def needs(self) -> tuple["Run", ...]:
        """The runs that must have ended before this one starts."""
        return ()

    @property
    def steps(self) -> int:
        """How many steps its work has; all take about the same time."""
        raise NotImplementedError

    @property
    def pace(self) -> str:
        """What the time of a step depends on: runs of the same pace take the same time per step."""
        raise NotImplementedError

    def probe(self) -> float:
        """Return the seconds that a step probably takes, for the estimate of a plan."""
        raise NotImplementedError

    def work(self, root: Path, device: str) -> None:
        """Do the work, or go on with it after an interruption.

        Parameters
        ----------
        root : Path
            The folder of all runs. The run writes to `folder` and reads the folders of the runs that it needs.
        device : str
            The device of a training, see `choose_device`.
        """
        raise NotImplementedError

    def folder(self, root: str | Path) -> Path:
        """Return the run's own folder.

        Parameters
        ----------
        root : path-like
            The folder of all runs.
        """
        return Path(root) / self.name

    def has_ended(self, root: str | Path) -> bool:
        """Return whether the run is done, so that nothing is left to do.

        Parameters
        ----------
        root : path-like
            The folder of all runs.
        """
        return (self.folder(root) / ENDED).exists()

    def seconds(self, root: str | Path) -> float:
        """Return how long the run took, as its folder records it.

        Parameters
        ----------
        root : path-like
            The folder of all runs.

        Raises
        ------
        DataError
            When the run hasn't ended, or the record is damaged.
        """
        path = self.folder(root) / ENDED
        try:
            return float(json.loads(path.read_text(encoding="utf-8"))["seconds"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise DataError(path, "the record of a run that has ended", error) from error

    def settings(self) -> dict:
        """Return what decides the run, as JSON gives it back.

        What is as usual is left out, so that a run stays the same run when a later version knows more settings.
        """
        return json.loads(json.dumps(_unusual(self)))


def _unusual(thing: object) -> object:
    """Return the kind of a dataclass and its fields that differ from their defaults; anything else as it is."""
    if isinstance(thing, tuple):
        return [_unusual(part) for part in thing]
    if not is_dataclass(thing):
        return thing
    given = {field.name: getattr(thing, field.name) for field in fields(thing)}
    usual = {field.name: field.default for field in fields(thing)}
    return {"kind": type(thing).__name__} | {
        name: _unusual(value) for name, value in given.items() if usual[name] is MISSING or value != usual[name]
    }


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


def run_one(run: Run, root: str | Path, device: str = "cpu") -> Outcome:
    """Do one run; this is what every process and every machine of a cluster is asked to do.

    Parameters
    ----------
    run : Run
        The run; those that it needs have ended.
    root : path-like
        The folder of all runs, the same for all machines.
    device : str
        The device of a training, see `choose_device`.

    Returns
    -------
    Outcome
        An error is returned, not raised, and stands in the run's `output.txt` too.
    """
    began = time.perf_counter()
    if run.has_ended(root):
        return Outcome(0.0, None)
    with _ONE_AT_A_TIME, few_threads():
        try:
            claim_folder(run, root)
            with _printing_to(run.folder(root) / OUTPUT):
                run.work(Path(root), device)
            _record_end(run, root, device, time.perf_counter() - began)
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
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise DataError(path, "the settings of a run", error) from error
    if found != settings:
        differing = sorted(name for name in settings | found if settings.get(name) != found.get(name))
        theirs, ours = ({name: one.get(name) for name in differing} for one in (found, settings))
        raise DataError(path, f"the run {ours}", f"{theirs}: choose another folder for the runs, or remove this one")


def _record_end(run: Run, root: str | Path, device: str, seconds: float) -> None:
    """Write the last file of a run, which says that all others are there."""
    record = {
        "seconds": round(seconds, 2),
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "device": device,
        "threads": THREADS,
        "commit": commit(),
        "versions": versions("numpy", "torch", "numba"),
    }
    write_json(run.folder(root) / ENDED, record)


def commit() -> str | None:
    """Return the commit of the package's source tree, with "+" after it when files were changed since.

    Returns
    -------
    str or None
        None when the package doesn't lie in a git checkout.
    """
    git = ["git", "-C", str(Path(__file__).parent)]
    try:
        head, changes = (
            subprocess.run([*git, *command], capture_output=True, text=True, check=True).stdout.strip()
            for command in (["rev-parse", "--short=12", "HEAD"], ["status", "--porcelain", "--untracked-files=no"])
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return head + ("+" if changes else "")


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
