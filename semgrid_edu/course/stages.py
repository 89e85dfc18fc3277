"""The register's second table: each stage of the system, its graphical model, and the exact check that it passes."""

from dataclasses import dataclass

from semgrid_edu.course.links import code_link, notebook_link


@dataclass(frozen=True)
class StageModel:
    """One stage as a graphical model, small enough for exact inference.

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


STAGES: tuple[StageModel, ...] = ()
"""In the order of the pipeline, the whole system last."""


def stage_table() -> str:
    """Return the stages as a Markdown table, with links that work from the folder of notebooks."""
    rows = ["| stage | its graphical model | its exact check | lecture |", "|---|---|---|---|"]
    for stage in STAGES:
        rows.append(f"| {stage.title} | {code_link(stage.model)} | {_check(stage)} | {notebook_link(stage.lecture)} |")
    return "\n".join(rows)


def _check(stage: StageModel) -> str:
    """Link a stage's check, a test or a cell of a notebook."""
    path, is_test, test = stage.check.partition("::")
    return f"[`{test}`](../{path})" if is_test else notebook_link(stage.check)
