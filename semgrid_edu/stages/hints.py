"""What the stages are called, and what an error message can guess about a stage that went wrong."""

import inspect
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import CodeType

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from semgrid_edu.errors import ArgumentError
from semgrid_edu.occupancy import N_STATES

STAGES = {
    "track": ("frames", "spec"),
    "segment": ("image",),
    "sample": ("s",),
    "fuse": ("p", "o"),
    "refine": ("log_g", "o"),
}
"""The names of the paper's stages, in their order, and of the arguments that a function for each of them takes."""

REMEMBER = {"remember": ("views", "spec")}
"""The stage that the paper leaves out: without it, classes are forgotten at every frame."""


STEPPED = {"track": "frame", "remember": "view"}
"""The stages that may also be objects with a method `step`, and what it takes."""


def check_usage(name: str, stage: object, takes: tuple[str, ...]) -> None:
    """Reject what can't be called as a stage is.

    Parameters
    ----------
    name : str
        Name of the stage, a key of `STAGES` or `REMEMBER`.
    stage : object
        A function, or for a stage with a memory an object with `step(frame)`.
    takes : tuple of str
        The names of the arguments that it is called with.

    Raises
    ------
    ArgumentError
        When it is neither, or takes another number of arguments.
    """
    usage = f"a function {name}({', '.join(takes)})"
    if name in STEPPED:
        usage += f" or an object with step({STEPPED[name]})"
    if isinstance(stage, type):
        raise ArgumentError(name, usage, f"the class {stage.__name__} itself: write {name} = {stage.__name__}(...)")
    if name in STEPPED and hasattr(stage, "step"):
        return
    if not callable(stage):
        raise ArgumentError(name, usage, f"a {type(stage).__name__}")
    try:
        signature = inspect.signature(stage)
    except ValueError:  # some functions written in C don't say what they take
        return
    try:
        signature.bind(*takes)
    except TypeError as error:
        raise ArgumentError(name, usage, f"{name}{signature}") from error


def where(function: Callable) -> str:
    """Say where a function is written: "my_stages.py, line 12", or the class of an object without a line of Python.

    Parameters
    ----------
    function : callable
        A function, or an object that can be called or stepped.
    """
    code = _code(function)
    if code is None:
        return f"an object of class {type(function).__name__}"
    return _place(code.co_filename, code.co_firstlineno)


def file_of(function: Callable) -> str:
    """Return the path of the file that a function is written in; "" when it can't be known.

    Parameters are those of `where`.
    """
    code = _code(function)
    return code.co_filename if code else ""


def in_short(error: BaseException, file: str) -> str:
    """Describe an exception in one line: class, message, and where it passed through a file.

    Parameters
    ----------
    error : BaseException
        The exception.
    file : str
        The file of interest, whose last line is named.
    """
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    first_line = str(error).strip().partition("\n")[0]
    message = f"{type(error).__name__}: {first_line}" if first_line else type(error).__name__
    return f"{message} ({_place(file, lines[-1])})" if lines else message


def _code(function: Callable) -> CodeType | None:
    """Return the code of a function, or of the `step` or `__call__` of an object."""
    while isinstance(function, partial):
        function = function.func
    function = inspect.unwrap(function)
    method = getattr(type(function), "step", type(function).__call__)
    return getattr(function, "__code__", None) or getattr(method, "__code__", None)


def _place(file: str, line: int) -> str:
    """Name a line of a file, or of a cell of a notebook, whose file name means nothing to a student."""
    return f"{'a cell of the notebook' if 'ipykernel' in file else Path(file).name}, line {line}"


def kind_of(value: object) -> str:
    """Name what a stage returned instead of an array, and the usual cause, as the end of "found ...".

    Parameters
    ----------
    value : object
        Anything but an array.
    """
    if value is None:
        return "None: is the `return` missing?"
    if isinstance(value, Tensor):
        return "a torch Tensor: end with `.detach().numpy()`"
    if inspect.isgenerator(value):
        return "a generator: this stage returns its result, only track and remember yield"
    return type(value).__name__


def shape_hint(found: tuple[int, ...], expected: tuple[int, ...]) -> str:
    """Return the probable cause of a wrong shape as the end of a sentence, with its colon; "" without a guess.

    Parameters
    ----------
    found, expected : tuple of int
        The shape of what a stage returned, and the shape that it should have.

    Examples
    --------
    >>> shape_hint((355, 155, 14), (14, 355, 155))
    ': is the class axis last? np.moveaxis(x, -1, 0) moves it to the front'
    """
    axis = {2: "velocity", N_STATES: "state"}.get(expected[0], "class")
    if found == (*expected[1:], expected[0]):
        return f": is the {axis} axis last? np.moveaxis(x, -1, 0) moves it to the front"
    if found == (1, *expected):
        return ": is this a batch of one? Return its only entry, x[0]"
    if found == expected[1:]:
        return f": is this one label in each place? Return a number for each {axis}"
    if found == (expected[0], *expected[:0:-1]):
        return ": are rows and columns swapped?"
    if sorted(found) == sorted(expected):
        return ": are the axes in another order?"
    return ""


def sum_hint(values: NDArray, total: float, axis: str) -> str:
    """Return the probable cause of probabilities that don't sum to 1, as a question to the student.

    Parameters
    ----------
    values : (K, H, W) float
        The values of all cells.
    total : float
        The sum in a cell where it is wrong; may be NaN.
    axis : str
        What the first axis holds: "classes" or "states".
    """
    if np.isnan(total):
        return "was something divided by a sum of 0?"
    if (values <= 0).all() and _sum_to_one(np.exp(values)):
        return "are these log-probabilities? Return np.exp of them"
    return f"did you normalise over the {'class' if axis == 'classes' else 'state'} axis (axis 0)?"


def log_sum_hint(values: NDArray, total: float) -> str:
    """Return the probable cause of log-probabilities whose exponentials don't sum to 1.

    Parameters
    ----------
    values : (C, H, W) float
        The values of all cells.
    total : float
        The sum of exponentials in a cell where it is wrong; may be NaN.
    """
    if np.isnan(total):
        return "is there a logarithm of a negative number?"
    if (values >= 0).all() and _sum_to_one(values):
        return "are these probabilities? Return np.log of them"
    return "are these scores? Subtract scipy.special.logsumexp(scores, axis=0)"


def _sum_to_one(values: NDArray) -> bool:
    """Tell whether nearly all cells of (K, H, W) sum to nearly 1."""
    return bool(np.mean(np.abs(values.sum(axis=0) - 1) <= 0.01) >= 0.99)
