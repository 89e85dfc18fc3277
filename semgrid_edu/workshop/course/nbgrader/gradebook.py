"""What has been graded: whether all of a submission has, and what the gradebook says of it."""

import csv
import io
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, field, fields
from pathlib import Path

from nbgrader.api import Gradebook, MissingEntry

from semgrid_edu.storage.files import write_text
from semgrid_edu.workshop.course.nbgrader.autograde import place
from semgrid_edu.workshop.course.nbgrader.preprocessors import CRASHED
from semgrid_edu.workshop.course.nbgrader.submissions import submissions

GRADED = "graded.csv"
"""The file with one line for each submission."""

UNFINISHED = "unfinished"
"""The folder with an empty file for each submission whose grading has begun and not ended, also when it was killed."""


@dataclass(frozen=True)
class Graded:
    """The result of one submission.

    Parameters
    ----------
    student, assignment : str
        Whose it is.
    score, points : float
        What it has so far, and what it could have.
    to_read : int
        Written answers that wait for a person.
    note : str
        What ended Python or could not be read; "" when all went well.
    """

    student: str
    assignment: str
    score: float
    points: float
    to_read: int
    note: str = field(default="")


@contextmanager
def unfinished(course: Path, assignment: str, student: str) -> Iterator[None]:
    """Mark a submission as unfinished while a block grades it: when the block is killed, the mark stays.

    Parameters
    ----------
    course : Path
        The course.
    assignment, student : str
        Whose submission. When the block fails, what it has left of it is deleted.
    """
    mark = _mark(course, assignment, student)
    try:
        write_text(mark, "")
        yield
        mark.unlink(missing_ok=True)
    except BaseException:
        forget(course, assignment, student)
        raise


def forget(course: Path, assignment: str, student: str) -> None:
    """Delete what an unfinished grading has left: for nbgrader, too, the submission then isn't graded.

    Parameters
    ----------
    course : Path
        The course.
    assignment, student : str
        Whose submission; one that isn't marked as unfinished stays as it is.
    """
    mark = _mark(course, assignment, student)
    if mark.exists():
        shutil.rmtree(place(course, "autograded", student, assignment).parent, ignore_errors=True)
        mark.unlink(missing_ok=True)


def _mark(course: Path, assignment: str, student: str) -> Path:
    """Return the empty file that is there while a submission is being graded."""
    return course / UNFINISHED / student / assignment


def is_graded(course: Path, assignment: str, student: str) -> bool:
    """Return whether a submission has been graded, all of it and as it is now.

    Parameters
    ----------
    course : Path
        The course.
    assignment, student : str
        Whose submission.
    """
    if not _is_up_to_date(course, assignment, student):
        return False
    with open_gradebook(course) as gradebook:
        return _has_scores(gradebook, assignment, student)


def _is_up_to_date(course: Path, assignment: str, student: str) -> bool:
    """Return whether nbgrader has made its whole notebook of a submission after that was handed in."""
    submitted, graded = (place(course, step, student, assignment) for step in ("submitted", "autograded"))
    if _mark(course, assignment, student).exists():
        return False
    return graded.exists() and graded.stat().st_mtime >= submitted.stat().st_mtime


def _has_scores(gradebook: Gradebook, assignment: str, student: str) -> bool:
    """Return whether every test cell of a submission has a score, or waits for a person."""
    try:
        grades = gradebook.find_submission_notebook(assignment, assignment, student).grades
    except MissingEntry:
        return False
    return all(grade.needs_manual_grade or (grade.auto_score, grade.manual_score) != (None, None) for grade in grades)


def result_of(course: Path, assignment: str, student: str) -> Graded:
    """Read what a graded submission has from the gradebook.

    Parameters
    ----------
    course : Path
        The course.
    assignment, student : str
        Whose submission.

    Returns
    -------
    Graded
        Its result.
    """
    with open_gradebook(course) as gradebook:
        return _row(gradebook, assignment, student)


def _row(gradebook: Gradebook, assignment: str, student: str) -> Graded:
    """Read what a submission has from the gradebook."""
    found = gradebook.find_submission_notebook(assignment, assignment, student)
    crashes = [comment.auto_comment for comment in found.comments if (comment.auto_comment or "").startswith(CRASHED)]
    to_read = sum(grade.needs_manual_grade for grade in found.grades)
    return Graded(student, assignment, found.score, found.max_score, to_read, "; ".join(dict.fromkeys(crashes)))


def open_gradebook(course: Path) -> Gradebook:
    """Open the gradebook of a course.

    Parameters
    ----------
    course : Path
        The course.

    Returns
    -------
    Gradebook
        nbgrader's, which closes with its `with` block.
    """
    return Gradebook(f"sqlite:///{course / 'gradebook.db'}")


def write_graded(course: Path) -> Path:
    """Write what all submissions have so far, one line each, as a spreadsheet reads it.

    Parameters
    ----------
    course : Path
        The course.

    Returns
    -------
    Path
        The file, `graded.csv` in the course.
    """
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(column.name for column in fields(Graded))
    with open_gradebook(course) as gradebook:
        for one in submissions(course):
            if _is_up_to_date(course, *one) and _has_scores(gradebook, *one):
                table.writerow(astuple(_row(gradebook, *one)))
    write_text(course / GRADED, text.getvalue())
    return course / GRADED
