"""Faults of shape: which axis holds the classes, which the states, and whether both arrays have the same grid."""

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf.doctor.finding import Finding
from semgrid_edu.occupancy import N_STATES

SHAPE_ERROR = "The CRF stops with an ArgumentError about a shape, or the labels look shuffled."


def as_numbers(name: str, argument: object) -> tuple[NDArray | None, Finding | None]:
    """Turn an argument into an array of numbers, if that can be done.

    Parameters
    ----------
    name : str
        The name of the argument.
    argument : array-like
        What was handed over; anything.

    Returns
    -------
    array : (...) float64, float32, float16 or int, or None
        The numbers; None when there are none.
    finding : Finding or None
        What is wrong, if anything is.
    """
    try:
        array = np.asarray(argument)
    except Exception as error:  # a tensor may raise any of its own
        return None, _no_array(name, f"{type(argument).__name__}, which numpy refuses: {error}")
    if array.dtype.kind not in "fiub" or array.ndim == 0:
        return None, _no_array(name, f"{type(argument).__name__}, as an array of {array.dtype}")
    if array.size == 0:
        return None, Finding(
            "empty array",
            "The CRF stops with an ArgumentError, and arg-max of the result with a ValueError.",
            f"`{name}` has the shape {array.shape}: it holds no number at all.",
            "A slice or a mask selected nothing.",
            "Print the shape of each array on its way here, and look for the first one with a zero in it.",
        )
    if np.ma.is_masked(argument):
        return array, Finding(
            "masked cells",
            "The CRF stops with an ArgumentError; elsewhere masked cells get a label, and influence their neighbours.",
            f"`{name}` is a masked array; {np.ma.count_masked(argument):,} of its {array.size:,} numbers are masked.",
            "numpy drops the mask when it makes an ordinary array; the numbers under it may be anything.",
            "Fill them with what you know: the same cost for every class, and UNKNOWN with probability 1.",
        )
    return array, None


def _no_array(name: str, found: str) -> Finding:
    return Finding(
        "no array of numbers",
        "The CRF stops with an ArgumentError: expected an array of real numbers.",
        f"`{name}` is {found}.",
        "A tensor that carries gradients, a list of rows of different lengths, None, text, or complex numbers.",
        "Hand over an array of real numbers; of a tensor `tensor.detach().cpu().numpy()`.",
    )


def arguments_swapped(unary: NDArray, values: NDArray) -> Finding | None:
    """Find out whether the two arrays were handed over in the wrong order.

    Parameters
    ----------
    unary, values : (...) float
        What was handed over as `unary` and as `values`.

    Returns
    -------
    Finding or None
        What was found, if they were.
    """
    if unary.ndim != 3 or values.ndim != 3 or unary.shape[1:] != values.shape[1:]:
        return None
    if len(unary) != N_STATES or len(values) == N_STATES or not _sums_to_one(unary, 0):
        return None
    return Finding(
        "arguments swapped",
        SHAPE_ERROR,
        f"`unary` has {N_STATES} numbers in each cell, which sum to one; `values` has {len(values)}.",
        "The occupancy probabilities stand where the costs of the classes belong.",
        "The order is (unary, values, params).",
    )


def oriented_values(values: NDArray) -> tuple[NDArray | None, Finding | None]:
    """Bring the states to the first axis.

    Parameters
    ----------
    values : (...) float
        What was handed over as `values`.

    Returns
    -------
    values : (4, H, W) float or None
        The same numbers; None when they can't be brought into that shape.
    finding : Finding or None
        What is wrong, if anything is.
    """
    if values.ndim == 4 and len(values) == 1:
        return oriented_values(values[0])[0], _batch_axis("values", values)
    if values.ndim != 3 or N_STATES not in values.shape:
        return None, Finding(
            "not four states",
            SHAPE_ERROR,
            f"`values` has the shape {values.shape}, and should have ({N_STATES}, H, W).",
            "A map of state labels, a flattened grid, or the probability of being occupied alone.",
            f"Each cell needs the probabilities of FREE, STATIC, DYNAMIC and UNKNOWN: `belief.probability`, "
            f"({N_STATES}, H, W).",
        )
    axes = [axis for axis, size in enumerate(values.shape) if size == N_STATES]
    axis = next((axis for axis in axes if _sums_to_one(values, axis)), axes[0])
    if axis == 0:
        return values, None
    return np.moveaxis(values, axis, 0), Finding(
        "states on the wrong axis",
        SHAPE_ERROR,
        f"`values` has the shape {values.shape}: the {N_STATES} states lie on axis {axis}.",
        "Images and many network libraries have their channels last; here they are first.",
        f"np.moveaxis(values, {axis}, 0). Don't reshape: that shuffles the numbers.",
    )


