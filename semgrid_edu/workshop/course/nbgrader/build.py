"""Exercises from one source: the students' notebook, and a complete nbgrader course for an instructor."""

import hashlib
import logging
import os
import re
import secrets
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from nbformat import NotebookNode
from nbgrader import preprocessors as steps
from nbgrader.apps import NbGraderAPI
from traitlets.config import PyFileConfigLoader

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import write_json, write_text
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.course.notebooks.build import (
    NOTEBOOKS,
    built_path,
    notebook_text,
    read_percent,
    write_notebook,
)

CLEARED = steps.LockCells, steps.ClearSolutions, steps.ClearOutput, steps.ClearHiddenTests
"""The steps that remove from an exercise what students must not see."""

RELEASE_STEPS = *CLEARED, steps.ComputeChecksums, steps.CheckCellMetadata
"""The steps of nbgrader's generate_assignment on a notebook, without its gradebook."""

MARKER = "semgrid_course.json"
"""The file that marks a folder as a course that `build_course` wrote."""

GRADEBOOK_LOG = logging.getLogger("tornado.application")
"""The log to which nbgrader's gradebook writes a page of traceback whenever it is locked."""


def exercise_sources(folder: Path = NOTEBOOKS) -> list[Path]:
    """Return the percent sources of all exercises: those of lectures in the order of the course, then of companions.

    Parameters
    ----------
    folder : Path
        The folder of notebooks.
    """
    return sorted((folder / "src" / "exercises").glob("*.py"))


def student_version(source: Path) -> NotebookNode:
    """Remove solutions and hidden tests from an exercise, as `nbgrader generate_assignment` does.

    Parameters
    ----------
    source : Path
        The source, `notebooks/src/exercises/NAME.py`, with nbgrader's markers and metadata.
    """
    notebook = read_percent(source)
    resources = {}
    for step in RELEASE_STEPS:
        notebook, resources = step().preprocess(notebook, resources)
    return notebook


def build_exercise(source: Path) -> Path:
    """Write the student version of an exercise, and return its path, `notebooks/exercises/NAME.ipynb`.

    Parameters
    ----------
    source : Path
        The source, `notebooks/src/exercises/NAME.py`.
    """
    target = built_path(source)
    write_notebook(student_version(source), target)
    return target


@dataclass(frozen=True)
class BuiltCourse:
    """The results of `build_course`.

    Parameters
    ----------
    assignments : list of str
        Names of the assignments.
    kept : list of str
        Files that the instructor has changed, and that were therefore not updated.
    """

    assignments: list[str]
    kept: list[str]


def build_course(directory: str | Path, folder: Path = NOTEBOOKS, lectures: str | None = None) -> BuiltCourse:
    """Write a complete nbgrader course: sources, settings, the instructor's module, gradebook and released versions.

    A second run updates the files that the instructor hasn't changed. Everything else, with submissions and grades,
    stays as it is.

    Parameters
    ----------
    directory : path-like
        The folder of the course: missing, empty, or with an earlier course.
    folder : Path
        The folder of notebooks.
    lectures : str, optional
        Where students find the lectures to which exercises link, see `point_links`. By default as in the last run.

    Raises
    ------
    DataError
        When the folder contains something else, there are no exercises, or nbgrader can't release one.
    """
    directory = Path(directory).resolve()
    _check_folder(directory)
    sources = exercise_sources(folder)
    if not sources:
        raise DataError(
            folder / "src" / "exercises", "the exercises of a clone of semgrid_edu", "none: a wheel has none"
        )
    marker = directory / MARKER
    before = _read_marker(marker) if marker.exists() else {}
    lectures = before.get("lectures", "") if lectures is None else lectures
    digests, kept = _write_unless_changed(directory, _course_files(folder, sources, lectures), before.get("files", {}))
    names = [source.stem for source in sources]
    about = {"written by": f"semgrid_edu {version('semgrid_edu')}", "assignments": names}
    salt = before.get("salt") or secrets.token_hex(16)
    write_json(marker, about | {"lectures": lectures, "files": digests, "salt": salt})
    with course_api(directory) as api:
        for name in names:
            _release(api, name, directory / "source" / name)
    return BuiltCourse(names, kept)


def _read_marker(path: Path) -> dict:
    """Return what an earlier build wrote down, after checking the types of what the next one reads."""
    before = read_json(path)
    for name, kind in (("lectures", str), ("files", dict), ("salt", str)):
        if not isinstance(before.get(name, kind()), kind):
            raise DataError(path, f"{name} as `course build` writes it", repr(before[name])[:200])
    return before


def _check_folder(directory: Path) -> None:
    """Raise an error if a folder contains anything but a course that `build_course` wrote."""
    if directory.is_file():
        raise DataError(directory, "a folder", "a file")
    if directory.exists() and any(directory.iterdir()) and not (directory / MARKER).is_file():
        raise DataError(directory, f"an empty folder, or a course with its {MARKER}", "a folder with other files")


