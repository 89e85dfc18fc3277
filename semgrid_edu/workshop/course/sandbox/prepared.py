"""What is worked out once for all submissions: functions that are compiled, fonts, and whether the reference passes."""

import sys
from collections.abc import Callable, Mapping
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import nbformat
from filelock import FileLock
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell
from nbgrader.utils import is_solution

from semgrid_edu.errors import DataError
from semgrid_edu.storage.compiled import takes_files, user_cache
from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.notebook import INSTRUCTOR, run_submission
from semgrid_edu.workshop.course.sandbox.process import StudentProcess

PATIENCE = 600.0
"""Seconds that a cell of the reference may take; it compiles what others find compiled."""

FONTS = "import matplotlib.pyplot"
"""Lets matplotlib look for the system's fonts, which takes seconds."""


def use_instructor(folder: Path) -> None:
    """Let test cells import the hidden tests of this course, and of no other.

    Parameters
    ----------
    folder : Path
        The folder `instructor` of a course.
    """
    place = folder / INSTRUCTOR / "__init__.py"
    if getattr(sys.modules.get(INSTRUCTOR), "__file__", None) == str(place):
        return
    for name in [name for name in sys.modules if name.partition(".")[0] == INSTRUCTOR]:
        del sys.modules[name]
    spec = spec_from_file_location(INSTRUCTOR, place)
    sys.modules[INSTRUCTOR] = module_from_spec(spec)
    spec.loader.exec_module(sys.modules[INSTRUCTOR])


def starter(memory: int, container: tuple[str, ...], keeps: bool = False) -> Callable[[Path], StudentProcess]:
    """Return what starts a process for a student's code.

    Parameters
    ----------
    memory : int
        Megabytes of memory for the process.
    container : tuple of str
        A command that starts a program in a container; () for none.
    keeps : bool
        Whether the process keeps what it compiles.

    Returns
    -------
    callable
        (folder of what is prepared) -> StudentProcess.
    """
    return lambda prepared: StudentProcess(Limits(memory=memory), prepared, keeps, container)


def prepare(course: Path, assignment: str, memory: int, container: tuple[str, ...] = ()) -> Path:
    """Grade the reference answers once in each course, and keep what they had compiled for all of the user's courses.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote.
    assignment : str
        The exercise.
    memory : int
        Megabytes of memory for the process.
    container : tuple of str
        A command that starts a program in a container: what passes outside needn't pass in there. () for none.

    Returns
    -------
    Path
        The folder of what is prepared.

    Raises
    ------
    DataError
        When the reference answers don't pass their own tests.
    """
    use_instructor(course / "instructor")
    folder = _kept(course, assignment)
    passed = course / "prepared" / f"{assignment} passed{' in a container' if container else ''}"
    passed.parent.mkdir(exist_ok=True)
    with FileLock(folder.with_suffix(".lock")):
        if not passed.exists():
            _grade_reference(course, assignment, folder, starter(memory, container, keeps=True))
            passed.touch()
    return folder


def _kept(course: Path, assignment: str) -> Path:
    """Return the folder of what is prepared: in the user's cache, or in the course where that can't be written to."""
    shared = user_cache() / "semgrid_edu" / "prepared" / assignment
    if takes_files(shared):
        return shared
    (course / "prepared" / assignment).mkdir(parents=True, exist_ok=True)
    return course / "prepared" / assignment


def _grade_reference(course: Path, assignment: str, folder: Path, start: Callable[[Path], StudentProcess]) -> None:
    """Run an exercise with the instructor's answers in it."""
    path = course / "source" / assignment / f"{assignment}.ipynb"
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, new_code_cell(FONTS))
    run_submission(notebook, instructors_cells(notebook), lambda: start(folder), PATIENCE)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    if errors := [f"{output.ename}: {output.evalue}" for output in outputs if output.output_type == "error"]:
        raise DataError(path, "reference answers that pass their tests", "; ".join(errors))


def instructors_cells(notebook: NotebookNode) -> Mapping[str, str]:
    """Return the text of the cells that aren't answers, by grade_id.

    Parameters
    ----------
    notebook : NotebookNode
        An exercise's source.

    Returns
    -------
    mapping of str to str
        For `run_submission`.
    """
    graded = [cell for cell in notebook.cells if cell.metadata.get("nbgrader") and not is_solution(cell)]
    return {cell.metadata.nbgrader.grade_id: cell.source for cell in graded}
