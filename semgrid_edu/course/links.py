"""Links to code and notebooks: in the registers' tables, shown in the folder of notebooks, and in exercises."""

import re
from importlib import import_module

from semgrid_edu.errors import ArgumentError


def find_code(name: str) -> object:
    """Return the function or class that a dotted name stands for.

    Parameters
    ----------
    name : str
        A dotted name, such as "semgrid_edu.camera.project".

    Returns
    -------
    object
        The function or class.

    Raises
    ------
    ArgumentError
        When nothing of that name can be imported.
    """
    module, _, attribute = name.rpartition(".")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError):
        raise ArgumentError("name", "the dotted name of something that can be imported", name) from None


def code_link(name: str) -> str:
    """Link a function or class to the module that defines it.

    Parameters
    ----------
    name : str
        Its dotted name, such as "semgrid_edu.camera.project".

    Returns
    -------
    str
        A link in Markdown.

    Raises
    ------
    ArgumentError
        When nothing of that name can be imported.
    """
    module = find_code(name).__module__
    return f"[`{name.rpartition('.')[2]}`](../{module.replace('.', '/')}.py)"


def notebook_link(place: str | None, folder: str = "") -> str:
    """Link a part of a notebook to the notebook.

    Parameters
    ----------
    place : str or None
        Notebook and part, such as "02_grids#log-odds" or, for a companion, "deeper/graphical_models#messages"; None
        while it is to come.
    folder : str
        Folder of the notebook inside the folder of notebooks, such as "exercises/".

    Returns
    -------
    str
        A link in Markdown, and the name of the part; "to come" for None.

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


def point_links(text: str, lectures: str) -> str:
    """Let an exercise link to the lectures where its students find them.

    Parameters
    ----------
    text : str
        A text cell of an exercise. Its links to notebooks begin with `../`, the folder of notebooks.
    lectures : str
        The address of the folder that holds `00_tour.ipynb`, or its path from a student's copy of the exercise; "" when
        students can't open it. Then the link's text stays alone.

    Returns
    -------
    str
        The text with links that live.

    Raises
    ------
    ArgumentError
        When the folder can't stand in a link.

    Examples
    --------
    >>> point_links("The lecture is [00: the tour](../00_tour.ipynb).", "https://course.example/lectures")
    'The lecture is [00: the tour](https://course.example/lectures/00_tour.ipynb).'
    >>> point_links("The lecture is [00: the tour](../00_tour.ipynb).", "")
    'The lecture is 00: the tour.'
    """
    if re.search(r"[\s()<>]", lectures):
        raise ArgumentError("lectures", "an address or a path without blanks, parentheses and < or >", lectures)
    new = rf"[\1]({lectures.rstrip('/')}/\2)" if lectures else r"\1"
    return re.sub(r"\[([^\]]*)\]\(\.\./([^)]*)\)", lambda link: link.expand(new), text)
