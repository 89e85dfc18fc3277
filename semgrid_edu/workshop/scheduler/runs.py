"""A run: one unit of an experiment's work, in a folder of its own, done once and kept (section 4)."""

import json
from abc import ABC, abstractmethod
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_json

CLAIM, OUTPUT, ENDED = "run.json", "output.txt", "ended.json"
"""The files that every run has: what decides it, what it printed, and, last of all, when it ended and how long it took.
"""


@dataclass(frozen=True)
class Run(ABC):
    """One unit of work. A subclass is a frozen dataclass whose fields decide the result, and nothing else does.

    Two experiments that need equal runs share them: equal runs have the same folder.

    Attributes
    ----------
    kind : str
        What such runs do, in one word: the first part of their folder's name.
    tag : str
        What tells the run from others of its kind: the rest of its folder's name.
    steps : int
        How many steps its work has; all take about the same time.
    pace : str
        What the time of a step depends on: runs of the same pace take the same time per step.
    is_training : bool
        Whether it is a training run, so that several processes can share its batches (`open_fabric`).
    trial_seconds : float
        Seconds that a step probably takes, for the estimate of a plan: on one core when this was written.
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
        """Do the work, or go on with it after an interruption.

        Parameters
        ----------
        root : Path
            The folder of all runs. The run writes to `folder` and reads the folders of the runs that it needs.
        device : str
            The device of a training run, see `choose_device`.
        """

    def folder(self, root: str | Path) -> Path:
        """Return the run's own folder.

        Parameters
        ----------
        root : path-like
            The folder of all runs.
        """
        return Path(root) / self.name

    def has_ended(self, root: str | Path) -> bool:
        """Return whether nothing is left to do. Parameters are those of `Run.folder`.

        A run that others read large files of, such as weights, hasn't ended when these were deleted.
        """
        return self.is_recorded(root)

    def is_recorded(self, root: str | Path) -> bool:
        """Return whether it has ended once, so that `record` says when. Parameters are those of `Run.folder`."""
        return (self.folder(root) / ENDED).exists()

    def record(self, root: str | Path) -> dict:
        """Return what the run recorded when it ended. Parameters are those of `Run.folder`.

        Returns
        -------
        dict
            "seconds", how long it took; "date", "device", "threads", "commit" and "versions"; and, where there was more
            than one, the number of "processes".

        Raises
        ------
        DataError
            When the run hasn't ended, or the record is damaged.
        """
        path = self.folder(root) / ENDED
        return checked_record(path, read_json(path))

    def settings(self) -> dict:
        """Return what decides the run, as JSON gives it back.

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
        What is there in its place.

    Raises
    ------
    DataError
        When it is something else.
    """
    try:
        return record | {"seconds": float(record["seconds"]), "date": str(record.get("date", "unknown"))}
    except (ValueError, KeyError, TypeError, OverflowError, AttributeError) as error:
        raise DataError(path, "the record of a run that has ended", error) from error


def _unusual(thing: object) -> object:
    """Return the kind of a dataclass and its fields, without those at their defaults; anything else as it is."""
    if isinstance(thing, tuple):
        return [_unusual(part) for part in thing]
    if not is_dataclass(thing):
        return thing
    given = {field.name: (getattr(thing, field.name), field.default) for field in fields(thing)}
    unusual = {name: value for name, (value, usual) in given.items() if usual is MISSING or value != usual}
    return {"kind": type(thing).__name__} | {name: _unusual(value) for name, value in unusual.items()}
