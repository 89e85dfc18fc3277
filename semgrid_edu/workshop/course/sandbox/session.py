"""A student's notebook, whose cells run and whose functions are called; a crash in one leaves the others intact."""

import builtins
import faulthandler
import os
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from semgrid_edu.workshop.course.sandbox.process import ProcessEndedError, StudentProcess
from semgrid_edu.workshop.course.sandbox.values import put_back

TOTAL_TIME = 20
"""All cells and calls together may take this many times the time limit of a cell."""

MAX_LINE = 300
"""With secret inputs, errors name no line beyond this one: a longer cell could report any number by its line."""


GRADERS_TIME = 300
"""Seconds for the grader's own work on a cell, beyond the student's; then its process is ended, as by a crash."""

NOWHERE = os.open(os.devnull, os.O_WRONLY)
"""Where that is reported."""


class AnswerTimeoutError(Exception):
    """An answer has not returned in time."""


class AnswerEndedError(Exception):
    """An answer has ended its process."""


class AnswerError(Exception):
    """An answer has raised an error that isn't a standard one."""


class NoProcessError(BaseException):
    """No process could be started for the student's code.

    It isn't an `Exception`, because tests catch those and would blame the answer.
    """


class Session:
    """A student's notebook in a separate process, which is restarted when it has ended.

    Parameters
    ----------
    start : callable
        () -> StudentProcess.
    timeout : float
        How long a cell may take, or all calls of a test cell together, seconds.
    secret : bool
        Whether the student must not learn the inputs of functions, so that errors are reported without their messages.

    Attributes
    ----------
    printed : str
        What the student's functions have printed since it was last emptied.
    ended : str
        What ended the process since this cell began; "" if nothing did.
    postponed : list of callable
        Checks, () -> str, that were postponed by `RemoteFunction.judge_later`.
    """

    def __init__(self, start: Callable[[], StudentProcess], timeout: float, secret: bool = False) -> None:
        self.start = start
        self.timeout = timeout
        self.secret = secret
        self.process: StudentProcess | None = None
        self.cells: list[tuple[str, float]] = []
        self.waiting: list[tuple[str, float]] = []
        self.printed = ""
        self.postponed: list[Callable[[], str]] = []
        self.stopped = False
        self.left_in_all = TOTAL_TIME * timeout
        self.begin()

    def begin(self, times: float = 1) -> None:
        """Start the time of a cell.

        Parameters
        ----------
        times : float
            How many times as long as others it may take.
        """
        self.left = self.allowed = times * self.timeout
        self.ended = ""
        # Not even compiled code that a callback or a test runs here for an answer's sake goes on for ever.
        faulthandler.dump_traceback_later(self.left + GRADERS_TIME, exit=True, file=NOWHERE)

    def run(self, code: str, times: float = 1) -> dict[str, Any]:
        """Run a cell; one that ends the process, or doesn't end, isn't run again.

        Parameters
        ----------
        code : str
            The cell.
        times : float
            How many times as long as others it may take.

        Returns
        -------
        dict
            "streams", "shown" and, if the cell failed, "error", as in `Worker.run`.
        """
        self.begin(times)
        try:
            reply = self._ask({"do": "run", "code": code})
        except (AnswerTimeoutError, AnswerEndedError) as error:
            report = {"kind": type(error).__name__, "message": str(error), "line": "", "traceback": []}
            return {"streams": {}, "shown": [], "error": report}
        self.cells.append((code, times))
        return reply

    def run_later(self, code: str, times: float = 1) -> None:
        """Run a cell before the next call of a function, and not at all if there is none.

        Parameters are those of `Session.run`.
        """
        self.waiting.append((code, times))

    def names(self, wanted: list[str], unseen: "Session") -> dict[str, Any]:
        """Return functions to call and plain values for the names that the student's notebook defines.

        Parameters
        ----------
        wanted : list of str
            Names.
        unseen : Session
            Where the functions are called with the inputs of hidden tests.
        """
        reply = self._ask({"do": "names", "wanted": wanted})
        # The reply may contain any names; those that weren't asked for would replace what the tests rely on.
        functions = {name: RemoteFunction(self, name, unseen) for name in reply.get("functions", []) if name in wanted}
        return {name: value for name, value in reply.get("values", {}).items() if name in wanted} | functions

    def call(self, name: str, arguments: tuple, named: dict) -> Any:
        """Call a function of the notebook, apply the changes that it makes to its arguments, and return its result.

        Parameters
        ----------
        name : str
            The function.
        arguments, named : tuple, dict
            What it is called with.

        Raises
        ------
        Exception
            What it raises, if that is a standard error; otherwise AnswerError, AnswerTimeoutError or AnswerEndedError.
        """
        self._catch_up()
        reply = self._ask({"do": "call", "name": name, "arguments": arguments, "named": named}, [])
        self.printed += reply.get("streams", {}).get("stdout", "")
        if "changed" in reply:
            put_back((arguments, named), reply["changed"])
        if "error" in reply:
            raise self._as_error(reply["error"])
        return reply["result"]

    def measured_call(self, name: str, arguments: tuple) -> tuple[Any, float]:
        """Call a function of the notebook; return its result, and the growth of its memory to the peak, megabytes.

        Parameters
        ----------
        name : str
            The function.
        arguments : tuple
            What it is called with.
        """
        self._catch_up()
        with self._alive().peak_memory() as peak:
            return self.call(name, arguments, {}), peak.megabytes()

    def _as_error(self, error: dict[str, Any]) -> Exception:
        """Return the error that an answer raised; with secret inputs, only its line."""
        if self.secret:
            lines = min(MAX_LINE, max((cell.count("\n") + 1 for cell, _ in self.cells), default=0))
            message = f"an error in line {error['number']}" if error["number"] in range(1, lines + 1) else "an error"
            found = _standard_error(error | {"kind": "", "message": message, "line": ""})
            found.secret = message
            return found
        # A line number outside all cells was forged to smuggle out a value.
        known = any(error["line"] in cell for cell, _ in self.cells)
        return _standard_error(error | {"line": error["line"] if known else ""})

    def _catch_up(self) -> None:
        """Run the cells that are waiting."""
        if self.waiting:
            while self.waiting:
                self.run(*self.waiting.pop(0))
            self.begin()

    def _ask(self, message: dict, callbacks: list[Callable] | None = None) -> dict[str, Any]:
        """Ask the process, which is started if need be; only the time of the reply counts as the student's."""
        if self.left_in_all <= 0:
            self.ended = f"all cells together have used up their time, {TOTAL_TIME * self.timeout:g} s"
            raise AnswerTimeoutError(self.ended)
        process = self._alive()
        began = time.monotonic()
        try:
            return process.ask(message, began + self.left, callbacks)
        except TimeoutError:
            self.process = None
            self.ended = f"no reply before timeout, {self.allowed:g} s: does a loop never end?"
            raise AnswerTimeoutError(self.ended) from None
        except ProcessEndedError:
            self.process = None
            self.ended = "Python itself ended here: by exit(), a crash, or for want of memory?"
            raise AnswerEndedError(self.ended) from None
        finally:
            self.left -= time.monotonic() - began
            self.left_in_all -= time.monotonic() - began

    def _alive(self) -> StudentProcess:
        """Return the process; if there is none, start one and run the earlier cells in it."""
        if self.stopped:
            raise NoProcessError("a hidden test calls an answer whose output the student sees")
        if self.process is None:
            self._start_again()
        return self.process

    def _start_again(self) -> None:
        """Start a process, and run the earlier cells in it."""
        began = time.monotonic()
        try:
            self.process = self.start()
        except Exception as error:
            raise NoProcessError(f"no process could be started for students' code: {error}") from error
        self.left_in_all -= time.monotonic() - began
        times = self.allowed / self.timeout
        cells = self.cells
        self.cells = []
        for earlier in cells:
            self.run(*earlier)
        self.begin(times)

    def stop(self) -> None:
        """End the process for good."""
        self.stopped = True
        faulthandler.cancel_dump_traceback_later()
        if self.process is not None:
            self.process.stop()
            self.process = None


