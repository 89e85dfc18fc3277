"""The libraries of the optional extra `simulation`, loaded when a street is built: trimesh and embreex."""

from importlib import import_module
from types import ModuleType


class MissingExtraError(ImportError):
    """The simulator was asked for a street, and one of its libraries isn't installed."""


def needed(name: str) -> ModuleType:
    """Import a library of the extra `simulation`.

    Parameters
    ----------
    name : str
        The module, such as "trimesh.creation".

    Raises
    ------
    MissingExtraError
        When it isn't installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        library = name.partition(".")[0]
        raise MissingExtraError(f"the simulator needs {library}: pip install 'semgrid_edu[simulation]'") from error
