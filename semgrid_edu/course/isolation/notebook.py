"""A submission, cell by cell: answers run in the student's process, tests in the grader's."""

import json
import re
from collections.abc import Callable, Mapping, Sequence

from nbformat import NotebookNode
from nbformat.v4 import new_output
from nbgrader.utils import is_grade, is_solution

from semgrid_edu.course.isolation.process import StudentProcess
from semgrid_edu.course.isolation.session import AnswerEndedError, AnswerTimeoutError, NoProcessError, Session
from semgrid_edu.course.isolation.tests import CellTests

MOST_OUTPUT = 30_000_000
"""Characters of all outputs of a notebook that are kept."""

ENDS = tuple(kind.__name__ for kind in (AnswerEndedError, AnswerTimeoutError))
"""The errors of an answer that ended its process, or had to be ended."""


def run_submission(
    notebook: NotebookNode,
    trusted: Mapping[str, str],
    start: Callable[[], StudentProcess],
    timeout: float,
    variant: tuple[int, ...] = (),
) -> dict[str, str]:
    """Run a submission, and write outputs below its cells.

    Parameters
    ----------
    notebook : NotebookNode
        The submission.
    trusted : mapping of str to str
        The text of the instructor's cells, by grade_id. A test runs in the grader's process, so only with this text.
    start : callable
        () -> StudentProcess.
    timeout : float
        How long a cell may take, seconds.
    variant : tuple of int
        Which inputs the hidden tests draw: see `semgrid_instructor.choose_variant`.

    Returns
    -------
    dict of str to str
        What ended a student's process, by the grade_id of the cell in which it happened ("" for a cell of her own).

    Raises
    ------
    ChildProcessError
        When no process could be started for her code: that says nothing about her answers.
    """
    seen, unseen = Session(start, timeout), Session(start, timeout, secret=True)
    tests = CellTests(seen, unseen, variant)
    room = MOST_OUTPUT
    try:
        _prepare(notebook, trusted, tests)
        for number, cell in enumerate((c for c in notebook.cells if c.cell_type == "code"), start=1):
            cell.execution_count = number
            cell.outputs, room = _kept(_outputs(cell, trusted, tests), room)
        return {cell_name(c): o.evalue for c in notebook.cells for o in c.get("outputs", []) if o.get("ename") in ENDS}
    except NoProcessError as error:
        raise ChildProcessError(str(error)) from error
    finally:
        seen.stop()
        unseen.stop()


def cell_name(cell: NotebookNode) -> str:
    """Return the grade_id of a cell.

    Parameters
    ----------
    cell : NotebookNode
        Any cell of a submission.

    Returns
    -------
    str
        "" for a cell without one, or with metadata that nbgrader didn't write.
    """
    marked = cell.metadata.get("nbgrader")
    name = marked.get("grade_id") if isinstance(marked, dict) else None
    return name if isinstance(name, str) else ""


def _prepare(notebook: NotebookNode, trusted: Mapping[str, str], tests: CellTests) -> None:
    """Run the instructor's cells that aren't tests, in the course's order, whatever order the student gave them."""
    cells = {cell_name(cell): cell for cell in notebook.cells if cell.cell_type == "code"}
    for name, source in trusted.items():
        if name in cells and not is_grade(cells[name]) and not is_solution(cells[name]):
            tests.prepare(source)


def _kept(outputs: list[NotebookNode], room: int) -> tuple[list[NotebookNode], int]:
    """Return outputs, shortened when the notebook has no room left for them, and the room that is left then."""
    size = len(json.dumps(outputs))
    if size <= room:
        return outputs, room - size
    says = "all outputs together are too long to be shown"
    return [_error(one.ename[:99], says) for one in outputs if one.output_type == "error"], room


def _outputs(cell: NotebookNode, trusted: Mapping[str, str], tests: CellTests) -> list[NotebookNode]:
    """Run a cell where it belongs."""
    if is_grade(cell) and not is_solution(cell):
        is_trusted = trusted.get(cell_name(cell)) == cell.source
        # Without an error nbgrader would give all points.
        return (
            tests.test(cell.source, cell_name(cell)) if is_trusted else [_error("ValueError", "not the course's test")]
        )
    tests.unseen.run_later(cell.source)
    return _as_outputs(tests.seen.run(cell.source))


def _as_outputs(reply: dict) -> list[NotebookNode]:
    """Return what a cell put out as a notebook holds it."""
    streams = [new_output("stream", name=name, text=text) for name, text in reply["streams"].items() if text]
    shown = [new_output("display_data", data=data) for data in map(_harmless, reply["shown"]) if data]
    error = reply.get("error")
    if error is None:
        return streams + shown
    return [*streams, *shown, _error(error["kind"], error["says"], error["traceback"])]


def _harmless(shown: dict[str, str]) -> dict[str, str]:
    """Return text and pictures. HTML and SVG could hold scripts, which would run in the browser of who grades."""
    pictures = ("image/png", "image/jpeg")
    return {
        kind: data
        for kind, data in shown.items()
        if kind == "text/plain" or (kind in pictures and re.fullmatch(r"[A-Za-z0-9+/=\s]*", data))
    }


def _error(kind: str, says: str, lines: Sequence[str] = ()) -> NotebookNode:
    """Return an error as a notebook holds it."""
    return new_output("error", ename=kind, evalue=says, traceback=[*lines] or [f"{kind}: {says}"])
