"""A submission, cell by cell: answers run in the student's process, tests in the grader's."""

import builtins
import dis
import io
import json
import linecache
import re
import traceback
import warnings
from base64 import b64decode
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from types import CodeType
from typing import Any

import numpy as np
from nbformat import NotebookNode
from nbformat.v4 import new_output
from nbgrader.utils import is_grade, is_solution
from PIL import Image

from semgrid_edu.workshop.course.sandbox.process import StudentProcess
from semgrid_edu.workshop.course.sandbox.session import AnswerEndedError, AnswerTimeoutError, NoProcessError, Session
from semgrid_edu.workshop.course.sandbox.values import writable

INSTRUCTORS_TIME = 4
"""How many times as long as an answer a cell of the exercise may take: on a busy machine it isn't her fault."""

MAX_PRINTED = 2000
"""How many characters are kept of what an answer printed during a test."""

PRINTED = "your code printed:\n"
"""The heading above it, so that it can't be mistaken for the grader's words."""

MAX_OUTPUT_TEXT = 30_000_000
"""How many characters of outputs are kept in a notebook."""

MAX_ERROR_TEXT = 20_000
"""How many characters are kept of a line of an error: a test may quote what an answer returned."""

PICTURES, BASE64 = ("image/png", "image/jpeg"), re.compile(r"[A-Za-z0-9+/=\s]*")
"""The kinds of pictures that are kept, and the form of their data."""

MAX_PIXELS = 25_000_000
"""How many pixels a picture may have: a few kilobytes can hold more than a browser's memory."""

ENDS = (AnswerEndedError, AnswerTimeoutError)
"""The errors of an answer that ended its process, or had to be ended."""


def run_submission(
    notebook: NotebookNode,
    trusted: Mapping[str, str],
    start: Callable[[], StudentProcess],
    timeout: float,
) -> dict[str, str]:
    """Run a submission, and write outputs below its cells.

    Parameters
    ----------
    notebook : NotebookNode
        The submission.
    trusted : mapping of str to str
        The text of the instructor's cells, by grade_id. A test runs in the grader's process, and only with this text.
    start : callable
        () -> StudentProcess.
    timeout : float
        How long a cell may take, seconds.

    Returns
    -------
    dict of str to str
        What ended the student's process, by the grade_id of the cell that it ran ("" for a cell that she added).

    Raises
    ------
    ChildProcessError
        When no process could be started for her code, which proves nothing about her answers.
    """
    seen = Session(start, timeout)
    unseen = Session(start, timeout, secret=True)
    tests = TestCells(seen, unseen)
    try:
        _prepare(notebook, trusted, tests)
        ended = _run_seen(notebook, trusted, tests)
        # Hidden inputs are sent only after the process whose output the student sees has ended.
        seen.stop()
        _run_unseen(notebook, trusted, tests)
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
    """The test cells of one submission, run in this process; the answers that they call run in others.

    Parameters
    ----------
    seen, unseen : Session
        The student's notebook in two processes: for the tests that she can read, and for the hidden ones.
    """

    __test__ = False  # for pytest

    def __init__(self, seen: Session, unseen: Session) -> None:
        self.seen = seen
        self.unseen = unseen
        self.names: dict[str, Any] = {"__name__": "__main__"}
        self.used: set[str] = set()
        self.postponed: dict[str, list[Callable[[], str]]] = {}

    def prepare(self, source: str) -> None:
        """Run one of the instructor's cells that aren't tests, for its imports and definitions.

        Parameters
        ----------
        source : str
            The cell.
        """
        code = compile(source, "<prepared>", "exec")
        self.used |= _global_names(code)
        _run(lambda: exec(code, self.names))

    def test(self, source: str, name: str) -> list[NotebookNode]:
        """Run a test cell; return its outputs: what the answer printed, and the error that makes it fail.

        `judge` runs the hidden part later.

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
        self.seen.printed = ""
        self.seen.postponed = []
        self.seen.begin()
        error = self._run_among(code, answers)
        self.postponed[name] = self.seen.postponed if error is None else []
        printed = self.seen.printed[:MAX_PRINTED]
        outputs = [new_output("stream", name="stdout", text=PRINTED + printed)] if printed else []
        return outputs + ([] if error is None else [_as_output(error, file)])

    def judge(self, name: str) -> list[NotebookNode]:
        """Run the hidden part of a test cell; return the sentence that makes it fail, as an output.

        Parameters
        ----------
        name : str
            The cell's grade_id.
        """
        self.unseen.begin()
        complaints: list[str] = []
        error = _run(lambda: complaints.extend(check() for check in self.postponed.pop(name, [])))
        if error is not None:
            return [_as_output(error, "")]
        return [_error("AssertionError", message) for message in complaints[:] if message][:1]

    def _run_among(self, code: CodeType, answers: dict[str, Any]) -> Exception | None:
        """Run a test in the namespace of the instructor's functions, which call answers too; then restore it."""
        before = dict(self.names)
        self.names.update(answers)
        error = _run(lambda: exec(code, self.names))
        self.names.clear()
        self.names.update(before)
        return error

    def _answers(self, names: set[str]) -> dict[str, Any]:
        """Return the student's functions and values for the names that the grader doesn't know."""
        self.seen.begin()
        wanted = sorted(names - self.names.keys() - vars(builtins).keys())
        return self.seen.names(wanted, self.unseen)


