"""Additions of this course to nbgrader's autograde: submissions are completed, and run apart from their tests."""

import re
import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import nbformat
from filelock import FileLock
from nbconvert.exporters.exporter import ResourcesDict
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell
from nbgrader.api import Gradebook, SourceCell
from nbgrader.preprocessors import NbGraderPreprocessor
from nbgrader.utils import is_grade, is_solution
from traitlets import Bool, Integer, Unicode
from traitlets import List as ListTrait

from semgrid_edu.errors import DataError
from semgrid_edu.fast.numba_cache import PACKAGE, takes_files, user_cache
from semgrid_edu.workshop.course.nbgrader.autograde import UnfitError, student_variant
from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.notebook import INSTRUCTOR, cell_name, run_submission
from semgrid_edu.workshop.course.sandbox.process import StudentProcess

CRASHED = "Crashed: "
"""The beginning of a comment that says what ended Python."""

KEPT = ("kernelspec",)
"""The metadata of a notebook that are kept; nbgrader replaces them by the exercise's."""

CRASHES = "crashes"
"""The name under which `ExecuteApart` tells `NoteCrashes` what ended a student's process."""

PATIENCE = 600.0
"""Time limit of a reference cell, seconds: it compiles functions that submissions then reuse."""

FONTS = "import matplotlib.pyplot"
"""Makes matplotlib look for the system's fonts, which takes seconds."""


class MakeWhole(NbGraderPreprocessor):
    """Gives a submission every cell of the exercise once, whatever the student deleted, split or changed.

    A locked cell that she changed, such as the imports, is restored, and her version runs after it.
    """

    def preprocess(self, nb: NotebookNode, resources: ResourcesDict) -> tuple[NotebookNode, ResourcesDict]:
        """Repair one notebook; nbgrader's `OverwriteCells` comes after.

        Parameters
        ----------
        nb : NotebookNode
            The notebook.
        resources : ResourcesDict
            nbgrader's information about it: student, assignment, gradebook.
        """
        where = resources["nbgrader"]
        with Gradebook(where["db_url"]) as gradebook:
            exercise = gradebook.find_notebook(where["notebook"], where["assignment"])
            blanks = {cell.name: _blank(cell, exercise) for cell in exercise.source_cells}
        # All other metadata would be the student's, such as widgets or a title, and shown in feedback.
        nb.metadata = NotebookNode({name: nb.metadata[name] for name in KEPT if name in nb.metadata})
        if not any(cell_name(cell) in blanks for cell in nb.cells):
            _recognise(nb.cells, [blank for blank in blanks.values() if is_solution(blank)])
        _mark(nb.cells, blanks)
        nb.cells = _with_own_versions(nb.cells, blanks)
        _insert_missing(nb.cells, blanks)
        return nb, resources


def _blank(source: SourceCell, exercise) -> NotebookNode:
    """Return a cell of the exercise as students get it, but with hidden tests."""
    points = {cell.name: cell.max_score for cell in exercise.grade_cells}
    answers = {cell.name for cell in exercise.solution_cells}
    cell = {"code": new_code_cell, "markdown": new_markdown_cell}[source.cell_type](source.source)
    cell.metadata["nbgrader"] = NotebookNode(
        grade=source.name in points,
        grade_id=source.name,
        locked=source.locked,
        schema_version=3,
        solution=source.name in answers,
        task=False,
        cell_type=source.cell_type,
        checksum=source.checksum,
        **({"points": points[source.name]} if source.name in points else {}),
    )
    return cell


def _recognise(cells: list[NotebookNode], answers: list[NotebookNode]) -> None:
    """Find answers by what they define in a notebook without metadata; the written answer is its last text."""
    found = 0
    for answer in answers:
        wanted = _defined(answer.source)
        alike = [c for c in cells if c.cell_type == answer.cell_type and (wanted & _defined(c.source) or not wanted)]
        if alike and (wanted or found):
            alike[-1].metadata["nbgrader"] = NotebookNode(grade_id=cell_name(answer))
            found += 1
    if not found:
        raise UnfitError("no cell of this exercise was recognised, so a person must read it")


def _defined(source: str) -> set[str]:
    """Return the names of functions and classes at the left margin of a cell."""
    return set(re.findall(r"^(?:def|class) +(\w+)", source, re.MULTILINE))


def _mark(cells: list[NotebookNode], blanks: dict[str, NotebookNode]) -> None:
    """Set the exercise's metadata on the last cell of each name, and none on all other cells."""
    left = dict(blanks)
    for cell in reversed(cells):
        blank = left.pop(cell_name(cell), None)
        cell.metadata = NotebookNode()
        if cell.cell_type == "raw":
            cell.cell_type = "markdown"  # raw cells are shown as HTML that `without_scripts` never sees
        if blank is not None:
            cell.metadata["nbgrader"] = blank.metadata.nbgrader.copy()


def _with_own_versions(cells: list[NotebookNode], blanks: dict[str, NotebookNode]) -> list[NotebookNode]:
    """Return the cells, with the student's version after each locked cell that she changed, unless it is a test."""
    found = []
    for cell in cells:
        found.append(cell)
        blank = blanks.get(cell_name(cell))
        locked = blank is not None and not is_solution(blank) and not is_grade(blank)
        if locked and cell.cell_type == "code" and cell.source != blank.source:
            found.append(new_code_cell(cell.source))
    return found


def _insert_missing(cells: list[NotebookNode], blanks: dict[str, NotebookNode]) -> None:
    """Insert cells that were deleted, each after its predecessor in the exercise."""
    place = 0
    for name, blank in blanks.items():
        present = [k for k, cell in enumerate(cells) if cell_name(cell) == name]
        if not present:
            cells.insert(place, blank)
            present = [place]
        place = present[0] + 1


