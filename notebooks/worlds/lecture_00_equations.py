"""The paper's equations, with the code, lecture and exercise of each, from `lecture_00_equations.toml`."""

import tomllib
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path


@dataclass(frozen=True)
class Equation:
    """One equation or numbered procedure of the paper, and where it is in code, lectures and exercises.

    Parameters
    ----------
    id : str
        "eq-N" for the paper's equation (N); a short name for a procedure.
    section : str
        Number of the paper's section, such as "3.2".
    title : str
        Its meaning, in a few words.
    literal : str
        Dotted name of the code that reads like the equation.
    fast : str, optional
        Dotted name of its fast twin.
    lecture : str
        "NN_name#tag": the notebook and the tag of the cell that derives it.
    exercise : str, optional
        "NN_name#task": the exercise and the grade_id of its answer cell; empty if it has no exercise yet.
    """

    id: str
    section: str
    title: str
    literal: str
    fast: str | None = None
    lecture: str | None = None
    exercise: str | None = None


EQUATIONS = tuple(
    Equation(**entry)
    for entry in tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))["equation"]
)
"""All equations and procedures, in the order of the paper."""


def find_code(name: str) -> object:
    """Return the function or class with a dotted name, such as "semgrid_edu.camera.project"."""
    module, _, attribute = name.rpartition(".")
    return getattr(import_module(module), attribute)


def notebook_link(place: str | None, folder: str = "") -> str:
    """Link a part of a notebook to the notebook, in Markdown; `folder` is its folder inside the folder of notebooks.

    >>> notebook_link("02_grids#update", "exercises/")
    '[02](exercises/02_grids.ipynb), `update`'
    >>> notebook_link("01b_graphical_models#messages")
    '[01b](01b_graphical_models.ipynb), `messages`'
    """
    if place is None:
        return "to come"
    name, _, part = place.partition("#")
    title = name.partition("_")[0] if name[:2].isdigit() else name.rpartition("/")[2].replace("_", " ")
    return f"[{title}]({folder}{name}.ipynb), `{part}`"


def equation_table() -> str:
    """Return the equations as a Markdown table, whose links work in the folder of notebooks."""
    rows = ["| | paper | what | literal code | fast code | lecture | exercise |", "|---|---|---|---|---|---|---|"]
    for entry in EQUATIONS:
        number = f"({entry.id[3:]})" if entry.id.startswith("eq-") else ""
        code = [_code_link(entry.literal), _code_link(entry.fast) if entry.fast else "the same"]
        places = [notebook_link(entry.lecture), notebook_link(entry.exercise, "exercises/")]
        rows.append("| " + " | ".join([number, entry.section, entry.title, *code, *places]) + " |")
    return "\n".join(rows)


def _code_link(name: str) -> str:
    """Link a function or class to the module that defines it."""
    return f"[`{name.rpartition('.')[2]}`](../{find_code(name).__module__.replace('.', '/')}.py)"
