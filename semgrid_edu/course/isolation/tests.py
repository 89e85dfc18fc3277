"""Test cells, run in the grader's process: the answers that they call work elsewhere."""

import builtins
import dis
import io
import linecache
import traceback
import warnings
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from types import CodeType
from typing import Any

import numpy as np
from nbformat import NotebookNode
from nbformat.v4 import new_output

from semgrid_edu.course.isolation.session import AnswerEndedError, AnswerTimeoutError, Session

INSTRUCTOR = "semgrid_instructor"
"""The instructor's module, with the hidden tests; their lines aren't shown."""

SHOWN = 2000
"""Characters of what an answer printed while a test ran."""


class CellTests:
    """The test cells of one submission.

    Parameters
    ----------
    seen, unseen : Session
        The student's notebook, twice: for the tests that she can read, and for the hidden ones.
    variant : tuple of int
        Which inputs the hidden tests draw.
    """

    def __init__(self, seen: Session, unseen: Session, variant: tuple[int, ...]) -> None:
        self.seen, self.unseen, self.variant = seen, unseen, variant
        self.names: dict[str, Any] = {"__name__": "__main__"}
        self.used: set[str] = set()

    def prepare(self, source: str) -> None:
        """Run one of the instructor's cells that isn't a test, for what it imports and defines.

        Parameters
        ----------
        source : str
            The cell.
        """
        code = compile(source, "<prepared>", "exec")
        self.used |= _global_names(code)
        _run(code, self.names)

    def test(self, source: str, name: str) -> list[NotebookNode]:
        """Run a test cell.

        Parameters
        ----------
        source : str
            The cell, as the instructor wrote it.
        name : str
            Its grade_id.

        Returns
        -------
        list of NotebookNode
            What belongs below it: what the answer printed, and the error that makes it fail.
        """
        file = f"<{name}>"
        linecache.cache[file] = len(source), None, source.splitlines(keepends=True), file
        code = compile(source, file, "exec")
        try:
            answers = self._answers(self.used | _global_names(code))
        except (AnswerEndedError, AnswerTimeoutError) as error:
            return [_as_output(error, file)]
        import_module(INSTRUCTOR).choose_variant(*self.variant)
        self.seen.printed = ""
        for session in (self.seen, self.unseen):
            session.begin()
        error = self._run_among(code, answers)
        printed = [new_output("stream", name="stdout", text=self.seen.printed[:SHOWN])] if self.seen.printed else []
        return printed + ([] if error is None else [_as_output(error, file)])

    def _run_among(self, code: CodeType, answers: dict[str, Any]) -> Exception | None:
        """Run a test among the instructor's names and the answers; both are afterwards as they were."""
        before = dict(self.names)
        self.names.update(answers)
        error = _run(code, self.names)
        self.names.clear()
        self.names.update(before)
        return error

    def _answers(self, names: set[str]) -> dict[str, Any]:
        """Return what names that the grader doesn't know stand for in the student's notebook."""
        self.seen.begin()
        wanted = sorted(names - self.names.keys() - vars(builtins).keys())
        return self.seen.names(wanted, self.unseen)


def _run(code: CodeType, names: dict[str, Any]) -> Exception | None:
    """Run code quietly; return the error that ended it."""
    with warnings.catch_warnings(), np.errstate(), redirect_stderr(io.StringIO()), redirect_stdout(io.StringIO()):
        try:
            exec(code, names)
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
    lines = [*shown, *getattr(error, "__notes__", []), f"{kind}: {error}"]
    return new_output("error", ename=kind, evalue=str(error), traceback=lines)
