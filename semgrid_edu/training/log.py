"""The log of a training run: one line per step (section 4.1)."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import found_at, named_errors, write_text

LOG = "log.csv"
"""Name of the log's file in the folder of a training run."""


class Step(NamedTuple):
    """One line of the log.

    Parameters
    ----------
    iteration : int
        Number of the step, from 0.
    stage : str
        "image" or "grid".
    learning_rate : float
        The learning rate of this step.
    loss : float
        Weighted cross-entropy of the batch before the step, nats.
    """

    iteration: int
    stage: str
    learning_rate: float
    loss: float


HEADER = ",".join(Step._fields) + "\n"
"""The first line of a log: the names of its columns."""

COLUMNS = np.dtype({"names": Step._fields, "formats": (np.int64, "U5", np.float64, np.float64)})
"""The types of these columns."""


def begin_log(path: Path, start: int) -> None:
    """Begin a log, or continue one from step `start`; later steps, which aren't in the checkpoint, are dropped.

    Parameters
    ----------
    path : Path
        The file to write.
    start : int
        Number of the next step.

    Raises
    ------
    DataError
        If a step before `start` is missing or its line is malformed; the message gives the line number.
    """
    lines = [HEADER]
    if start:
        lines = _lines(path)[: start + 1] if path.is_file() else []
        if len(lines) <= start or not lines[-1].endswith("\n"):
            raise DataError(path, f"the {start} steps that the checkpoint continues", max(len(lines) - 1, 0) or "none")
        _steps(path, lines)
    write_text(path, "".join(lines))


def append_step(path: Path, step: Step) -> None:
    """Append a line to a log; it is written at once, so that training can be watched.

    Parameters
    ----------
    path : Path
        The file to add to.
    step : Step
        The latest step.

    Raises
    ------
    OSError
        When the file can't be written, for example on a full disk; the error names the file.
    """
    with named_errors(path), path.open("a", encoding="utf-8", newline="\n") as log:
        log.write(f"{step.iteration},{step.stage},{step.learning_rate:.6g},{step.loss:.6g}\n")


def read_log(path: str | Path) -> np.recarray:
    """Read the log of a training run, finished or not.

    Parameters
    ----------
    path : path-like
        The `log.csv` that `train` writes.

    Returns
    -------
    (N,) recarray
        The steps; each field of `Step` is an attribute, (N,).
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(path, "the log of a training run", found_at(path))
    return np.array(_steps(path, _lines(path)), COLUMNS).view(np.recarray)


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)


def _steps(path: Path, lines: list[str]) -> list[Step]:
    """Return the steps in the lines of a log, after checking all of them."""
    header, *others = [line.rstrip("\n") for line in lines] or [""]
    if header != HEADER.strip():
        raise DataError(path, f"{HEADER.strip()} in line 1", repr(header))
    steps = [_step(path, number, line) for number, line in enumerate(others, start=2)]
    for number, step in enumerate(steps):
        before = steps[number - 1].stage if number else "image"
        if step.iteration != number or (before, step.stage) == ("grid", "image"):
            expected = f"step {number} in line {number + 2}, with the image stage before the grid stage"
            raise DataError(path, expected, f"step {step.iteration} of the {step.stage} stage")
    return steps


def _step(path: Path, number: int, line: str) -> Step:
    try:
        iteration, stage, learning_rate, loss = line.split(",")
        if stage not in ("image", "grid"):
            raise ValueError
        return Step(int(iteration), stage, float(learning_rate), float(loss))
    except ValueError:
        raise DataError(path, f"{HEADER.strip()} in line {number}", repr(line)) from None
