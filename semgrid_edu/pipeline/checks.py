"""Checks of what each stage hands to the next one; the errors say what is probably wrong."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.pipeline.hints import file_of, in_short, kind_of, log_sum_hint, shape_hint, sum_hint, where

TOLERANCE = 1e-3
"""The most by which the probabilities of a cell may miss a sum of 1; the CRF allows the same."""

OWN = __name__.rpartition(".")[0]
"""The package in which the package's own stages are written."""


class StageError(ArgumentError):
    """A stage raised an error, or returned what the next one can't use; it says which stage, where, at which frame."""


@dataclass(frozen=True)
class StageCheck:
    """One call of a stage, and what its result must look like. Its methods raise `StageError`.

    A function that isn't the package's own gets copies of its arguments, and its result is copied too. So it may change
    its arguments, and return the same array at each frame.

    Parameters
    ----------
    stage : str
        Name of the stage: "track", "segment", "sample", "fuse", "refine" or "remember".
    function : callable
        The stage, the package's own or a student's.
    frame : int
        Number of the frame.
    """

    stage: str
    function: Callable
    frame: int

    def __str__(self) -> str:
        """Say which stage, where it is written, and at which frame: "refine (my_stages.py, line 12), frame 3"."""
        return f"{self.stage} ({where(self.function)}), frame {self.frame}"

    @property
    def own(self) -> bool:
        """Whether the function is one of those that `Stages.of` makes."""
        return str(getattr(self.function, "__module__", "")).startswith(OWN)

    def call(self, shape: tuple[int, ...], *inputs: NDArray) -> tuple[NDArray[np.float32], float]:
        """Call a stage that takes arrays and returns one, and check what it returns.

        Parameters
        ----------
        shape : tuple of int
            Shape that the result must have.
        *inputs : array
            What the stage takes.

        Returns
        -------
        result : (*shape) float32
            What the stage returned.
        seconds : float
            How long the function took, without checks and copies.
        """
        given = inputs if self.own else [np.copy(array) for array in inputs]
        start = time.perf_counter()
        with self.blamed():
            value = self.function(*given)
        seconds = time.perf_counter() - start
        result = self.array(value, shape)
        if self.stage in _VALUES:
            _VALUES[self.stage](self, result)
        return result, seconds

    def error(self, expected: object, found: object) -> StageError:
        """Return an error that names this call.

        Parameters
        ----------
        expected, found : object
            What was expected of the stage, and what was found instead.
        """
        return StageError(str(self), expected, found)

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Turn an exception of a function that isn't the package's own into one that says where it comes from."""
        try:
            yield
        except StageError:
            raise
        except (Exception, SystemExit) as error:
            if self.own:
                raise
            raise self.error("a result", f"an error: {in_short(error, file_of(self.function))}") from error

    def array(self, value: object, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Return a result as float32 in its own memory layout; refuse all but an array of floats of this shape.

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
        with np.errstate(over="ignore"):  # what is too large becomes infinite, and is refused as such
            return value.astype(np.float32, order="K", copy=not self.own)

    def finite(self, values: NDArray) -> None:
        """Refuse NaN and infinity.

        Parameters
        ----------
        values : array
            What the stage returned.
        """
        if not np.isfinite(values).all():
            place = _first(~np.isfinite(values))
            raise self.error("finite numbers", f"{values[place]} at index {place}")

    def probabilities(self, values: NDArray, axis: str = "classes") -> None:
        """Refuse values that aren't a distribution in each cell.

        Parameters
        ----------
        values : (K, H, W) float32
            What the stage returned.
        axis : str
            What the first axis holds: "classes" or "states".
        """
        cell, total = _wrong_sum(values)
        if cell is not None:
            found = f"that the {len(values)} {axis} of cell {cell} sum to {total:.4g}: {sum_hint(values, total, axis)}"
            raise self.error("probabilities that sum to 1 in each cell", found)
        if values.min() < -TOLERANCE:
            cell = _first((values < -TOLERANCE).any(axis=0))
            raise self.error("probabilities from 0 to 1", f"{values[:, *cell].min():.4g} in cell {cell}")

    def log_probabilities(self, values: NDArray) -> None:
        """Refuse values that aren't logarithms of a distribution over the classes in each cell.

        Parameters
        ----------
        values : (C, H, W) float32
            What the stage returned, natural logarithms.
        """
        with np.errstate(over="ignore"):
            cell, total = _wrong_sum(np.exp(values))
        if cell is not None:
            found = f"that exp of the {len(values)} classes of cell {cell} sums to {total:.4g}"
            wanted = "log-probabilities, whose exp sums to 1 in each cell"
            raise self.error(wanted, f"{found}: {log_sum_hint(values, total)}")


_VALUES = {"segment": StageCheck.finite, "fuse": StageCheck.log_probabilities, "refine": StageCheck.probabilities}
"""What is checked beyond the shape. The planes hold too many numbers to check them at each frame: see `FrameRunner`."""


def _wrong_sum(values: NDArray) -> tuple[tuple[int, int] | None, float]:
    """Return the first cell of (K, H, W) whose values don't sum to 1, or None, and its sum."""
    with np.errstate(invalid="ignore"):
        total = values.sum(axis=0)
    wrong = ~(np.abs(total - 1) <= TOLERANCE)  # NaN is
    if not wrong.any():
        return None, 1.0
    cell = _first(wrong)
    return cell, float(total[cell])


def _first(where: NDArray) -> tuple[int, ...]:
    """Return the index of the first True."""
    return tuple(map(int, np.argwhere(where)[0]))
