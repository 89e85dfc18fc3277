"""A submission, cell by cell: answers run in the student's process, tests in the grader's."""

import builtins
import dis
import io
import json
import linecache
import re
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from types import CodeType
from typing import Any

import numpy as np
from nbformat import NotebookNode
from nbformat.v4 import new_output
from nbgrader.utils import is_grade, is_solution

from semgrid_edu.workshop.course.sandbox.process import StudentProcess
from semgrid_edu.workshop.course.sandbox.session import AnswerEndedError, AnswerTimeoutError, NoProcessError, Session

INSTRUCTOR = "semgrid_instructor"
"""The instructor's module, with the hidden tests; their lines aren't shown."""

MOST_PRINTED = 2000
"""Characters that are kept of what an answer printed while a test ran."""

PRINTED = "your code printed:\n"
"""What stands before that, so that it can't pass for the grader's words."""

MOST_OUTPUT = 30_000_000
"""Characters that are kept of all outputs of a notebook."""

STREAMS = "stdout", "stderr"
"""The streams of a cell."""

PICTURES, BASE64 = ("image/png", "image/jpeg"), re.compile(r"[A-Za-z0-9+/=\s]*")
"""The pictures that are kept, and how their data must look."""

ENDS = (AnswerEndedError, AnswerTimeoutError)
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
    tests = TestCells(seen, unseen, variant)
    try:
        _prepare(notebook, trusted, tests)
        ended = _run_seen(notebook, trusted, tests)
        # Whatever the student is shown has been said, and nobody listens any more when the hidden inputs come.
        seen.close()
        _run_unseen(notebook, tests)
        return ended
    except NoProcessError as error:
        raise ChildProcessError(str(error)) from error
    finally:
        seen.stop()
        unseen.stop()


def cell_name(cell: NotebookNode) -> str:
    """Return the grade_id of a cell; "" for a cell without one, or with metadata that nbgrader didn't write.

    Parameters
    ----------
    cell : NotebookNode
        Any cell of a submission.
    """
    marked = cell.metadata.get("nbgrader")
    name = marked.get("grade_id") if isinstance(marked, dict) else None
    return name if isinstance(name, str) else ""


class TestCells:
    """The test cells of one submission, run in this process: the answers that they call work elsewhere.

    Parameters
    ----------
    seen, unseen : Session
        The student's notebook, twice: for the tests that she can read, and for the hidden ones.
    variant : tuple of int
        Which inputs the hidden tests draw.
    """

    __test__ = False  # for pytest

    def __init__(self, seen: Session, unseen: Session, variant: tuple[int, ...]) -> None:
        self.seen, self.unseen, self.variant = seen, unseen, variant
        self.names: dict[str, Any] = {"__name__": "__main__"}
        self.used: set[str] = set()
        self.postponed: dict[str, list[Callable[[], str]]] = {}

    def prepare(self, source: str) -> None:
        """Run one of the instructor's cells that isn't a test, for what it imports and defines.

        Parameters
        ----------
        source : str
            The cell.
        """
        code = compile(source, "<prepared>", "exec")
        self.used |= _global_names(code)
        _run(lambda: exec(code, self.names))

    def test(self, source: str, name: str) -> list[NotebookNode]:
        """Run a test cell; return what belongs below it: what the answer printed, and the error that makes it fail.

        Its hidden part waits for `judge`.

        Parameters
        ----------
        source : str
            The cell, as the instructor wrote it.
        name : str
            Its grade_id.
        """
        file = f"<{name}>"
        linecache.cache[file] = len(source), None, source.splitlines(keepends=True), file
        code = compile(source, file, "exec")
        try:
            answers = self._answers(self.used | _global_names(code))
        except ENDS as error:
            return [_as_output(error, file)]
        self.seen.printed, self.seen.postponed = "", []
        self.seen.begin()
        error = self._run_among(code, answers)
        self.postponed[name] = self.seen.postponed if error is None else []
        printed = self.seen.printed[:MOST_PRINTED]
        outputs = [new_output("stream", name="stdout", text=PRINTED + printed)] if printed else []
        return outputs + ([] if error is None else [_as_output(error, file)])

    def judge(self, name: str) -> list[NotebookNode]:
        """Run the hidden part of a test cell; return the sentence that makes it fail, as it belongs below the cell.

        Parameters
        ----------
        name : str
            The cell's grade_id.
        """
        import_module(INSTRUCTOR).choose_variant(*self.variant)
        self.unseen.begin()
        complaints: list[str] = []
        error = _run(lambda: complaints.extend(check() for check in self.postponed.pop(name, [])))
        if error is not None:
            return [_as_output(error, "")]
        return [_error("AssertionError", says) for says in complaints[:] if says][:1]

    def _run_among(self, code: CodeType, answers: dict[str, Any]) -> Exception | None:
        """Run a test in the namespace of the instructor's functions, which call answers too; then restore it."""
        before = dict(self.names)
        self.names.update(answers)
        error = _run(lambda: exec(code, self.names))
        self.names.clear()
        self.names.update(before)
        return error

    def _answers(self, names: set[str]) -> dict[str, Any]:
        """Return what names that the grader doesn't know stand for in the student's notebook."""
        self.seen.begin()
        wanted = sorted(names - self.names.keys() - vars(builtins).keys())
        return self.seen.names(wanted, self.unseen)


