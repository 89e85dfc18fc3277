"""Checks of what one stage hands to the next; the error says which stage, where, and what is probably wrong."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.stages.hints import file_of, in_short, kind_of, log_sum_hint, shape_hint, sum_hint, where

TOLERANCE = 1e-3
"""How far the probabilities of a cell may be from a sum of 1; the CRF allows the same."""


PACKAGE = Path(__file__).parents[1]
"""The folder of the package."""


class StageError(ArgumentError):
    """A stage raised an error, or returned what the next one can't use; it says which stage, where, at which frame."""


class CheckedStage:
    """A stage that checks its results. Its methods raise `StageError`.

    A function of your own gets copies of its arguments, and its result is copied too. So it may change its arguments,
    and return the same array at each frame.

    Parameters
    ----------
    name : str
        Name of the stage.
    stage : callable or Tracker
        The stage, the package's own or yours.
    shape : tuple of int
        Shape that the result must have.
    check : callable
        `check(self, result)` rejects what the next stage can't use: `finite`, `distribution`, ...
    first_frame : int
        Number of the frame of the first call, for messages; each call counts one on.
    """

    def __init__(
        self, name: str, stage: Any, shape: tuple[int, ...], check: Callable[..., None], first_frame: int = 0
    ) -> None:
        self.name = name
        self.stage = stage
        self.shape = shape
        self.check = check
        self.frame = first_frame - 1
        self.is_ours = is_ours(stage)

    def __str__(self) -> str:
        """Say which stage, where it is written, and at which frame: "refine (my_stages.py, line 12), frame 3"."""
        return f"{self.name} ({where(self.stage)}), frame {self.frame}"

    def __call__(self, *inputs: NDArray) -> NDArray[np.float32]:
        """Call the stage and check what it returns.

        Parameters
        ----------
        *inputs : array
            What the stage takes.

        Returns
        -------
        (*shape) float32
            What the stage returned.
        """
        self.frame += 1
        given = inputs if self.is_ours else [np.copy(array) for array in inputs]
        with self.blamed():
            value = self.stage(*given)
        result = self.array(value, self.shape)
        self.check(self, result)
        return result

    def error(self, expected: object, found: object) -> StageError:
        """Return an error that names this stage and this frame.

        Parameters
        ----------
        expected, found : object
            What was expected of the stage, and what was found instead.
        """
        return StageError(str(self), expected, found)

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Turn an exception of a stage of your own into one that says where it comes from."""
        try:
            yield
        except StageError:
            raise
        except (Exception, SystemExit) as error:
            if self.is_ours:
                raise
            raise self.error("a result", f"an error: {in_short(error, file_of(self.stage))}") from error

    def array(self, value: object, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Return a result as float32 in its own memory layout; reject all but an array of floats of this shape.

        Parameters
        ----------
        value : object
            What the stage returned.
        shape : tuple of int
            The shape that it must have.
        """
        if not isinstance(value, np.ndarray):
            raise self.error("a numpy array", kind_of(value))
        if value.shape != shape:
            raise self.error(f"shape {shape}", f"shape {value.shape}{shape_hint(value.shape, shape)}")
        if value.dtype.kind != "f":
            raise self.error("floating-point numbers", f"{value.dtype}")
        with np.errstate(over="ignore"):  # what is too large becomes infinite, which is rejected next
            return value.astype(np.float32, order="K", copy=not self.is_ours)


def is_ours(stage: object) -> bool:
    """Return whether a stage is the package's own: its code is in a file of the package.

    Parameters
    ----------
    stage : callable or Tracker
        The stage.
    """
    method = getattr(type(stage), "step", type(stage).__call__)
    code = getattr(stage, "__code__", None) or getattr(method, "__code__", None)
    return code is not None and Path(code.co_filename).is_relative_to(PACKAGE)


def finite(stage: CheckedStage, values: NDArray) -> None:
    """Reject NaN and infinity.

    Parameters
    ----------
    stage : CheckedStage
        The stage, for its error; the other checks have it too.
    values : array
        What the stage returned.
    """
    if not np.isfinite(values).all():
        place = _first(~np.isfinite(values))
        raise stage.error("finite numbers", f"{values[place]} at index {place}")


def class_probabilities(stage: CheckedStage, values: NDArray) -> None:
    """Reject planes with numbers that are no probabilities, such as raw scores.

    Parameters
    ----------
    stage, values
        Those of `finite`.
    """
    least = values.min()
    most = values.max()
    if not (least >= -TOLERANCE and most <= 1 + TOLERANCE):  # true for NaN as well
        found = f"{least:.4g} to {most:.4g}: sample the soft-max of s over axis 0"
        raise stage.error("class probabilities, because the network uses return heights", found)


def distribution(stage: CheckedStage, values: NDArray, axis: str = "classes") -> None:
    """Reject values that aren't a distribution in each cell.

    Parameters
    ----------
    stage, values
        Those of `finite`; the values are (K, H, W).
    axis : str
        What the first axis holds: "classes" or "states".
    """
    cell, total = _wrong_sum(values)
    if cell is not None:
        found = f"that the {len(values)} {axis} of cell {cell} sum to {total:.4g}: {sum_hint(values, total, axis)}"
        raise stage.error("probabilities that sum to 1 in each cell", found)
    if values.min() < -TOLERANCE:
        cell = _first((values < -TOLERANCE).any(axis=0))
        raise stage.error("probabilities from 0 to 1", f"{values[:, *cell].min():.4g} in cell {cell}")


def log_distribution(stage: CheckedStage, values: NDArray) -> None:
    """Reject values that aren't logarithms of a distribution over the classes in each cell.

    Parameters
    ----------
    stage, values
        Those of `finite`; the values are (C, H, W).
    """
    with np.errstate(over="ignore"):
        cell, total = _wrong_sum(np.exp(values))
    if cell is not None:
        found = f"that exp of the {len(values)} classes of cell {cell} sums to {total:.4g}"
        wanted = "log-probabilities, whose exp sums to 1 in each cell"
        raise stage.error(wanted, f"{found}: {log_sum_hint(values, total)}")


def anything(stage: CheckedStage, values: NDArray) -> None:
    """Accept everything. Parameters are those of `finite`."""


def _first(wrong: NDArray) -> tuple[int, ...]:
    """Return the index of the first True."""
    return tuple(map(int, np.argwhere(wrong)[0]))


def _wrong_sum(values: NDArray) -> tuple[tuple[int, int] | None, float]:
    """Return the first cell of (K, H, W) whose values don't sum to 1, or None, and its sum."""
    with np.errstate(invalid="ignore"):
        total = values.sum(axis=0)
    wrong = ~(np.abs(total - 1) <= TOLERANCE)  # true for NaN as well
    if not wrong.any():
        return None, 1.0
    cell = _first(wrong)
    return cell, float(total[cell])
