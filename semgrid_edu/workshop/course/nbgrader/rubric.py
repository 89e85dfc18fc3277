"""The rubric of a written answer, shown below it wherever the instructor or the student reads it."""

import re
from pathlib import Path

import nbformat
from nbconvert.exporters.exporter import ResourcesDict
from nbformat import NotebookNode
from nbformat.v4 import new_markdown_cell
from nbgrader.preprocessors import NbGraderPreprocessor
from nbgrader.utils import is_grade, is_solution
from traitlets import Unicode

from semgrid_edu.workshop.course.sandbox.notebook import cell_name

BEGINS = re.compile(r"\b(One|Half a) point for\b")
"""The beginning of a rubric, which is the rest of the model answer's cell."""


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
        The exercise's source. A model answer without a sentence that matches `BEGINS` has no rubric.
    """
    written = (c for c in notebook.cells if c.cell_type == "markdown" and is_grade(c) and is_solution(c))
    found = {cell_name(cell): (cell.source, BEGINS.search(cell.source)) for cell in written}
    return {name: " ".join(text[match.start() :].split()) for name, (text, match) in found.items() if match}