def _course_files(folder: Path, sources: list[Path], lectures: str) -> dict[str, str]:
    """Return the text of each file of a course, by its path in it."""
    instructor = folder / "instructor"
    files = {name: instructor / name for name in ("nbgrader_config.py", "README.md")}
    files |= {f"instructor/{path.relative_to(instructor).as_posix()}": path for path in instructor.glob("*/*.py")}
    texts = {name: path.read_text(encoding="utf-8") for name, path in files.items()}
    return texts | {f"source/{s.stem}/{s.stem}.ipynb": _source_text(s, lectures) for s in sources}


def _source_text(source: Path, lectures: str) -> str:
    """Return the instructor's version of an exercise: with solutions, and links that work for students."""
    notebook = read_percent(source)
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = point_links(cell.source, lectures)
    return notebook_text(notebook)


def point_links(text: str, lectures: str) -> str:
    """Make an exercise link to the lectures where its students find them.

    Parameters
    ----------
    text : str
        A text cell of an exercise. Its links to notebooks begin with `../`, the folder of notebooks.
    lectures : str
        The address of the folder that holds `00_tour.ipynb`, or its path from a student's copy of the exercise; "" when
        students can't open it. Then only the link's text stays.

    Raises
    ------
    ArgumentError
        When a link can't contain the folder.

    Examples
    --------
    >>> point_links("The lecture is [00: the tour](../00_tour.ipynb).", "https://course.example/lectures")
    'The lecture is [00: the tour](https://course.example/lectures/00_tour.ipynb).'
    >>> point_links("The lecture is [00: the tour](../00_tour.ipynb).", "")
    'The lecture is 00: the tour.'
    """
    if re.search(r"[\s()<>]", lectures):
        raise ArgumentError("lectures", "an address or a path without blanks, parentheses and < or >", lectures)
    new = rf"[\1]({lectures.rstrip('/')}/\2)" if lectures else r"\1"
    return re.sub(r"\[([^\]]*)\]\(\.\./([^)]*)\)", lambda link: link.expand(new), text)


def _write_unless_changed(directory: Path, texts: dict, before: dict) -> tuple[dict[str, str], list[str]]:
    """Write files except those that were changed since the last time; return all digests, and which files were kept."""
    digests = {}
    kept = []
    for name, text in texts.items():
        path = directory / name
        now = _digest(path.read_bytes()) if path.exists() else before.get(name)
        digests[name] = _digest(text.encode())
        if now in (before.get(name), digests[name]):
            write_text(path, text)
        else:
            kept.append(name)
            digests[name] = before.get(name, "")
    return digests, kept


def _digest(content: bytes) -> str:
    """Return a digest of a file."""
    return hashlib.sha256(content).hexdigest()


@contextmanager
def course_api(directory: Path) -> Iterator[NbGraderAPI]:
    """Open a course with its settings, and yield nbgrader's commands on it.

    Parameters
    ----------
    directory : Path
        A course that `build_course` wrote. Its settings change the environment, which is undone when the block ends.
    """
    before = dict(os.environ)
    try:
        api = NbGraderAPI(config=PyFileConfigLoader("nbgrader_config.py", path=str(directory)).load_config())
        api.log.setLevel(logging.ERROR)
        yield api
    finally:
        os.environ.clear()
        os.environ.update(before)


def _release(api: NbGraderAPI, name: str, source: Path) -> None:
    """Let nbgrader release an exercise; raise an error if it can't."""
    with caught_errors(api.log) as errors:
        result = api.generate_assignment(name)
    if not result["success"]:
        raise DataError(source, "an exercise that nbgrader can release", failure_reason(result, errors))


@contextmanager
def caught_errors(log: logging.Logger) -> Iterator[list[BaseException]]:
    """Collect the errors that nbgrader catches in a block: it logs each, and raises another one without the reason.

    Parameters
    ----------
    log : Logger
        nbgrader's log. Its gradebook is silent meanwhile.
    """
    errors: list[BaseException] = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: errors.extend(filter(None, [sys.exc_info()[1]]))
    log.addHandler(handler)
    was_silent = GRADEBOOK_LOG.disabled
    GRADEBOOK_LOG.disabled = True
    try:
        yield errors
    finally:
        GRADEBOOK_LOG.disabled = was_silent
        log.removeHandler(handler)


def failure_reason(result: dict, errors: list[BaseException]) -> str:
    """Return the reason why nbgrader failed, in one line.

    Parameters
    ----------
    result : dict
        The return value of nbgrader's API.
    errors : list of BaseException
        What `caught_errors` collected. The last one counts; without any, the last line of nbgrader's message.
    """
    log = result.get("error") or result.get("log") or "no reason"
    return one_line(errors[-1]) if errors else log.strip().splitlines()[-1]


def one_line(error: BaseException) -> str:
    """Return the class of an error, unless it is one of this package's, and the first line of its message.

    Parameters
    ----------
    error : BaseException
        The error.
    """
    # It may quote what a student wrote, and some characters control terminals.
    message = "".join(one if one.isprintable() else "?" for one in [*str(error).splitlines(), ""][0][:300])
    ours = type(error).__module__.startswith("semgrid_edu.")
    return message if ours else f"{type(error).__name__}: {message}".removesuffix(": ")
