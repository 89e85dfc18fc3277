"""Checks of what one stage hands to the next; the error says which stage, where, and what is probably wrong."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.stages.hints import file_of, in_short, kind_of, log_sum_hint, shape_hint, sum_hint, where

TOLERANCE = 1e-3
"""How far the probabilities of a cell may be from a sum of 1; the CRF allows the same."""


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
    first_frame : int
        Number of the frame of the first call, for messages; each call counts one on.
    of_probabilities : bool
        Whether the result of `sample` must be class probabilities.
    """

    def __init__(
        self, name: str, stage: Any, shape: tuple[int, ...], first_frame: int = 0, of_probabilities: bool = False
    ) -> None:
        self.name = name
        self.stage = stage
        self.__wrapped__ = stage  # so that `inspect.signature` gives the stage's own
        self.of_probabilities = of_probabilities
        self.shape = shape
        self.frame = first_frame - 1
        self.is_ours = str(getattr(stage, "__module__", None)).startswith("semgrid_edu.")

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
        if self.name == "segment":
            self.finite(result)
        elif self.of_probabilities and not (result.min() >= -TOLERANCE and result.max() <= 1 + TOLERANCE):
            found = f"{result.min():.4g} to {result.max():.4g}: sample the soft-max of s over axis 0"
            raise self.error("class probabilities, because the network uses return heights", found)
        elif self.name == "fuse":
            self.log_probabilities(result, inputs[0])
        elif self.name == "refine":
            self.probabilities(result, "classes")
        return result  # the planes hold too many numbers to search them at each frame: see `log_probabilities`

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

    def finite(self, values: NDArray) -> None:
        """Reject NaN and infinity.

        Parameters
        ----------
        values : array
            What the stage returned.
        """
        if not np.isfinite(values).all():
            place = _first(~np.isfinite(values))
            raise self.error("finite numbers", f"{values[place]} at index {place}")

    def probabilities(self, values: NDArray, axis: str) -> None:
        """Reject values that aren't a distribution in each cell.

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

    def log_probabilities(self, values: NDArray, planes: NDArray) -> None:
        """Reject values that aren't logarithms of a distribution over the classes in each cell.

        Parameters
        ----------
        values : (C, H, W) float32
            What the stage `fuse` returned, natural logarithms.
        planes : (C, D, H, W) float32
            What it was given. If these aren't finite, the stage `sample` is to blame.
        """
        with np.errstate(over="ignore"):
            cell, total = _wrong_sum(np.exp(values))
        if cell is not None:
            if not np.isfinite(planes).all():
                place = _first(~np.isfinite(planes))
                raise self.error("finite numbers from `sample`", f"{planes[place]} at index {place}")
            found = f"that exp of the {len(values)} classes of cell {cell} sums to {total:.4g}"
            wanted = "log-probabilities, whose exp sums to 1 in each cell"
            raise self.error(wanted, f"{found}: {log_sum_hint(values, total)}")


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
