"""Links from the registers to code and notebooks, for tables that are shown in the folder of notebooks."""

from importlib import import_module

from semgrid_edu.errors import ArgumentError


def find_code(name: str) -> object:
    """Return the function or class that a dotted name stands for.

    Raises
    ------
    ArgumentError
        When there is none.
    """
    module, _, attribute = name.rpartition(".")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError):
        raise ArgumentError("name", "the dotted name of something that can be imported", name) from None


def code_link(name: str) -> str:
    """Link a dotted name to the module that defines it."""
    module = find_code(name).__module__
    return f"[`{name.rpartition('.')[2]}`](../{module.replace('.', '/')}.py)"


def notebook_link(place: str | None, folder: str = "") -> str:
    """Link "notebook#part" to its notebook.

    Parameters
    ----------
    place : str or None
        Such as "02_grids#log-odds", or "deeper/graphical_models#messages" for a companion; None while it is to come.
    folder : str
        Where the notebook lies among the notebooks, such as "exercises/".

    Examples
    --------
    >>> notebook_link("02_grids#update", "exercises/")
    '[02](exercises/02_grids.ipynb), `update`'
    >>> notebook_link("deeper/graphical_models#messages")
    '[graphical models](deeper/graphical_models.ipynb), `messages`'
    """
    if place is None:
        return "to come"
    name, _, part = place.partition("#")
    title = name[:2] if name[:2].isdigit() else name.rpartition("/")[2].replace("_", " ")
    return f"[{title}]({folder}{name}.ipynb), `{part}`"
