"""A whole class: every submission that was collected, graded by nbgrader on all cores."""

import csv
import io
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import astuple, dataclass, field, fields
from glob import has_magic
from multiprocessing import get_context
from pathlib import Path

import nbformat
from nbformat.v4 import new_markdown_cell
from nbgrader.api import Gradebook, MissingEntry
from tqdm import tqdm

from semgrid_edu.course.exercises import MARKER
from semgrid_edu.course.grading import GradeSettings, autograde_one, place
from semgrid_edu.course.isolation.limits import Limits
from semgrid_edu.course.isolation.process import StudentProcess
from semgrid_edu.course.nbgrader_steps import CRASHED
from semgrid_edu.course.notebooks import write_notebook
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import write_text

UNREADABLE = "unreadable"
"""The folder with notebooks that stand in for files that can't be read."""

LARGEST = 100_000_000
"""Bytes of a submission with all its files."""

GRADED = "graded.csv"
"""The file with one line for each submission."""


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


def submissions(course: Path, assignments: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Return what was handed in.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote.
    assignments : sequence of str
        Only these; all when empty.

    Returns
    -------
    list of (str, str)
        Assignment and student of each file `submitted/STUDENT/ASSIGNMENT/ASSIGNMENT.ipynb`.

    Raises
    ------
    DataError
        When the folder is no course.
    ArgumentError
        When there is no such assignment.
    """
    if not (course / MARKER).is_file():
        raise DataError(course, f"a course with its {MARKER}; `semgrid-edu course build` writes one", "none")
    known = sorted(folder.name for folder in (course / "source").iterdir())
    if unknown := set(assignments) - set(known):
        raise ArgumentError("assignments", f"some of {', '.join(known)}", ", ".join(sorted(unknown)))
    found = (path.parent for path in (course / "submitted").glob("*/*/*.ipynb") if path.stem == path.parent.name)
    return sorted((at.name, at.parent.name) for at in found if at.name in (assignments or known))


def grade_course(
    course: Path,
    settings: GradeSettings,
    assignments: Sequence[str] = (),
    again: bool = False,
    workers: int = 1,
) -> Iterator[Graded]:
    """Grade what was handed in and isn't graded yet; interrupted, it goes on when it is called again.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote.
    settings : GradeSettings
        How.
    assignments : sequence of str
        Only these; all when empty.
    again : bool
        Whether to grade also what is graded already.
    workers : int
        How many submissions are graded at the same time.

    Yields
    ------
    Graded
        One submission after the other, as they end.

    Raises
    ------
    DataError
        When the folder is no course, or a reference answer doesn't pass its own tests.
    ArgumentError
        When there is no such assignment.
    """
    course = course.resolve()
    wanted = [one for one in submissions(course, assignments) if again or not is_graded(course, *one)]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        waiting = [pool.submit(grade_one, course, *one, settings) for one in wanted]
        try:
            for done in tqdm(as_completed(waiting), "submissions", len(waiting)):
                yield done.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def missing_limits(settings: GradeSettings) -> list[str]:
    """Return what this system can't limit for students' code.

    Parameters
    ----------
    settings : GradeSettings
        How a class is graded.

    Returns
    -------
    list of str
        Of `limits.PARTS`; empty with a container, whose own command says what is limited.
    """
    if settings.container:
        return []
    with tempfile.TemporaryDirectory() as nothing:
        process = StudentProcess(Limits(memory=settings.memory), Path(nothing))
        process.stop()
    return process.unlimited


def is_graded(course: Path, assignment: str, student: str) -> bool:
    """Return whether a submission has been graded, all of it and as it is now.

    Parameters
    ----------
    course : Path
        The course.
    assignment, student : str
        Whose submission.
    """
    submitted, graded = (place(course, step, student, assignment) for step in ("submitted", "autograded"))
    if not graded.exists() or graded.stat().st_mtime < submitted.stat().st_mtime:
        return False
    with _gradebook(course) as gradebook:
        try:
            grades = gradebook.find_submission_notebook(assignment, assignment, student).grades
        except MissingEntry:
            return False
        scores = [(grade.auto_score, grade.manual_score) for grade in grades if not grade.needs_manual_grade]
        return (None, None) not in scores


def grade_one(course: Path, assignment: str, student: str, settings: GradeSettings) -> Graded:
    """Grade one submission; a file that can't be read is graded as an empty one, and the note says so.

    Parameters
    ----------
    course : Path
        The course.
    assignment, student : str
        Whose submission.
    settings : GradeSettings
        How.

    Returns
    -------
    Graded
        The result.

    Raises
    ------
    DataError
        When nbgrader can't grade even an empty submission.
    """
    path = place(course, "submitted", student, assignment)
    if has_magic(student):
        note = f"{CRASHED}nbgrader takes * ? [ in a student's name for a pattern: rename the folder"
        return Graded(student, assignment, 0, 0, 0, note)
    try:
        _refuse_links_and_size(path)
        nbformat.validate(nbformat.read(path, as_version=4))
        autograde_one(course, assignment, student, settings)
        return _result(course, assignment, student)
    except Exception as error:
        says = [*str(error).splitlines(), type(error).__name__][0][:200]
        note = f"{CRASHED}the file can't be graded: {says}"
    _stand_in(course, assignment, student, note)
    autograde_one(course, assignment, student, settings, UNREADABLE)
    with _gradebook(course) as gradebook:
        for comment in gradebook.find_submission_notebook(assignment, assignment, student).comments:
            comment.auto_comment = note
        gradebook.db.commit()
    return _result(course, assignment, student)


def _refuse_links_and_size(path: Path) -> None:
    """Raise when a submission holds links, which nbgrader would follow to other people's files, or is huge."""
    folder = path.parent
    if links := [one for one in (folder.parent, folder, *folder.rglob("*")) if one.is_symlink()]:
        raise DataError(links[0].name, "a file or folder", "a link")
    if (size := sum(one.lstat().st_size for one in folder.rglob("*"))) > LARGEST:
        raise DataError(path.name, f"at most {LARGEST} bytes with all files beside it", size)


def _stand_in(course: Path, assignment: str, student: str, note: str) -> None:
    """Write the exercise as students get it, with a note, in place of a file that can't be graded."""
    notebook = nbformat.read(course / "release" / assignment / f"{assignment}.ipynb", as_version=4)
    notebook.cells.insert(0, new_markdown_cell(f"**{note}**"))
    write_notebook(notebook, place(course, UNREADABLE, student, assignment))


def _result(course: Path, assignment: str, student: str) -> Graded:
    """Read what a submission has from the gradebook."""
    with _gradebook(course) as gradebook:
        found = gradebook.find_submission_notebook(assignment, assignment, student)
        crashes = [
            comment.auto_comment for comment in found.comments if (comment.auto_comment or "").startswith(CRASHED)
        ]
        to_read = sum(grade.needs_manual_grade for grade in found.grades)
        return Graded(student, assignment, found.score, found.max_score, to_read, "; ".join(dict.fromkeys(crashes)))


def _gradebook(course: Path) -> Gradebook:
    """Open the gradebook of a course."""
    return Gradebook(f"sqlite:///{course / 'gradebook.db'}")


def write_graded(course: Path, assignments: Sequence[str] = ()) -> Path:
    """Write what all submissions have so far, one line each, as a spreadsheet reads it.

    Parameters
    ----------
    course : Path
        The course.
    assignments : sequence of str
        Only these; all when empty.

    Returns
    -------
    Path
        The file, `graded.csv` in the course.
    """
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(column.name for column in fields(Graded))
    for one in submissions(course, assignments):
        if is_graded(course, *one):
            table.writerow(astuple(_result(course, *one)))
    write_text(course / GRADED, text.getvalue())
    return course / GRADED
