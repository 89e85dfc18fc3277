"""What a stage may hand to the next one, checked for everyone's functions; errors say what is probably wrong."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.pipeline.hints import file_of, in_short, kind_of, log_sum_hint, shape_hint, sum_hint, where

TOLERANCE = 1e-3
"""By how much the probabilities of a cell may miss a sum of 1: what the CRF allows as well."""

OWN = __name__.rpartition(".")[0]
"""Where the package's own stages are written."""


class StageError(ArgumentError):
    """A stage raised an error, or returned what the next stage can't use: which stage, where, at which frame."""


@dataclass(frozen=True)
class Seam:
    """One call of a stage, and what its result must look like.

    What goes into a function that isn't the package's own, and what comes out of it, is copied: so it may change its
    arguments, and return the same array again and again.

    Parameters
    ----------
    stage : str
        "track", "segment", "sample", "fuse" or "refine".
    function : callable
        Whoever wrote it.
    frame : int
        The number of the frame.
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
        """Call a stage between arrays, and check what it returns.

        Parameters
        ----------
        shape : tuple of int
            That of the result.
        *inputs : array
            What the stage takes.

        Returns
        -------
        result : (*shape) float32
        seconds : float
            How long the function took, without checks and copies.

        Raises
        ------
        StageError
            When it raises, or its result isn't an array of floats of that shape; when scores aren't finite, or
            probabilities don't sum to 1 in a cell.
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
        """Return the error that names this call."""
        return StageError(str(self), expected, found)

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Turn an exception of a function that isn't the package's own into one that says where it comes from."""
        try:
            yield
        except StageError:
            raise
        except Exception as error:
            if self.own:
                raise
            raise self.error("a result", f"an error: {in_short(error, file_of(self.function))}") from error

    def array(self, value: object, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Return a result as float32 in its own memory layout, or refuse it.

        Raises
        ------
        StageError
            When it isn't an array of floats of that shape.
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
        """Refuse NaN and infinity."""
        if not np.isfinite(values).all():
            place = _first(~np.isfinite(values))
            raise self.error("finite numbers", f"{values[place]} at index {place}")

    def probabilities(self, values: NDArray, axis: str = "class") -> None:
        """Refuse what aren't distributions over the first axis, the "class" or "state" axis of (K, H, W)."""
        wrong, total = _wrong_sums(values)
        if wrong is not None:
            found = f"that the {len(values)} {_PLURAL[axis]} of cell {wrong} sum to {total:.4g}"
            raise self.error("probabilities that sum to 1 in each cell", f"{found}: {sum_hint(values, total, axis)}")
        if values.min() < -TOLERANCE:
            cell = _first((values < -TOLERANCE).any(axis=0))
            raise self.error("probabilities from 0 to 1", f"{values[:, *cell].min():.4g} in cell {cell}")

    def log_probabilities(self, values: NDArray) -> None:
        """Refuse what aren't logarithms of distributions over the first axis, (C, H, W)."""
        with np.errstate(over="ignore"):
            wrong, total = _wrong_sums(np.exp(values))
        if wrong is not None:
            found = f"that exp of the {len(values)} classes of cell {wrong} sums to {total:.4g}"
            raise self.error(
                "log-probabilities, whose exp sums to 1 in each cell", f"{found}: {log_sum_hint(values, total)}"
            )


_VALUES = {"segment": Seam.finite, "fuse": Seam.log_probabilities, "refine": Seam.probabilities}
"""What is checked beyond the shape. The planes hold too many numbers for each frame: see `FrameWork.result`."""

_PLURAL = {"class": "classes", "state": "states"}


def _wrong_sums(values: NDArray) -> tuple[tuple[int, int] | None, float]:
    """Return the first cell of (K, H, W) that doesn't sum to 1, if there is one, and its sum."""
    with np.errstate(invalid="ignore"):
        total = values.sum(axis=0)
    right = np.abs(total - 1) <= TOLERANCE  # NaN isn't
    if right.all():
        return None, 1.0
    cell = _first(~right)
    return cell, float(total[cell])


def _first(where: NDArray) -> tuple[int, ...]:
    """Return the index of the first True."""
    return tuple(map(int, np.argwhere(where)[0]))