def oriented_unary(unary: NDArray, grid: tuple[int, int] | None) -> tuple[NDArray | None, Finding | None]:
    """Bring the classes to the first axis, and rows and columns into the order of the grid.

    Parameters
    ----------
    unary : (...) float
        What was handed over as `unary`.
    grid : (int, int) or None
        H and W as `values` has them; None when it has no such shape.

    Returns
    -------
    unary : (C, H, W) float or None
        The same numbers; None when they can't be brought into that shape.
    finding : Finding or None
        What is wrong, if anything is.
    """
    if unary.ndim == 4 and len(unary) == 1:
        return oriented_unary(unary[0], grid)[0], _batch_axis("unary", unary)
    if unary.ndim == 2 or (len(unary) == 1 and unary.dtype.kind in "iub"):
        return _from_two_axes(unary, grid)
    if unary.ndim == 3 and (grid is None or unary.shape[1:] == grid):
        return unary, None
    orders = permutations(range(3)) if unary.ndim == 3 else ()
    order = next((order for order in orders if tuple(unary.shape[axis] for axis in order[1:]) == grid), None)
    if order is None:
        return None, Finding(
            "grids differ",
            SHAPE_ERROR,
            f"`unary` has the shape {unary.shape}, but the grid of `values` has {grid} rows and columns.",
            "The two come from different grids, frames of different sizes, or one was cropped.",
            "Both must be of the same grid: unary (C, H, W) and values (4, H, W).",
        )
    transposed = np.transpose(unary, order)
    return transposed, _wrong_order(unary.shape, order, transposed.shape)


def _wrong_order(shape: tuple[int, ...], order: tuple[int, ...], right: tuple[int, ...]) -> Finding:
    if order[0] == 0:
        name, cause = "rows and columns swapped", "The grid was indexed by (x, y), or width was named before height."
    else:
        name, cause = "classes on the wrong axis", "Images and many network libraries have their channels last."
    return Finding(
        name,
        SHAPE_ERROR,
        f"`unary` has the shape {shape}; with the grid of `values` it should be {right}: the {right[0]} classes on "
        f"axis 0, {right[1]} rows on axis 1, {right[2]} columns on axis 2.",
        cause,
        f"np.transpose(unary, {order}). Don't reshape: that shuffles the numbers.",
    )


def _from_two_axes(unary: NDArray, grid: tuple[int, int] | None) -> tuple[NDArray | None, Finding]:
    """Judge a unary term that has no class axis, or no grid."""
    cells = None if grid is None else grid[0] * grid[1]
    if unary.ndim == 2 and cells in unary.shape and unary.shape != grid:
        classes_first = unary if unary.shape[1] == cells else unary.T
        return classes_first.reshape(-1, *grid), Finding(
            "cells in one row",
            SHAPE_ERROR,
            f"`unary` has the shape {unary.shape}: the {cells:,} cells of the grid lie on one axis.",
            "Other packages, such as pydensecrf, take the unary term with its cells flattened.",
            f"Give it back its grid: unary{'.T' * (classes_first is not unary)}.reshape(-1, {grid[0]}, {grid[1]}).",
        )
    ignored = [int(label) for label in (255, -1) if (unary == label).any()]
    return None, Finding(
        "labels for costs",
        SHAPE_ERROR,
        f"`unary` is an array of {unary.dtype} of shape {unary.shape}, with one number for a cell, from {unary.min()} "
        f"to {unary.max()}" + (f"; {ignored[0]} usually marks cells to ignore." if ignored else "."),
        "A map of labels was handed over, arg-max taken too early. The CRF needs to know how sure each label is.",
        "Hand over the cost of each class, (C, H, W): unary_from_probability(g). If labels are all there is, give the "
        "labelled class a probability such as 0.9 and the others the rest; in cells to ignore, give all the same.",
    )


def reshaped(name: str, shape: tuple[int, ...]) -> Finding:
    """Describe the fault that numbers were reshaped where they should have been transposed.

    Parameters
    ----------
    name : str
        The name of the argument.
    shape : tuple of int
        Its shape.

    Returns
    -------
    Finding
        What was found.
    """
    classes, height, width = shape
    return Finding(
        f"{name} reshaped, not transposed",
        "Labels look shuffled, in stripes; the picture repeats itself several times in the map.",
        f"Along axis 0 `{name}` holds no distributions. As an array of shape {height, width, classes} it would, with "
        "its numbers in the order of memory.",
        "An array with its channels last was brought into this shape by reshape, which keeps the order of the numbers.",
        f"np.moveaxis({name}, -1, 0) of the array of shape {height, width, classes}.",
    )


def _batch_axis(name: str, array: NDArray) -> Finding:
    return Finding(
        "batch axis",
        SHAPE_ERROR,
        f"`{name}` has the shape {array.shape}: an axis of one sample before the others.",
        "Networks take and return batches.",
        f"Hand over {name}[0].",
    )


def _sums_to_one(array: NDArray, axis: int) -> bool:
    return bool(np.abs(array.sum(axis=axis, dtype=np.float64) - 1).max() < 1e-2)
