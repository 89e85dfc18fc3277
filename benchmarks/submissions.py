"""Submissions as students would hand them in, for the benchmark of grading and for tests."""

import copy
from collections.abc import Mapping
from pathlib import Path

from nbformat import NotebookNode
from nbgrader.utils import is_solution

from semgrid_edu.errors import ArgumentError
from semgrid_edu.workshop.course.nbgrader import build
from semgrid_edu.workshop.course.notebooks.build import read_percent


def reference_answers(source: Path) -> dict[str, str]:
    """Return the text of each answer cell of an exercise, by its grade_id.

    Parameters
    ----------
    source : Path
        The percent source of the exercise.
    """
    return {c.metadata.nbgrader.grade_id: c.source for c in read_percent(source).cells if is_solution(c)}


def submission(source: Path, answers: Mapping[str, str]) -> NotebookNode:
    """Fill in the student version of an exercise, as a student would before handing it in.

    Parameters
    ----------
    source : Path
        The percent source of the exercise.
    answers : mapping of str to str
        The new text of answer cells, by grade_id. The other cells stay as students get them.

    Raises
    ------
    ArgumentError
        When an answer belongs to no cell.
    """
    notebook = copy.deepcopy(build.student_version(source))
    cells = {c.metadata.nbgrader.grade_id: c for c in notebook.cells if is_solution(c)}
    for name, text in answers.items():
        if name not in cells:
            raise ArgumentError("answers", f"tasks among {', '.join(cells)}", name)
        cells[name].source = text
    return notebook
