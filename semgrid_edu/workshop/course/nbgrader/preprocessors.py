"""What this course adds to nbgrader's autograde: submissions are made whole, and run apart from their tests."""

import zlib
from pathlib import Path

import bleach
from nbconvert.exporters.exporter import ResourcesDict
from nbconvert.filters import strip_files_prefix
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell
from nbgrader.api import Gradebook, SourceCell
from nbgrader.preprocessors import NbGraderPreprocessor
from nbgrader.utils import is_grade, is_solution
from traitlets import Bool, Integer, Unicode
from traitlets import List as ListTrait

from semgrid_edu.workshop.course.sandbox.notebook import cell_name, run_submission
from semgrid_edu.workshop.course.sandbox.prepared import prepare, starter

CRASHED = "Crashed: "
"""How a comment begins that says what ended Python."""

SHOWN_TAGS = (
    *bleach.ALLOWED_TAGS,
    *("br", "dd", "del", "div", "dl", "dt", "h1", "h2", "h3", "h4", "h5", "h6", "hr", "img", "p", "pre", "s", "span"),
    *("sub", "sup", "table", "tbody", "td", "th", "thead", "tr"),
)
"""What Markdown makes, and nothing that runs."""

KEPT = ("kernelspec", "language_info")
"""What is kept of a notebook's metadata."""

CRASHES = "crashes"
"""Under this name `ExecuteApart` hands over to `NoteCrashes` what ended a student's process."""


class MakeWhole(NbGraderPreprocessor):
    """Gives a submission all cells of the exercise, each once, whatever the student deleted, split or changed.

    A locked cell that she changed, such as the imports, is restored and runs before her own version of it.
    """

    def preprocess(self, nb: NotebookNode, resources: ResourcesDict) -> tuple[NotebookNode, ResourcesDict]:
        """Repair one notebook; nbgrader's `OverwriteCells` comes after.

        Parameters
        ----------
        nb : NotebookNode
            The notebook.
        resources : ResourcesDict
            nbgrader's account of it: student, assignment, gradebook.
        """
        where = resources["nbgrader"]
        with Gradebook(where["db_url"]) as gradebook:
            exercise = gradebook.find_notebook(where["notebook"], where["assignment"])
            blanks = {cell.name: _blank(cell, exercise) for cell in exercise.source_cells}
        # Any other metadata would be the student's: widgets, a title, what else is shown in feedback.
        nb.metadata = NotebookNode({name: nb.metadata[name] for name in KEPT if name in nb.metadata})
        _mark(nb.cells, blanks)
        nb.cells = _with_own_versions(nb.cells, blanks)
        _insert_missing(nb.cells, blanks)
        return nb, resources


def _blank(source: SourceCell, exercise) -> NotebookNode:
    """Return a cell of the exercise as students get it, hidden tests and all."""
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


def _mark(cells: list[NotebookNode], blanks: dict[str, NotebookNode]) -> None:
    """Let the last cell of each name have the exercise's metadata for it, and the others none."""
    left = dict(blanks)
    for cell in reversed(cells):
        blank = left.pop(cell_name(cell), None)
        cell.metadata = NotebookNode()
        if blank is not None:
            cell.metadata["nbgrader"] = blank.metadata.nbgrader.copy()


def _with_own_versions(cells: list[NotebookNode], blanks: dict[str, NotebookNode]) -> list[NotebookNode]:
    """Return the cells; behind a locked one that the student changed, unless it is a test, stands her own version."""
    found = []
    for cell in cells:
        found.append(cell)
        blank = blanks.get(cell_name(cell))
        locked = blank is not None and not is_solution(blank) and not is_grade(blank)
        if locked and cell.cell_type == "code" and cell.source != blank.source:
            found.append(new_code_cell(cell.source))
    return found


def _insert_missing(cells: list[NotebookNode], blanks: dict[str, NotebookNode]) -> None:
    """Insert cells that were deleted, each behind the one that it follows in the exercise."""
    place = 0
    for name, blank in blanks.items():
        present = [k for k, cell in enumerate(cells) if cell_name(cell) == name]
        if not present:
            cells.insert(place, blank)
            present = [place]
        place = present[0] + 1


class ExecuteApart(NbGraderPreprocessor):
    """Runs a submission: its answers in a process that can do no harm, its tests in this one."""

    course = Unicode(help="The folder of the course.").tag(config=True)
    timeout = Integer(30, help="Seconds for a cell, or for all calls of a test.").tag(config=True)
    memory = Integer(4000, help="Megabytes of memory for a student's code.").tag(config=True)
    container = ListTrait(Unicode(), help="A command that starts a program in a container.").tag(config=True)
    seed_by_student = Bool(help="Whether each student's hidden tests draw inputs of their own.").tag(config=True)

    def preprocess(self, nb: NotebookNode, resources: ResourcesDict) -> tuple[NotebookNode, ResourcesDict]:
        """Run one notebook.

        Parameters
        ----------
        nb : NotebookNode
            The notebook.
        resources : ResourcesDict
            nbgrader's account of it: student, assignment, gradebook.
        """
        where, course = resources["nbgrader"], Path(self.course)
        prepared = prepare(course, where["assignment"], self.memory, tuple(self.container))
        with Gradebook(where["db_url"]) as gradebook:
            exercise = gradebook.find_notebook(where["notebook"], where["assignment"])
            trusted = {cell.name: cell.source for cell in exercise.source_cells}
        variant = (zlib.crc32(where["student"].encode()),) if self.seed_by_student else ()
        start = starter(self.memory, tuple(self.container))
        resources[CRASHES] = run_submission(nb, trusted, lambda: start(prepared), self.timeout, variant)
        return nb, resources


def without_scripts(html: str) -> str:
    """Return the HTML of a text cell without all that could run in a browser: that of the instructor is logged in.

    Parameters
    ----------
    html : str
        What nbconvert made of Markdown. This takes the place of its filter `strip_files_prefix`, the last that nbgrader
        applies.
    """
    attributes = {**bleach.ALLOWED_ATTRIBUTES, "*": ["class", "id"], "img": ["src", "alt"]}
    return bleach.clean(strip_files_prefix(html), tags=SHOWN_TAGS, attributes=attributes)


class NoteCrashes(NbGraderPreprocessor):
    """Says in the gradebook which answers ended Python or had to be stopped: 0 points alone would say "did nothing"."""

    def preprocess(self, nb: NotebookNode, resources: ResourcesDict) -> tuple[NotebookNode, ResourcesDict]:
        """Write the comments of one notebook.

        Parameters
        ----------
        nb : NotebookNode
            The notebook.
        resources : ResourcesDict
            nbgrader's account of it: student, assignment, gradebook.
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
