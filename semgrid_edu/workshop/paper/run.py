"""One unit of an experiment's work, done once in its own folder, and plans made of such units."""

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_json

CLAIM, OUTPUT, ENDED = "run.json", "output.txt", "ended.json"
"""The files of every run: its settings, its printed output, and, written last, when it ended and how long it took."""


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