def _run(work: Callable[[], object]) -> Exception | None:
    """Call a function quietly; return the error that ended it."""
    with warnings.catch_warnings(), np.errstate(), redirect_stderr(io.StringIO()), redirect_stdout(io.StringIO()):
        try:
            work()
        except Exception as error:
            return error
    return None


def _global_names(code: CodeType) -> set[str]:
    """Return the global names that code and the functions in it look up."""
    here = {one.argval for one in dis.get_instructions(code) if one.opname in ("LOAD_GLOBAL", "LOAD_NAME")}
    return here.union(*(_global_names(inner) for inner in code.co_consts if isinstance(inner, CodeType)))


def _as_output(error: Exception, file: str) -> NotebookNode:
    """Return an error as an output: the line of the test, unless it is a hidden one, and the message."""
    kind = type(error).__name__
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    line = frames[-1].line if frames else ""
    shown = [] if not line or "complaint" in line else [f"in the test: {line}"]
    return _error(kind, str(error), [*shown, *getattr(error, "__notes__", []), f"{kind}: {error}"])


def _run_seen(notebook: NotebookNode, trusted: Mapping[str, str], tests: TestCells) -> dict[str, str]:
    """Run each cell, and the visible part of tests; return what ended the student's process, by grade_id."""
    room = MAX_OUTPUT_TEXT
    ended = {}
    for number, cell in enumerate((c for c in notebook.cells if c.cell_type == "code"), start=1):
        cell.execution_count = number
        tests.seen.ended = ""
        cell.outputs, room = _shortened(_outputs(cell, trusted, tests), room)
        # A student can raise errors of any name, so only the grader's side decides what ended her process.
        if tests.seen.ended:
            ended[cell_name(cell)] = tests.seen.ended
    return ended


def _run_unseen(notebook: NotebookNode, trusted: Mapping[str, str], tests: TestCells) -> None:
    """Run the hidden parts of tests in their order, each after the cells above it."""
    for cell in (c for c in notebook.cells if c.cell_type == "code"):
        if is_grade(cell) and not is_solution(cell):
            cell.outputs += tests.judge(cell_name(cell))
        else:
            tests.unseen.run_later(cell.source, _times(cell, trusted))


def _prepare(notebook: NotebookNode, trusted: Mapping[str, str], tests: TestCells) -> None:
    """Run the instructor's cells that aren't tests, in the order of the exercise, not of the submission."""
    cells = {cell_name(cell): cell for cell in notebook.cells if cell.cell_type == "code"}
    for name, source in trusted.items():
        if name in cells and not is_grade(cells[name]) and not is_solution(cells[name]):
            tests.prepare(source)


def _outputs(cell: NotebookNode, trusted: Mapping[str, str], tests: TestCells) -> list[NotebookNode]:
    """Run a cell where it belongs."""
    if is_grade(cell) and not is_solution(cell):
        if trusted.get(cell_name(cell)) == cell.source:
            return tests.test(cell.source, cell_name(cell))
        # Without an error nbgrader would give full points.
        return [_error("ValueError", "not the course's test")]
    return _as_outputs(tests.seen.run(cell.source, _times(cell, trusted)))


def _times(cell: NotebookNode, trusted: Mapping[str, str]) -> float:
    """Return how many times as long as an answer a cell may take."""
    return INSTRUCTORS_TIME if trusted.get(cell_name(cell)) == cell.source else 1


def _as_outputs(reply: dict) -> list[NotebookNode]:
    """Return what a cell put out as outputs of a notebook."""
    printed = reply.get("streams", {})
    streams = [new_output("stream", name=k, text=printed[k]) for k in ("stdout", "stderr") if printed.get(k)]
    shown = [new_output("display_data", data=data) for data in map(_harmless, reply.get("shown", [])) if data]
    error = reply.get("error")
    if error is None:
        return streams + shown
    return [*streams, *shown, _error(error.get("kind", ""), error.get("message", ""), error.get("traceback", []))]


def _harmless(shown: dict[str, str]) -> dict[str, str]:
    """Return text and pictures. HTML and SVG could contain scripts, which would run in the grader's browser."""
    return {k: data for k, data in shown.items() if k == "text/plain" or (k in PICTURES and is_small_picture(data))}


def is_small_picture(data: str) -> bool:
    """Return whether a text is a picture that a browser can show.

    Parameters
    ----------
    data : str
        A PNG, JPEG or GIF file in base64.
    """
    try:
        width, height = Image.open(io.BytesIO(b64decode(data)), formats=("PNG", "JPEG", "GIF")).size
    except Exception:
        return False
    return BASE64.fullmatch(data) is not None and width * height <= MAX_PIXELS


def _shortened(outputs: list[NotebookNode], room: int) -> tuple[list[NotebookNode], int]:
    """Return outputs, or only their errors if the notebook has no room left, and the room that is left then."""
    size = len(json.dumps(outputs))
    if size <= room:
        return outputs, room - size
    message = "all outputs together are too long to be shown"
    return [_error(one.ename[:99], message) for one in outputs if one.output_type == "error"], room


def _error(kind: str, message: str, lines: Sequence[str] = ()) -> NotebookNode:
    """Return an error as an output of a notebook."""
    texts = [writable(text[:MAX_ERROR_TEXT]) for text in (kind, message, *(lines or [f"{kind}: {message}"]))]
    return new_output("error", ename=texts[0], evalue=texts[1], traceback=texts[2:])
