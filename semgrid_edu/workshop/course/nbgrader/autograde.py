"""Grading by nbgrader: it takes notebooks, and gives a score and a message for each test cell."""

import copy
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import nbformat
from nbconvert.filters import strip_ansi
from nbformat import NotebookNode
from nbgrader.api import Gradebook, InvalidEntry
from nbgrader.utils import is_grade, is_solution
from sqlalchemy.exc import DatabaseError, SAWarning

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.workshop.course.nbgrader.build import caught_errors, course_api, failure_reason, student_version
from semgrid_edu.workshop.course.notebooks.build import read_percent, write_notebook

PATIENCE = 10
"""How often a submission is tried when another process keeps its grades from being written."""

NOT_THE_FILE = (DataError, DatabaseError, InvalidEntry, KeyboardInterrupt, MemoryError, OSError)
"""Errors of the machine, the gradebook, the reference answers and whoever interrupts: no submission causes them."""


class UngradedError(Exception):
    """Grading failed for a reason that isn't the submission's: it has no grade, and can be graded another time."""


@dataclass(frozen=True)
class GradeSettings:
    """How a class is graded.

    Parameters
    ----------
    timeout : int
        Seconds for a cell.
    memory : int
        Megabytes of memory for a student's code.
    container : tuple of str
        A command that starts a program in a container; () for none.
    seed_by_student : bool
        Whether each student's hidden tests draw inputs of their own.
    """

    timeout: int = 30
    memory: int = 4000
    container: tuple[str, ...] = ()
    seed_by_student: bool = False


@dataclass(frozen=True)
class CellScore:
    """The result of one test cell.

    Parameters
    ----------
    points : float
        What the cell is worth.
    score : float or None
        What the answer earned; None until a person has read the answer.
    message : str
        The error that the student sees; "" without one.
    """

    points: float
    score: float | None
    message: str


def tasks(source: Path) -> dict[str, tuple[str, ...]]:
    """Return the test cells between each answer cell and the next, by the grade_id of the answer cell.

    Parameters
    ----------
    source : Path
        The percent source of an exercise. A written answer is its own test.
    """
    found: dict[str, tuple[str, ...]] = {}
    for cell in read_percent(source).cells:
        name = cell.metadata.get("nbgrader", {}).get("grade_id")
        if is_solution(cell):
            found[name] = (name,) if is_grade(cell) else ()
        elif is_grade(cell):
            found[list(found)[-1]] += (name,)
    return found


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
    notebook = copy.deepcopy(student_version(source))
    cells = {c.metadata.nbgrader.grade_id: c for c in notebook.cells if is_solution(c)}
    for name, text in answers.items():
        if name not in cells:
            raise ArgumentError("answers", f"tasks among {', '.join(cells)}", name)
        cells[name].source = text
    return notebook


def autograde(
    course: Path, assignment: str, submissions: Mapping[str, NotebookNode], timeout: int = 30
) -> dict[str, dict[str, CellScore]]:
    """Hand in notebooks and let nbgrader grade them; return the scores by student and by the test cell's grade_id.

    Parameters
    ----------
    course : Path
        The folder of a course that `build_course` wrote.
    assignment : str
        The exercise, such as "00_tour".
    submissions : mapping of str to NotebookNode
        One notebook per student, by the student's name.
    timeout : int
        The longest that a cell may take, seconds.

    Raises
    ------
    DataError, UngradedError
        As `autograde_one`.
    """
    settings = GradeSettings(timeout=timeout)
    for student, notebook in submissions.items():
        write_notebook(notebook, place(course, "submitted", student, assignment))
        autograde_one(course, assignment, student, settings)
    return {student: _scores(course, assignment, student) for student in submissions}


def autograde_one(
    course: Path, assignment: str, student: str, settings: GradeSettings, submitted: str = "submitted"
) -> None:
    """Let nbgrader grade one submission.

    Parameters
    ----------
    course : Path
        The folder of a course that `build_course` wrote.
    assignment, student : str
        Whose submission.
    settings : GradeSettings
        How it is graded.
    submitted : str
        The folder in the course from which it is taken.

    Raises
    ------
    DataError
        When nbgrader could not grade this file completely: the 0 in its gradebook is then not a score.
    UngradedError
        When it could not for a reason that isn't the file's, such as a full disk or a gradebook that stays locked.
    """
    with course_api(course) as api, warnings.catch_warnings():
        # nbgrader 0.9.6 builds a submission outside its database session.
        warnings.filterwarnings("ignore", "Object of type <Submitted", SAWarning)
        api.config.ExecuteApart.merge(asdict(settings) | {"container": list(settings.container)})
        api.coursedir.submitted_directory = submitted
        for _ in range(PATIENCE):
            with caught_errors(api.log) as errors:
                result = api.autograde(assignment, student)
            if result["success"] or not any(map(_may_pass, errors)):
                break
    if not result["success"]:
        reason = failure_reason(result, errors)
        if not errors or isinstance(errors[-1], NOT_THE_FILE):
            raise UngradedError(reason)
        raise DataError(place(course, submitted, student, assignment), "a notebook that can be graded", reason)


def _may_pass(error: BaseException) -> bool:
    """Return whether another process was in the way: it held the gradebook, or entered the same student first."""
    return isinstance(error, InvalidEntry) or "database is locked" in str(error)


def _scores(course: Path, assignment: str, student: str) -> dict[str, CellScore]:
    """Read a student's scores from the gradebook and the messages from the graded notebook."""
    graded = nbformat.read(place(course, "autograded", student, assignment), as_version=4)
    messages = {c.metadata.nbgrader.grade_id: error_message(c) for c in graded.cells if is_grade(c)}
    with Gradebook(f"sqlite:///{course / 'gradebook.db'}") as gradebook:
        grades = gradebook.find_submission_notebook(assignment, assignment, student).grades
        return {g.name: CellScore(g.max_score, g.auto_score, messages[g.name]) for g in grades}


def error_message(cell: NotebookNode) -> str:
    """Return the errors below a cell, as the student reads them.

    Parameters
    ----------
    cell : NotebookNode
        A test cell that has run.
    """
    errors = [output for output in cell.get("outputs", []) if output.output_type == "error"]
    return "\n".join(f"{error.ename}: {error.evalue or strip_ansi(error.traceback[-1])}" for error in errors)


def place(course: Path, step: str, student: str, assignment: str) -> Path:
    """Return the path of a student's notebook in one of nbgrader's folders.

    Parameters
    ----------
    course : Path
        The folder of the course.
    step : str
        The folder, such as "submitted".
    student, assignment : str
        Whose notebook.
    """
    return course / step / student / assignment / f"{assignment}.ipynb"
