"""The two registers of the course, in `registers.toml`: the paper's equations, and each stage's graphical model."""

from dataclasses import dataclass
from importlib import import_module

from semgrid_edu.errors import ArgumentError
from semgrid_edu.storage.files import table_beside


@dataclass(frozen=True)
class Equation:
    """One equation or numbered procedure of the paper, and where it stands in code, lectures and exercises.

    Parameters
    ----------
    id : str
        "eq-N" for the paper's equation (N); a short name for a procedure.
    section : str
        Number of the paper's section, such as "3.2".
    title : str
        What it says, in a few words.
    literal : str
        Dotted name of the code that reads like the equation.
    fast : str or None
        Dotted name of what the pipeline calls; None where there is only the literal code.
    lecture : str or None
        "NN_name#tag": the notebook and the tag of the cell that derives it; None while that is to come.
    exercise : str or None
        "NN_name#task": the exercise and the grade_id of its answer cell; None while that is to come.
    """

    id: str
    section: str
    title: str
    literal: str
    fast: str | None = None
    lecture: str | None = None
    exercise: str | None = None


@dataclass(frozen=True)
class StageModel:
    """One stage of the system as a graphical model, small enough for exact inference.

    Parameters
    ----------
    id : str
        A short name, such as "bof".
    title : str
        What is modelled, in a few words.
    model : str
        Dotted name of the function that builds the model.
    check : str
        Where exact inference on the model is compared with what the package does: a test as
        "tests/folder/test_file.py::test_name", or the tag of a cell as "NN_name#tag".
    lecture : str or None
        "NN_name#tag": the cell that draws the graph; None while that is to come.
    """

    id: str
    title: str
    model: str
    check: str
    lecture: str | None = None


_tables = table_beside(__file__)

EQUATIONS = tuple(Equation(**entry) for entry in _tables["equation"])
"""All equations and procedures, in the order of the paper."""

STAGES = tuple(StageModel(**entry) for entry in _tables["stage"])
"""All stages in the order of the pipeline, and the whole system last."""


def find_code(name: str) -> object:
    """Return the function or class that a dotted name stands for.

    Parameters
    ----------
    name : str
        A dotted name, such as "semgrid_edu.camera.project".

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


def notebook_link(place: str | None, folder: str = "") -> str:
    """Link a part of a notebook to the notebook, in Markdown.

    Parameters
    ----------
    place : str or None
        Notebook and part, such as "02_grids#log-odds" or, for a companion, "deeper/graphical_models#messages"; None
        while it is to come.
    folder : str
        Folder of the notebook inside the folder of notebooks, such as "exercises/".

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


def equation_table() -> str:
    """Return the equations as a Markdown table, whose links work in the folder of notebooks."""
    rows = ["| | paper | what | literal code | fast code | lecture | exercise |", "|---|---|---|---|---|---|---|"]
    for entry in EQUATIONS:
        number = f"({entry.id[3:]})" if entry.id.startswith("eq-") else ""
        code = [_code_link(entry.literal), _code_link(entry.fast) if entry.fast else "the same"]
        places = [notebook_link(entry.lecture), notebook_link(entry.exercise, "exercises/")]
        rows.append("| " + " | ".join([number, entry.section, entry.title, *code, *places]) + " |")
    return "\n".join(rows)


def stage_table() -> str:
    """Return the stages as a Markdown table, whose links work in the folder of notebooks."""
    rows = ["| stage | its graphical model | its exact check | lecture |", "|---|---|---|---|"]
    for stage in STAGES:
        rows.append(f"| {stage.title} | {_code_link(stage.model)} | {_check(stage)} | {notebook_link(stage.lecture)} |")
    return "\n".join(rows)


def _code_link(name: str) -> str:
    """Link a function or class to the module that defines it."""
    return f"[`{name.rpartition('.')[2]}`](../{find_code(name).__module__.replace('.', '/')}.py)"


def _check(stage: StageModel) -> str:
    """Link a stage's check, a test or a cell of a notebook."""
    path, is_test, test = stage.check.partition("::")
    return f"[`{test}`](../{path})" if is_test else notebook_link(stage.check)
