"""Checks of a student's answer: arrays or numbers that can be compared, and how much memory it needs."""

import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def answer_array(result: Any, name: str = "it", dtype: type = float) -> NDArray:
    """Return the result of an answer as an array, or explain in one sentence why it isn't one.

    Parameters
    ----------
    result : Any
        What the answer returned: an array, a number, or lists and tuples of numbers, however deep.
    name : str
        The subject of the sentence: the name of the function to write, or a part of its result.
    dtype : type
        The type of the array's entries.

    Returns
    -------
    NDArray
        A new array with the result's numbers.

    Raises
    ------
    AssertionError
        When the result is None, or isn't an array of numbers.

    Examples
    --------
    >>> answer_array([[1, 2], (3, 4)], "locate").shape
    (2, 2)
    """
    assert result is not None, f"{name} returned nothing: did you forget `return`?"
    try:
        return np.array(result, dtype=dtype)
    except (TypeError, ValueError):
        kind = type(result).__name__  # raised below, so that the student doesn't see numpy's error as well
    hint = ": are its rows equally long?" if isinstance(result, list | tuple) else ""
    raise AssertionError(f"{name} returned no array of numbers but a {kind} that holds something else{hint}")


def answer_arrays(result: Any, n_arrays: int, name: str = "it") -> list[NDArray]:
    """Return the result of an answer as several arrays, or explain in one sentence why it isn't.

    Parameters
    ----------
    result : Any
        What the answer returned: a tuple or list of arrays, as `answer_array` takes them.
    n_arrays : int
        How many there must be.
    name : str
        The subject of the sentence, as in `answer_array`.

    Returns
    -------
    list of NDArray
        New arrays with the results' numbers.

    Raises
    ------
    AssertionError
        When the result is None, has another length, or holds anything but arrays of numbers.
    """
    assert result is not None, f"{name} returned nothing: did you forget `return`?"
    found = len(result) if isinstance(result, tuple | list) else 1
    assert found == n_arrays, f"{name} must return {n_arrays} arrays, separated by commas"
    return [answer_array(part, name) for part in result]


def answer_number(result: Any, name: str = "it") -> float:
    """Return the result of an answer as one number, or explain in one sentence why it isn't one.

    Parameters
    ----------
    result : Any
        What the answer returned: a number, or one number in an array or a list.
    name : str
        The subject of the sentence, as in `answer_array`.

    Returns
    -------
    float
        The number.

    Raises
    ------
    AssertionError
        When the result is None or not exactly one number.
    """
    numbers = answer_array(result, name)
    # The number of values might reveal a hidden input, because hidden tests show this message too.
    assert numbers.size == 1, f"{name} returned {'several numbers' if numbers.size else 'nothing'} instead of one"
    return numbers.item()


def peak_megabytes(function: Callable, *arguments: Any) -> tuple[Any, float]:
    """Call a function, and measure its peak memory.

    Parameters
    ----------
    function : callable
        The function. When it works in another process, as a student's answer does while it is graded, it has a method
        `peak_megabytes` that measures there.
    *arguments
        Its arguments.

    Returns
    -------
    result
        What the function returns.
    megabytes : float
        The increase of the memory held by Python's allocators (numpy's included) to its peak, in 10^6 bytes.
    """
    if hasattr(function, "peak_megabytes"):
        return function.peak_megabytes(*arguments)
    tracemalloc.start()
    try:
        return function(*arguments), tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()
