"""What nbgrader gives submissions to an exercise: a score and a message for each test cell, and so for each task."""

from dataclasses import dataclass
from functools import cache

import nbformat
import nbgrader.api
import pytest
from alembic.script import ScriptDirectory
from nbconvert.filters import strip_ansi
from nbgrader.dbutil import ALEMBIC_DIR
from nbgrader.utils import is_grade, is_solution

from semgrid_edu.workshop.course.nbgrader.autograde import GradeSettings, autograde_one, place
from semgrid_edu.workshop.course.nbgrader.gradebook import open_gradebook
from semgrid_edu.workshop.course.notebooks.build import read_percent, write_notebook


@pytest.fixture(scope="session", autouse=True)
def alembic_asked_once():
    """Let nbgrader find the version of its tables here and once: it starts alembic, for seconds, for each gradebook.

    Nor does it compile its queries anew each of the twelve times that it opens a gradebook to grade one notebook.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(nbgrader.api, "get_alembic_version", cache(ScriptDirectory(ALEMBIC_DIR).get_current_head))
        patch.setattr(nbgrader.api, "create_engine", cache(nbgrader.api.create_engine))
        yield


@dataclass(frozen=True)
class CellScore:
    """The result of a test cell; the score is None while an answer waits for a person."""

    points: float
    score: float | None
    message: str


@cache
def tasks(source):
    """Return the test cells of each task by the grade_id of its answer cell; a written answer is its own test."""
    found = {}
    for cell in read_percent(source).cells:
        name = cell.metadata.get("nbgrader", {}).get("grade_id")
        if is_solution(cell):
            found[name] = (name,) if is_grade(cell) else ()
        elif is_grade(cell):
            found[list(found)[-1]] += (name,)
    return found


def autograde(course, assignment, submissions, timeout=30):
    """Hand in a notebook for each student and grade it; return the scores by student and test cell."""
    for student, notebook in submissions.items():
        write_notebook(notebook, place(course, "submitted", student, assignment))
        autograde_one(course, assignment, student, GradeSettings(timeout=timeout))
    return {student: scores(course, assignment, student) for student in submissions}


def scores(course, assignment, student):
    """Read a student's scores from the gradebook and the messages from the graded notebook."""
    graded = nbformat.read(place(course, "autograded", student, assignment), as_version=4)
    messages = {c.metadata.nbgrader.grade_id: error_message(c) for c in graded.cells if is_grade(c)}
    with open_gradebook(course) as gradebook:
        grades = gradebook.find_submission_notebook(assignment, assignment, student).grades
        return {g.name: CellScore(g.max_score, g.auto_score, messages[g.name]) for g in grades}


def error_message(cell):
    """Return the errors below a cell, as the student reads them."""
    errors = [output for output in cell.get("outputs", []) if output.output_type == "error"]
    return "\n".join(f"{error.ename}: {error.evalue or strip_ansi(error.traceback[-1])}" for error in errors)
