"""A student's own stages: read from a Python file, and what error messages say of them."""

import inspect
import sys
import traceback
from collections.abc import Callable
from functools import partial
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from semgrid_edu.errors import ArgumentError, DataError, sum_to_one
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.pipeline.stages import REMEMBER, STAGES, Stages

NAMES = ", ".join(STAGES | REMEMBER)
"""The names of the stages, for messages."""


def load_stages(path: str | Path) -> Stages:
    """Read stages from a Python file: its functions named track, segment, sample, fuse, refine and remember.

    Parameters
    ----------
    path : path-like
        The file, which is executed. While it is, Python also looks for imports in its folder, so the file can import
        others that lie beside it.

    Returns
    -------
    Stages
        The stages of the file; the others are left out.

    Raises
    ------
    DataError
        When there is no such file, Python can't import it, it has none of these functions, or one of them doesn't
        take the right number of arguments.

    Examples
    --------
    >>> list(run_pipeline(drive, load_stages("my_stages.py")))                          # doctest: +SKIP
    """
    path = Path(path)
    if path.suffix != ".py" or not path.is_file():
        found = "another file" if path.is_file() else "a folder" if path.is_dir() else "no such file"
        raise DataError(path, f"a Python file with functions named {NAMES}", found)
    module = _imported(path)
    found = {name: getattr(module, name) for name in STAGES | REMEMBER if hasattr(module, name)}
    if not found:
        others = [name for name, value in vars(module).items() if callable(value) and not name.startswith("_")]
        raise DataError(path, f"at least one function named {NAMES}", ", ".join(others) or "no function at all")
    try:
        return Stages(**found)
    except ArgumentError as error:
        name, expected, wrong = error.args
        raise DataError(path, f"{name} to be {expected}", wrong) from error


def _imported(path: Path) -> ModuleType:
    """Execute a file as a module; meanwhile its own folder is searched for imports too."""
    spec = spec_from_file_location(f"_stages_in_{path.stem}", path)
    module = module_from_spec(spec)
    sys.modules[spec.name] = module  # a dataclass in the file looks up its module there
    searched = sys.path[:]
    sys.path.insert(0, str(path.resolve().parent))
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise DataError(path, "a file that Python can import", in_short(error, spec.origin)) from error
    finally:
        sys.path[:] = searched
    return module


AXES = {"classes": "class", "states": "state"}
"""What the first axis of an array of probabilities is called."""


def where(function: Callable) -> str:
    """Say where a function is written: "my_stages.py, line 12", or the class of an object without a line of Python.

    Parameters
    ----------
    function : callable
        A function, or an object that can be called.
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
    while isinstance(function, partial):
        function = function.func
    function = inspect.unwrap(function)
    return getattr(function, "__code__", None) or getattr(type(function).__call__, "__code__", None)


def _place(file: str, line: int) -> str:
    """Name a line of a file, or of a cell of a notebook, whose file has a name that means nothing to a student."""
    return f"{'a cell of the notebook' if 'ipykernel' in file else Path(file).name}, line {line}"


def kind_of(value: object) -> str:
    """Name what a stage returned in place of an array, and the usual cause, as the end of "found ...".

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
        return "a generator: this stage returns its result, only track yields"
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
    if (values <= 0).all() and sum_to_one(np.exp(values).sum(axis=0)):
        return "are these log-probabilities? Return np.exp of them"
    return f"did you normalise over the {AXES[axis]} axis (axis 0)?"


def log_sum_hint(values: NDArray, total: float) -> str:
    """Return the probable cause of log-probabilities whose exponentials don't sum to 1.

    Parameters are those of `sum_hint`.
    """
    if np.isnan(total):
        return "is there a logarithm of a negative number?"
    if (values >= 0).all() and sum_to_one(values.sum(axis=0)):
        return "are these probabilities? Return np.log of them"
    return "are these scores? Subtract scipy.special.logsumexp(scores, axis=0)"
