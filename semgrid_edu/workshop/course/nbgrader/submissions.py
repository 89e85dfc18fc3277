"""The folder `submitted` of a course: what can be graded, what lies in the wrong place, and what can't be read."""

from collections.abc import Sequence
from pathlib import Path

import nbformat
from nbgrader.utils import parse_utc

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.workshop.course.nbgrader.build import MARKER
from semgrid_edu.workshop.course.nbgrader.failures import in_one_line

LARGEST = 100_000_000
"""Bytes of a submission with all its files."""


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


def misplaced(course: Path) -> list[Path]:
    """Return notebooks that nobody grades, because of their names or places.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote.

    Returns
    -------
    list of Path
        Where each lies, from the course on. A notebook beside one that is graded isn't among them.
    """
    graded = {course / "submitted" / student / assignment for assignment, student in submissions(course)}
    found = sorted((course / "submitted").rglob("*.ipynb"))
    return [path.relative_to(course) for path in found if not graded.intersection(path.parents)]


def check_file(path: Path) -> None:
    """Raise when a submission can't be graded whatever is in its answers.

    Parameters
    ----------
    path : Path
        The notebook.

    Raises
    ------
    DataError
        When it is no notebook, is huge with the files beside it, or comes with links, which nbgrader would follow to
        other people's files.
    """
    folder = path.parent
    if links := [one for one in (folder.parent, folder, *folder.rglob("*")) if one.is_symlink()]:
        raise DataError(links[0].name, "a file or folder", "a link")
    if (size := sum(one.lstat().st_size for one in folder.rglob("*"))) > LARGEST:
        raise DataError(path.name, f"at most {LARGEST} bytes with all files beside it", size)
    try:
        nbformat.validate(nbformat.read(path, as_version=4))
    except OSError:
        raise
    except Exception as error:
        raise DataError(path.name, "a notebook", in_one_line(error)) from error


def check_time(path: Path) -> None:
    """Raise when the instructor's note on when a submission came can't be read.

    Parameters
    ----------
    path : Path
        The notebook; `timestamp.txt` may lie beside it.

    Raises
    ------
    DataError
        When that file holds no time.
    """
    note = path.with_name("timestamp.txt")
    text = note.read_text(encoding="utf-8", errors="replace").strip() if note.exists() else ""
    try:
        parse_utc(text or None)
    except (ValueError, OverflowError):
        raise DataError(note, "a time such as 2027-03-01 17:12:00 UTC", text[:100]) from None