class RemoteFunction:
    """A function that runs in a student's process.

    Parameters
    ----------
    session : Session
        The student's notebook.
    name : str
        The function's name there.
    unseen : Session, optional
        The same notebook in another process.

    Attributes
    ----------
    unseen : RemoteFunction
        The same function in a process whose output the student doesn't see, for the inputs of hidden tests.
    """

    def __init__(self, session: Session, name: str, unseen: Session | None = None) -> None:
        self.session = session
        self.__name__ = name
        self.unseen = RemoteFunction(unseen, name) if unseen else self

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the function; parameters and result are those of `Session.call`."""
        return self.session.call(self.__name__, arguments, named)

    def judge_later(self, check: Callable[[], str]) -> str:
        """Postpone a check of this answer until the process whose output the student sees has ended.

        Parameters
        ----------
        check : callable
            () -> str, a complaint.

        Returns
        -------
        str
            "", no complaint so far.
        """
        self.session.postponed.append(check)
        return ""

    def peak_megabytes(self, *arguments: Any) -> tuple[Any, float]:
        """Call the function; return its result and its peak of memory, as `Session.measured_call` does.

        Parameters
        ----------
        *arguments
            What it is called with.
        """
        # The first call isn't measured: it compiles and loads. Its inputs are shuffled, so that no result can be kept.
        order = cache(np.random.default_rng().permutation)  # axes of the same length are shuffled in the same way
        arrays = (one[np.ix_(*map(order, one.shape))] if isinstance(one, np.ndarray) else one for one in arguments)
        self(*arrays)
        return self.session.measured_call(self.__name__, arguments)


def _standard_error(reported: dict[str, Any]) -> Exception:
    """Return the error that an answer raised, as the same standard kind."""
    kind = getattr(builtins, reported["standard"], Exception)
    # A StopIteration would silently end a loop of the test.
    if not issubclass(kind, Exception) or kind is Exception or issubclass(kind, StopIteration | StopAsyncIteration):
        kind = None
    try:
        error = kind(reported["message"])
    except TypeError:  # no standard error, or one that isn't made of a message
        error = AnswerError(f"{reported['kind']}: {reported['message']}".removeprefix(": "))
    if reported["line"]:
        error.add_note(f"in your line: {reported['line']}")
    return error
