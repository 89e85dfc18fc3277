"""Submissions: which there are, whether they can be or have been graded, and their results in the gradebook."""

import codecs
import csv
import io
import shutil
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import nbformat
from nbgrader.api import Gradebook, MissingEntry
from nbgrader.utils import parse_utc

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import write_text
from semgrid_edu.workshop.course.nbgrader.autograde import UnfitError, place
from semgrid_edu.workshop.course.nbgrader.build import MARKER
from semgrid_edu.workshop.course.nbgrader.preprocessors import CRASHED

MAX_BYTES = 100_000_000
"""Limit for a submission with all its files, bytes."""

MAX_PARTS = 1000
"""Limit for the files and folders of a submission, and for the cells of its notebook: each takes nbgrader time."""

GRADED = "graded.csv"
"""The file with one line for each submission."""

FORMULAS = ("=", "+", "-", "@", "\t", "\r")
"""With what a text begins that a spreadsheet takes for a formula."""

UNFINISHED = "unfinished"
"""The folder with an empty file for each submission whose grading has begun and not ended, even if it was killed."""


@dataclass(frozen=True)
class Graded:
    """The result of one submission.

    Parameters
    ----------
    student, assignment : str
        Whose it is.
    score, points : float
        Its points so far, and the most that are possible.
    to_read : int
        How many written answers wait for a person.
    note : str
        What ended Python or could not be read; "" if nothing went wrong.
    """

    student: str
    assignment: str
    score: float
    points: float
    to_read: int
    note: str = ""