def _run(work: Callable[[], object]) -> Exception | None:
    """Do something quietly; return the error that ended it."""
    with warnings.catch_warnings(), np.errstate(), redirect_stderr(io.StringIO()), redirect_stdout(io.StringIO()):
        try:
            work()
        except Exception as error:
            return error
    return None


def _global_names(code: CodeType) -> set[str]:
    """Return the global names that code, with the functions in it, looks up."""
    here = {one.argval for one in dis.get_instructions(code) if one.opname in ("LOAD_GLOBAL", "LOAD_NAME")}
    return here.union(*(_global_names(inner) for inner in code.co_consts if isinstance(inner, CodeType)))


def _as_output(error: Exception, file: str) -> NotebookNode:
    """Return an error as a notebook holds it: the line of the test, unless it is a hidden one, and what it says."""
    kind = type(error).__name__
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    line = frames[-1].line if frames else ""
    shown = [] if not line or "complaint" in line else [f"in the test: {line}"]
    return _error(kind, str(error), [*shown, *getattr(error, "__notes__", []), f"{kind}: {error}"])


def _run_seen(notebook: NotebookNode, trusted: Mapping[str, str], tests: TestCells) -> dict[str, str]:
    """Run each cell, of tests what students can read; return what ended the student's process, by grade_id."""
    room, ended = MOST_OUTPUT, {}
    for number, cell in enumerate((c for c in notebook.cells if c.cell_type == "code"), start=1):
        cell.execution_count, tests.seen.ended = number, ""
        cell.outputs, room = _shortened(_outputs(cell, trusted, tests), room)
        # A student's own error may have any name; what ended her process is told by the grader's side alone.
        if tests.seen.ended:
            ended[cell_name(cell)] = tests.seen.ended
    return ended


def _run_unseen(notebook: NotebookNode, tests: TestCells) -> None:
    """Run the hidden parts of tests in their order, each after the cells that stand above it."""
    for cell in (c for c in notebook.cells if c.cell_type == "code"):
        if is_grade(cell) and not is_solution(cell):
            cell.outputs += tests.judge(cell_name(cell))
        else:
            tests.unseen.run_later(cell.source)


def _prepare(notebook: NotebookNode, trusted: Mapping[str, str], tests: TestCells) -> None:
    """Run the instructor's cells that aren't tests, in the course's order, whatever order the student gave them."""
    cells = {cell_name(cell): cell for cell in notebook.cells if cell.cell_type == "code"}
    for name, source in trusted.items():
        if name in cells and not is_grade(cells[name]) and not is_solution(cells[name]):
            tests.prepare(source)


def _outputs(cell: NotebookNode, trusted: Mapping[str, str], tests: TestCells) -> list[NotebookNode]:
    """Run a cell where it belongs."""
    if is_grade(cell) and not is_solution(cell):
        if trusted.get(cell_name(cell)) == cell.source:
            return tests.test(cell.source, cell_name(cell))
        # Without an error nbgrader would give all points.
        return [_error("ValueError", "not the course's test")]
    return _as_outputs(tests.seen.run(cell.source))


def _as_outputs(reply: dict) -> list[NotebookNode]:
    """Return what a cell put out as a notebook holds it."""
    streams = [
        new_output("stream", name=k, text=reply["streams"][k]) for k in STREAMS if reply.get("streams", {}).get(k)
    ]
    shown = [new_output("display_data", data=data) for data in map(_harmless, reply.get("shown", [])) if data]
    error = reply.get("error")
    if error is None:
        return streams + shown
    return [*streams, *shown, _error(error.get("kind", ""), error.get("says", ""), error.get("traceback", []))]


def _harmless(shown: dict[str, str]) -> dict[str, str]:
    """Return text and pictures. HTML and SVG could hold scripts, which would run in the browser of who grades."""
    return {k: data for k, data in shown.items() if k == "text/plain" or (k in PICTURES and BASE64.fullmatch(data))}


def _shortened(outputs: list[NotebookNode], room: int) -> tuple[list[NotebookNode], int]:
    """Return outputs, without most of them when the notebook has no room left, and the room that is left then."""
    size = len(json.dumps(outputs))
    if size <= room:
        return outputs, room - size
    says = "all outputs together are too long to be shown"
    return [_error(one.ename[:99], says) for one in outputs if one.output_type == "error"], room


def _error(kind: str, says: str, lines: Sequence[str] = ()) -> NotebookNode:
    """Return an error as a notebook holds it."""
    return new_output("error", ename=kind, evalue=says, traceback=[*lines] or [f"{kind}: {says}"])