class ExecuteApart(NbGraderPreprocessor):
    """Runs a submission: the answers in a process that can do no harm, the tests in this one."""

    course = Unicode(help="The folder of the course.").tag(config=True)
    timeout = Integer(30, help="Seconds for a cell, or for all calls of a test.").tag(config=True)
    memory = Integer(4000, help="Megabytes of memory for a student's code.").tag(config=True)
    container = ListTrait(Unicode(), help="A command that starts a program in a container.").tag(config=True)
    seed_by_student = Bool(help="Whether each student's hidden tests draw inputs of their own.").tag(config=True)

    def preprocess(self, nb: NotebookNode, resources: ResourcesDict) -> tuple[NotebookNode, ResourcesDict]:
        """Run one notebook. Parameters are those of `MakeWhole.preprocess`."""
        where, course = resources["nbgrader"], Path(self.course)
        prepared = prepare(course, where["assignment"], self.memory, tuple(self.container))
        with Gradebook(where["db_url"]) as gradebook:
            exercise = gradebook.find_notebook(where["notebook"], where["assignment"])
            trusted = {cell.name: cell.source for cell in exercise.source_cells}
        variant = (student_variant(course, where["student"]),) if self.seed_by_student else ()
        start = starter(self.memory, tuple(self.container), beside=Path(resources["metadata"]["path"]))
        resources[CRASHES] = run_submission(nb, trusted, lambda: start(prepared), self.timeout, variant)
        return nb, resources


def use_instructor(folder: Path) -> None:
    """Make test cells import the hidden tests of this course, and of no other.

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


def starter(
    memory: int, container: tuple[str, ...], keeps: bool = False, beside: Path | None = None
) -> Callable[[Path | None], StudentProcess]:
    """Return a function that takes a folder of compiled functions and starts a process for a student's code.

    Parameters
    ----------
    memory : int
        Megabytes of memory for the process.
    container : tuple of str
        A command that starts a program in a container; () for none.
    keeps : bool
        Whether the process adds what it compiles to that folder.
    beside : Path, optional
        The folder of a submission, for the files that were handed in beside it.
    """
    return lambda prepared: StudentProcess(Limits(memory=memory), prepared, keeps, container, beside)


def prepare(course: Path, assignment: str, memory: int, container: tuple[str, ...] = ()) -> Path:
    """Grade the reference answers once in each course; return the folder of the functions that they compiled.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote.
    assignment : str
        The exercise.
    memory : int
        Megabytes of memory for the process.
    container : tuple of str
        A command that starts a program in a container, where the answers are graded separately; () for none.

    Raises
    ------
    DataError
        When the reference answers don't pass their own tests.
    """
    use_instructor(course / "instructor")
    folder = prepared_folder(course, assignment)
    passed = course / "prepared" / f"{assignment} passed{' in a container' if container else ''}"
    passed.parent.mkdir(exist_ok=True)
    with FileLock(folder.with_suffix(".lock")):
        if not passed.exists():
            _grade_reference(course, assignment, folder, starter(memory, container, keeps=True))
            passed.touch()
    return folder


def prepared_folder(course: Path, assignment: str) -> Path:
    """Return the folder of compiled functions: in the user's cache, one for each copy of the package, or in the course.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote.
    assignment : str
        The exercise.
    """
    # Numba identifies a function by its file, so one copy of the package can't use what another one compiled.
    shared = user_cache().joinpath("semgrid_edu", "prepared", *PACKAGE.parts[1:], assignment)
    folder = shared if takes_files(shared) else course / "prepared" / assignment
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _grade_reference(course: Path, assignment: str, folder: Path, start: Callable[[Path], StudentProcess]) -> None:
    """Run an exercise with the instructor's answers."""
    path = course / "source" / assignment / f"{assignment}.ipynb"
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, new_code_cell(FONTS))
    run_submission(notebook, instructors_cells(notebook), lambda: start(folder), PATIENCE)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    if errors := [f"{output.ename}: {output.evalue}" for output in outputs if output.output_type == "error"]:
        raise DataError(path, "reference answers that pass their tests", "; ".join(errors))


def instructors_cells(notebook: NotebookNode) -> dict[str, str]:
    """Return the text of the cells that aren't answers, by grade_id, for `run_submission`.

    Parameters
    ----------
    notebook : NotebookNode
        An exercise's source.
    """
    cells = [cell for cell in notebook.cells if cell.metadata.get("nbgrader") and not is_solution(cell)]
    return {cell.metadata.nbgrader.grade_id: cell.source for cell in cells}


class NoteCrashes(NbGraderPreprocessor):
    """Notes in the gradebook which answers ended Python or had to be stopped, since 0 points alone don't say why."""

    def preprocess(self, nb: NotebookNode, resources: ResourcesDict) -> tuple[NotebookNode, ResourcesDict]:
        """Write the comments of one notebook.

        Parameters
        ----------
        nb : NotebookNode
            The notebook.
        resources : ResourcesDict
            nbgrader's information about it: student, assignment, gradebook.
        """
        where, answer = resources["nbgrader"], ""
        with Gradebook(where["db_url"]) as gradebook:
            for cell in nb.cells:
                name = cell_name(cell)
                answer = name if is_solution(cell) else answer
                if answer and name in resources[CRASHES]:
                    comment = gradebook.find_comment(answer, where["notebook"], where["assignment"], where["student"])
                    comment.auto_comment = CRASHED + resources[CRASHES][name]
            gradebook.db.commit()
        return nb, resources
