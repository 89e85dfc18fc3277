"""Additions of this course to nbgrader's autograde: submissions are completed, and run apart from their tests."""

import re
import sys
from collections.abc import Callable
from functools import partial
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

from semgrid_edu.errors import DataError
from semgrid_edu.workshop.course.nbgrader.autograde import UnfitError, student_variant
from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.notebook import cell_name, run_submission
from semgrid_edu.workshop.course.sandbox.process import StudentProcess

INSTRUCTOR = "semgrid_instructor"
"""The instructor's module, with the hidden tests."""

CRASHED = "Crashed: "
"""The beginning of a comment on what ended Python."""

CRASHES = "crashes"
"""The name under which `ExecuteApart` leaves for `NoteCrashes` what ended a student's process."""

REFERENCE_TIMEOUT = 600.0
"""Time limit of a reference cell, seconds: it compiles functions that submissions then reuse."""

RUBRIC = re.compile(r"\b(One|Half a) point for\b")
"""The beginning of a rubric, which is the rest of the model answer's cell."""

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
        # Other metadata, such as widgets or a title, would be the student's and shown in feedback.
        nb.metadata = NotebookNode({name: nb.metadata[name] for name in nb.metadata if name == "kernelspec"})
        if not any(cell_name(cell) in blanks for cell in nb.cells):
            _recognise(nb.cells, [blank for blank in blanks.values() if is_solution(blank)])
        _mark(nb.cells, blanks)
        nb.cells = _with_students_versions(nb.cells, blanks)
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


def _with_students_versions(cells: list[NotebookNode], blanks: dict[str, NotebookNode]) -> list[NotebookNode]:
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
    seed_by_student = Bool(help="Whether the hidden tests draw other inputs for each student.").tag(config=True)

    def preprocess(self, nb: NotebookNode, resources: ResourcesDict) -> tuple[NotebookNode, ResourcesDict]:
        """Run one notebook. Parameters are those of `MakeWhole.preprocess`."""
        where = resources["nbgrader"]
        course = Path(self.course)
        prepared = prepare(course, where["assignment"], self.memory)
        if self.seed_by_student:
            use_instructor(course / "instructor", student_variant(course, where["student"]))
        with Gradebook(where["db_url"]) as gradebook:
            exercise = gradebook.find_notebook(where["notebook"], where["assignment"])
            trusted = {cell.name: cell.source for cell in exercise.source_cells}
        limits = Limits(memory=self.memory)
        beside = Path(resources["metadata"]["path"])
        start = partial(StudentProcess, limits, prepared, beside=beside)
        resources[CRASHES] = run_submission(nb, trusted, start, self.timeout)
        return nb, resources


def use_instructor(folder: Path, *variant: int) -> None:
    """Make test cells import the hidden tests of this course, and of no other.

    Parameters
    ----------
    folder : Path
        The folder `instructor` of a course.
    *variant : int
        A number that chooses the inputs of hidden tests; without one they draw the usual ones.
    """
    place = folder / INSTRUCTOR / "__init__.py"
    if getattr(sys.modules.get(INSTRUCTOR), "__file__", None) != str(place):
        for name in [name for name in sys.modules if name.partition(".")[0] == INSTRUCTOR]:
            del sys.modules[name]
        spec = spec_from_file_location(INSTRUCTOR, place)
        sys.modules[INSTRUCTOR] = module_from_spec(spec)
        spec.loader.exec_module(sys.modules[INSTRUCTOR])
    sys.modules[INSTRUCTOR].choose_variant(*variant)


def prepare(course: Path, assignment: str, memory: int) -> Path:
    """Grade the reference answers once in each course; return the folder of the functions that they compiled.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote.
    assignment : str
        The exercise.
    memory : int
        Megabytes of memory for the process.

    Raises
    ------
    DataError
        When the reference answers don't pass their own tests.
    """
    use_instructor(course / "instructor")
    folder = course / "prepared" / assignment
    folder.mkdir(parents=True, exist_ok=True)
    passed = folder.with_suffix(".passed")
    with FileLock(folder.with_suffix(".lock")):
        if not passed.exists():
            _grade_reference(course, assignment, partial(StudentProcess, Limits(memory=memory), folder, keeps=True))
            passed.touch()
    return folder


def _grade_reference(course: Path, assignment: str, start: Callable[[], StudentProcess]) -> None:
    """Run an exercise with the instructor's answers."""
    path = course / "source" / assignment / f"{assignment}.ipynb"
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, new_code_cell(FONTS))
    run_submission(notebook, instructors_cells(notebook), start, REFERENCE_TIMEOUT)
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
        where = resources["nbgrader"]
        answer = ""
        with Gradebook(where["db_url"]) as gradebook:
            for cell in nb.cells:
                name = cell_name(cell)
                answer = name if is_solution(cell) else answer
                if answer and name in resources[CRASHES]:
                    comment = gradebook.find_comment(answer, where["notebook"], where["assignment"], where["student"])
                    comment.auto_comment = CRASHED + resources[CRASHES][name]
            gradebook.db.commit()
        return nb, resources


class ShowRubric(NbGraderPreprocessor):
    """Inserts the rubric below each written answer, because Formgrader and feedback show what is in the notebook."""

    course = Unicode(help="The folder of the course.").tag(config=True)

    def preprocess(self, nb: NotebookNode, resources: ResourcesDict) -> tuple[NotebookNode, ResourcesDict]:
        """Add the rubrics to one notebook. Parameters are those of `MakeWhole.preprocess`."""
        where = resources["nbgrader"]
        source = Path(self.course) / "source" / where["assignment"] / f"{where['notebook']}.ipynb"
        known = rubrics(nbformat.read(source, as_version=4))
        for place in reversed(range(len(nb.cells))):
            if rubric := known.get(cell_name(nb.cells[place])):
                nb.cells.insert(place + 1, new_markdown_cell(f"> **Rubric.** {rubric}"))
        return nb, resources


def rubrics(notebook: NotebookNode) -> dict[str, str]:
    """Return the rubrics of an exercise by the grade_id of the written answer.

    Parameters
    ----------
    notebook : NotebookNode
        The exercise's source. A model answer without a sentence that matches `RUBRIC` has no rubric.
    """
    written = (c for c in notebook.cells if c.cell_type == "markdown" and is_grade(c) and is_solution(c))
    found = {cell_name(cell): (cell.source, RUBRIC.search(cell.source)) for cell in written}
    return {name: " ".join(text[match.start() :].split()) for name, (text, match) in found.items() if match}
