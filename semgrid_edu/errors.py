"""Errors that name the file or argument, what was expected and what was found."""

from pathlib import Path


class ArgumentError(ValueError):
    """A function was called with something it can't use.

    Parameters
    ----------
    name : str
        The argument that can't be used.
    expected, found : object
        What the function takes, and what it got instead.

    Examples
    --------
    >>> raise ArgumentError("cell", "a positive size in metres", -0.2)
    Traceback (most recent call last):
    semgrid_edu.errors.ArgumentError: cell: expected a positive size in metres, found -0.2
    """

    def __init__(self, name: str, expected: object, found: object) -> None:
        super().__init__(name, expected, found)  # not the sentence, so that the error can be pickled

    def __str__(self) -> str:
        """Return all three in one sentence."""
        return "{}: expected {}, found {}".format(*self.args)


class DataError(ValueError):
    """A file is missing, damaged or not what its place says it is.

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
        """Return all three in one sentence."""
        return "{}: expected {}, found {}".format(*self.args)