def submissions(course: Path, assignments: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Return assignment and student of each file `submitted/STUDENT/ASSIGNMENT/ASSIGNMENT.ipynb`.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote.
    assignments : sequence of str
        Only these; all when empty.

    Raises
    ------
    DataError
        When the folder isn't a course.
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


def misplaced(course: Path) -> list[Path]:
    """Return notebooks that aren't graded because of their names or places, as paths within the course.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote. A notebook beside one that is graded isn't misplaced.
    """
    graded = {course / "submitted" / student / assignment for assignment, student in submissions(course)}
    found = sorted((course / "submitted").rglob("*.ipynb"))
    return [path.relative_to(course) for path in found if not graded.intersection(path.parents)]


def check_file(path: Path) -> None:
    """Check that a submission can be graded, whatever its answers are; a byte order mark is taken away.

    Parameters
    ----------
    path : Path
        The notebook.

    Raises
    ------
    UnfitError
        When it isn't a notebook, has thousands of cells or files, is huge with the files beside it, or contains links,
        which nbgrader would follow to other people's files, or pipes and devices, which would block it.
    """
    folder = path.parent
    files = [*folder.rglob("*")]
    if any(one.is_symlink() for one in (folder.parent, folder, *files)):
        raise UnfitError("it comes with a link in place of a file or folder")
    if not all(one.is_file() or one.is_dir() for one in files) or not path.is_file():
        raise UnfitError("it comes with a pipe, a device or a folder in place of a file")
    if len(files) > MAX_PARTS:
        raise UnfitError(f"it comes with more than {MAX_PARTS} files and folders")
    if sum(one.lstat().st_size for one in files) > MAX_BYTES:
        raise UnfitError(f"it has more than {MAX_BYTES} bytes with all files beside it")
    if (content := path.read_bytes()).startswith(codecs.BOM_UTF8):  # nbgrader reads the file itself
        path.write_bytes(content.removeprefix(codecs.BOM_UTF8))
    try:
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        nbformat.writes(notebook).encode()
    except (OSError, MemoryError):
        raise
    except Exception as error:
        raise UnfitError(f"it is no notebook ({type(error).__name__})") from error
    if len(notebook.cells) > MAX_PARTS:
        raise UnfitError(f"it has more than {MAX_PARTS} cells")


def check_time(path: Path) -> None:
    """Check that the instructor's note on the time of a submission can be read; nbgrader's own error hides the reason.

    Parameters
    ----------
    path : Path
        The notebook; there may be a `timestamp.txt` beside it.

    Raises
    ------
    DataError
        When that file contains no time.
    """
    note = path.with_name("timestamp.txt")
    text = note.read_text(encoding="utf-8", errors="replace").strip() if note.exists() else ""
    try:
        parse_utc(text or None)
    except (ValueError, OverflowError):
        raise DataError(note, "a time such as 2027-03-01 17:12:00 UTC", text[:100]) from None


@contextmanager
def unfinished(course: Path, assignment: str, student: str) -> Iterator[None]:
    """Mark a submission as unfinished while a block grades it; if the process is killed, the mark stays.

    Parameters
    ----------
    course : Path
        The course.
    assignment, student : str
        Whose submission. If the block fails, its incomplete result is deleted.
    """
    mark = _mark(course, assignment, student)
    try:
        write_text(mark, "")
        yield
        mark.unlink(missing_ok=True)
    except BaseException:
        delete_unfinished(course, assignment, student)
        raise


def delete_unfinished(course: Path, assignment: str, student: str) -> None:
    """Delete the files of an unfinished grading, so that nbgrader doesn't consider the submission graded.

    Parameters
    ----------
    course : Path
        The course.
    assignment, student : str
        Whose submission; without a mark it stays as it is.
    """
    mark = _mark(course, assignment, student)
    if mark.exists():
        shutil.rmtree(place(course, "autograded", student, assignment).parent, ignore_errors=True)
        mark.unlink(missing_ok=True)


def _mark(course: Path, assignment: str, student: str) -> Path:
    """Return the empty file that exists while a submission is being graded."""
    return course / UNFINISHED / student / assignment


def has_begun(course: Path, assignment: str, student: str) -> bool:
    """Return whether the grading of a submission has begun and not ended.

    Parameters are those of `delete_unfinished`.
    """
    return _mark(course, assignment, student).exists()


def ungraded(course: Path, assignments: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Return the submissions that aren't completely graded in their present state.

    Parameters and errors are those of `submissions`.
    """
    found = submissions(course, assignments)
    with open_gradebook(course) as book:
        return [one for one in found if not (_is_up_to_date(course, *one) and _has_scores(book, *one))]


def _is_up_to_date(course: Path, assignment: str, student: str) -> bool:
    """Return whether nbgrader has finished a submission's graded notebook since it was handed in."""
    submitted, graded = (place(course, step, student, assignment) for step in ("submitted", "autograded"))
    begun = has_begun(course, assignment, student)
    return not begun and graded.exists() and graded.stat().st_mtime >= submitted.stat().st_mtime


def _has_scores(gradebook: Gradebook, assignment: str, student: str) -> bool:
    """Return whether every test cell of a submission has a score, or waits for a person."""
    try:
        grades = gradebook.find_submission_notebook(assignment, assignment, student).grades
    except MissingEntry:
        return False
    return all(grade.needs_manual_grade or (grade.auto_score, grade.manual_score) != (None, None) for grade in grades)


def result_of(gradebook: Gradebook, assignment: str, student: str) -> Graded:
    """Read the result of a graded submission.

    Parameters
    ----------
    gradebook : Gradebook
        From `open_gradebook`.
    assignment, student : str
        Whose submission.
    """
    found = gradebook.find_submission_notebook(assignment, assignment, student)
    crashes = [comment.auto_comment for comment in found.comments if (comment.auto_comment or "").startswith(CRASHED)]
    to_read = sum(grade.needs_manual_grade for grade in found.grades)
    return Graded(student, assignment, found.score, found.max_score, to_read, "; ".join(dict.fromkeys(crashes)))


def open_gradebook(course: Path) -> Gradebook:
    """Open the gradebook of a course, for a `with` block.

    Parameters
    ----------
    course : Path
        The course.

    Raises
    ------
    DataError
        When it is another kind of file.
    """
    path = course / "gradebook.db"
    path.open("rb").close()  # FileNotFoundError in place of an SQLite error
    # nbgrader adds its tables to whatever it opens, so look first; "immutable" waits for no lock.
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True)) as database:
        try:
            tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master")}
        except sqlite3.DatabaseError:
            tables = set()
    if "submitted_notebook" not in tables:
        raise DataError(path, "nbgrader's gradebook, as `semgrid-edu course build` writes it", "another file")
    return Gradebook(f"sqlite:///{path}")


def write_graded(course: Path) -> Path:
    """Write all scores so far, one line for each submission, to `graded.csv` in the course; return its path.

    Parameters
    ----------
    course : Path
        The course.
    """
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(column.name for column in fields(Graded))
    with open_gradebook(course) as gradebook:
        for one in sorted({*submissions(course)} - {*ungraded(course)}):
            table.writerow(map(as_cell, astuple(result_of(gradebook, *one))))
    write_text(course / GRADED, text.getvalue())
    return course / GRADED


def as_cell(value: object) -> object:
    """Return what a table shows for a value: a text that a spreadsheet would compute gets an apostrophe before it.

    Parameters
    ----------
    value : object
        Text or number.

    Examples
    --------
    >>> as_cell("=1+1"), as_cell(-1.5)
    ("'=1+1", -1.5)
    """
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULAS) else value
