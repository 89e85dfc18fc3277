"""Faults of shape: which axis holds the classes, which the states, and whether both arrays have the same grid.

Each function yields what is wrong, and returns the array with its axes in place, or None.
"""

from collections.abc import Generator
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf.doctor.distributions import sum_to_one
from semgrid_edu.crf.doctor.finding import Finding, finding
from semgrid_edu.occupancy import N_STATES

Mended = Generator[Finding, None, NDArray | None]
"""Yields what is wrong with an array, and returns the array, mended if that can be done; None when it can't."""


def as_numbers(argument: str, given: object) -> Mended:
    """Turn an argument into an array of numbers.

    Parameters
    ----------
    argument : str
        Its name.
    given : array-like
        What was handed over; anything.

    Yields
    ------
    Finding
        What is wrong, if anything is.

    Returns
    -------
    (...) float64, float32, float16 or int, or None
        The numbers; None when there are none.
    """
    kind = type(given).__name__
    try:
        array = np.asarray(given)
    except Exception as error:  # a tensor may raise any of its own
        yield finding("no array of numbers", argument=argument, what=f"{kind}, which numpy refuses: {error}")
        return None
    if array.dtype.kind not in "fiub" or array.ndim == 0:
        yield finding("no array of numbers", argument=argument, what=f"{kind}, as an array of {array.dtype}")
        return None
    if array.size == 0:
        yield finding("empty array", argument=argument, shape=array.shape)
        return None
    if np.ma.is_masked(given):
        yield finding("masked cells", argument=argument, masked=np.ma.count_masked(given), size=array.size)
    return array


def arguments_swapped(unary: NDArray, values: NDArray) -> bool:
    """Tell whether the unary term and the states were handed over in the wrong order.

    Parameters
    ----------
    unary, values : (...) float
        What was handed over as `unary` and as `values`.

    Returns
    -------
    bool
        True when the first holds the states, and the second doesn't.
    """
    if unary.ndim != 3 or values.ndim != 3 or unary.shape[1:] != values.shape[1:]:
        return False
    return len(unary) == N_STATES and len(values) != N_STATES and sum_to_one(unary.sum(axis=0, dtype=np.float64))


def oriented_values(values: NDArray) -> Mended:
    """Bring the states to the first axis.

    Parameters
    ----------
    values : (...) float
        What was handed over as `values`.

    Yields
    ------
    Finding
        What is wrong, if anything is.

    Returns
    -------
    (4, H, W) float or None
        The same numbers; None when they can't be brought into that shape.
    """
    values = yield from _without_batch("values", values)
    if values.ndim != 3 or N_STATES not in values.shape:
        yield finding("not four states", shape=values.shape)
        return None
    axes = [axis for axis, size in enumerate(values.shape) if size == N_STATES]
    axis = next((axis for axis in axes if sum_to_one(values.sum(axis=axis, dtype=np.float64))), axes[0])
    if axis != 0:
        yield finding("states on the wrong axis", shape=values.shape, axis=axis)
    return np.moveaxis(values, axis, 0)


def oriented_unary(unary: NDArray, grid: tuple[int, int] | None) -> Mended:
    """Bring the classes to the first axis, and rows and columns into the order of the grid.

    Parameters
    ----------
    unary : (...) float
        What was handed over as `unary`.
    grid : (int, int) or None
        H and W as `values` has them; None when it has no such shape.

    Yields
    ------
    Finding
        What is wrong, if anything is.

    Returns
    -------
    (C, H, W) float or None
        The same numbers; None when they can't be brought into that shape.
    """
    unary = yield from _without_batch("unary", unary)
    if unary.ndim == 2 or (len(unary) == 1 and unary.dtype.kind in "iub"):
        return (yield from _from_two_axes(unary, grid))
    if unary.ndim == 3 and (grid is None or unary.shape[1:] == grid):
        return unary
    orders = permutations(range(3)) if unary.ndim == 3 else ()
    order = next((order for order in orders if tuple(unary.shape[axis] for axis in order[1:]) == grid), None)
    if order is None:
        yield finding("grids differ", shape=unary.shape, grid=grid)
        return None
    right = np.transpose(unary, order)
    name = "rows and columns swapped" if order[0] == 0 else "classes on the wrong axis"
    yield finding(name, shape=unary.shape, right=right.shape, order=order)
    return right


def _from_two_axes(unary: NDArray, grid: tuple[int, int] | None) -> Mended:
    """Judge a unary term that has no class axis, or no grid."""
    cells = None if grid is None else grid[0] * grid[1]
    if unary.ndim == 2 and cells in unary.shape and unary.shape != grid:
        transposed = ".T" if unary.shape[1] != cells else ""
        yield finding("cells in one row", shape=unary.shape, cells=cells, transposed=transposed, grid=grid)
        return (unary.T if transposed else unary).reshape(-1, *grid)
    ignored = next((f"; {label} usually marks cells to ignore" for label in (255, -1) if (unary == label).any()), "")
    ends = {"low": unary.min(), "high": unary.max()}
    yield finding("labels for costs", dtype=unary.dtype, shape=unary.shape, ignored=ignored, **ends)
    return None


def _without_batch(argument: str, array: NDArray) -> Mended:
    if array.ndim == 4 and len(array) == 1:
        yield finding("batch axis", argument=argument, shape=array.shape)
        return array[0]
    return array
