"""A whole class: every submission that was collected, graded by nbgrader on all cores."""

import csv
import io
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import astuple, dataclass, field, fields
from glob import has_magic
from multiprocessing import get_context
from pathlib import Path

import nbformat
from nbformat.v4 import new_markdown_cell
from nbgrader.api import Gradebook, MissingEntry
from tqdm import tqdm

from semgrid_edu.course.failures import UngradedError, in_one_line
from semgrid_edu.course.grading import GradeSettings, autograde_one, place
from semgrid_edu.course.handed_in import check_file, check_time, submissions
from semgrid_edu.course.isolation.prepared import prepare, starter
from semgrid_edu.course.nbgrader_steps import CRASHED
from semgrid_edu.course.notebooks import write_notebook
from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import write_text

UNREADABLE = "unreadable"
"""The folder with notebooks that stand in for files that can't be read."""

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
        When the folder is no course.
    ArgumentError
        When there is no such assignment.
    UngradedError
        In the end, when submissions stay ungraded for a reason that isn't theirs; it names them, one a line.
    """
    course, began = course.resolve(), time.time()
    wanted = [one for one in submissions(course, assignments) if again or not is_graded(course, *one)]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        try:
            failed = _failing_references(pool, course, settings, [assignment for assignment, _ in wanted])
            ready = [one for one in wanted if one[0] not in failed]
            waiting = {pool.submit(grade_one, course, *one, settings): one for one in ready}
            yield from _as_they_end(course, waiting, failed, began)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    if failed:
        raise UngradedError("\n".join(f"{which}: {says}" for which, says in failed.items()))


def _as_they_end(
    course: Path, waiting: dict[Future, tuple[str, str]], failed: dict[str, str], began: float
) -> Iterator[Graded]:
    """Yield results; tell of submissions that have none, since their grading failed or its process was ended."""
    for done in tqdm(as_completed(waiting), "submissions", len(waiting)):
        try:
            yield done.result()
        except Exception as error:
            _forget(course, *waiting[done], began)
            failed[", ".join(reversed(waiting[done]))] = in_one_line(error)


def _failing_references(
    pool: ProcessPoolExecutor, course: Path, settings: GradeSettings, assignments: Sequence[str]
) -> dict[str, str]:
    """Grade the reference answers of exercises; return what is wrong, by exercise, where they fail."""
    trials = {
        name: pool.submit(prepare, course, name, settings.memory, settings.container)
        for name in dict.fromkeys(assignments)
    }
    errors = {name: trial.exception() for name, trial in trials.items()}
    return {name: in_one_line(error) for name, error in errors.items() if error is not None}


def missing_limits(settings: GradeSettings) -> list[str]:
    """Start a process as students' code gets it, and return what can't be limited.

    Parameters
    ----------
    settings : GradeSettings
        How a class is graded.

    Returns
    -------
    list of str
        Of `limits.PARTS`; empty with a container, whose own command says what is limited.

    Raises
    ------
    OSError
        When the process or the container doesn't start.
    """
    with tempfile.TemporaryDirectory() as nothing:
        process = starter(settings.memory, settings.container)(Path(nothing))
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
    if not _is_up_to_date(course, assignment, student):
        return False
    with _gradebook(course) as gradebook:
        return _has_scores(gradebook, assignment, student)


def _is_up_to_date(course: Path, assignment: str, student: str) -> bool:
    """Return whether nbgrader has made its notebook of a submission after that was handed in."""
    submitted, graded = (place(course, step, student, assignment) for step in ("submitted", "autograded"))
    return graded.exists() and graded.stat().st_mtime >= submitted.stat().st_mtime


def _has_scores(gradebook: Gradebook, assignment: str, student: str) -> bool:
    """Return whether every test cell of a submission has a score, or waits for a person."""
    try:
        grades = gradebook.find_submission_notebook(assignment, assignment, student).grades
    except MissingEntry:
        return False
    return all(grade.needs_manual_grade or (grade.auto_score, grade.manual_score) != (None, None) for grade in grades)


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
    UngradedError
        When grading fails for a reason that isn't the submission's; it then has no grade.
    """
    if has_magic(student):
        note = f"{CRASHED}nbgrader takes * ? [ in a student's name for a pattern: rename the folder"
        return Graded(student, assignment, 0, 0, 0, note)
    try:
        if fault := _graded_or_fault(course, assignment, student, settings):
            _grade_stand_in(course, assignment, student, settings, f"{CRASHED}the file can't be graded: {fault}")
        with _gradebook(course) as gradebook:
            return _result(gradebook, assignment, student)
    except Exception as error:
        _forget(course, assignment, student)
        raise UngradedError(in_one_line(error)) from error
    except BaseException:
        _forget(course, assignment, student)
        raise


def _graded_or_fault(course: Path, assignment: str, student: str, settings: GradeSettings) -> str:
    """Grade a submission; return what is wrong with its file, "" when it has been graded."""
    path = place(course, "submitted", student, assignment)
    check_time(path)
    try:
        check_file(path)
        autograde_one(course, assignment, student, settings)
    except DataError as error:
        return error.args[2] if error.path == path else in_one_line(error)
    return ""


def _forget(course: Path, assignment: str, student: str, since: float = 0.0) -> None:
    """Delete what an unfinished grading left since some time: the submission then counts as not graded."""
    graded = place(course, "autograded", student, assignment)
    if graded.exists() and graded.stat().st_mtime >= since:
        shutil.rmtree(graded.parent, ignore_errors=True)


def _grade_stand_in(course: Path, assignment: str, student: str, settings: GradeSettings, note: str) -> None:
    """Grade the exercise as students get it in place of a file that can't be graded; say so in the gradebook."""
    _stand_in(course, assignment, student, note)
    autograde_one(course, assignment, student, settings, UNREADABLE)
    with _gradebook(course) as gradebook:
        for comment in gradebook.find_submission_notebook(assignment, assignment, student).comments:
            comment.auto_comment = note
        gradebook.db.commit()


def _stand_in(course: Path, assignment: str, student: str, note: str) -> None:
    """Write the exercise as students get it, with a note, in place of a file that can't be graded."""
    notebook = nbformat.read(course / "release" / assignment / f"{assignment}.ipynb", as_version=4)
    notebook.cells.insert(0, new_markdown_cell(f"**{note}**"))
    write_notebook(notebook, place(course, UNREADABLE, student, assignment))


def _result(gradebook: Gradebook, assignment: str, student: str) -> Graded:
    """Read what a submission has from the gradebook."""
    found = gradebook.find_submission_notebook(assignment, assignment, student)
    crashes = [comment.auto_comment for comment in found.comments if (comment.auto_comment or "").startswith(CRASHED)]
    to_read = sum(grade.needs_manual_grade for grade in found.grades)
    return Graded(student, assignment, found.score, found.max_score, to_read, "; ".join(dict.fromkeys(crashes)))


def _gradebook(course: Path) -> Gradebook:
    """Open the gradebook of a course."""
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
    with _gradebook(course) as gradebook:
        for one in submissions(course):
            if _is_up_to_date(course, *one) and _has_scores(gradebook, *one):
                table.writerow(astuple(_result(gradebook, *one)))
    write_text(course / GRADED, text.getvalue())
    return course / GRADED
