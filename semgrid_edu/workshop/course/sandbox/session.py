"""A student's notebook to run and its functions to call: whatever one cell or call does, the next finds the others."""

import builtins
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from semgrid_edu.workshop.course.sandbox.process import ProcessEndedError, StudentProcess
from semgrid_edu.workshop.course.sandbox.values import put_back

ALL = 20
"""How many times the time of a cell all cells and calls together may take."""

MOST_LINES = 300
"""The last line of a cell that is named where inputs are secret: a longer cell could tell any number by its line."""


class AnswerTimeoutError(Exception):
    """An answer has not come back in time."""


class AnswerEndedError(Exception):
    """An answer has ended its own process."""


class AnswerError(Exception):
    """An answer has raised an error that isn't one of Python's own."""


class NoProcessError(BaseException):
    """No process could be started for the student's code.

    It isn't an `Exception`: tests catch those, and would take it for a fault of the answer.
    """


class Session:
    """A student's notebook in a process of its own, which is started again when it has ended.

    Parameters
    ----------
    start : callable
        () -> StudentProcess.
    timeout : float
        How long a cell may take, or all calls of a test cell together, seconds.
    secret : bool
        Whether the student must not learn what functions are called with, so that what they say in errors is left out.

    Attributes
    ----------
    printed : str
        What the student's functions have printed since it was last emptied.
    ended : str
        What ended the process since the time of this cell began; "" when nothing did.
    postponed : list of callable
        Checks, () -> str, of what was asked to be judged later.
    """

    def __init__(self, start: Callable[[], StudentProcess], timeout: float, secret: bool = False) -> None:
        self.start, self.timeout, self.secret = start, timeout, secret
        self.process: StudentProcess | None = None
        self.cells: list[str] = []
        self.waiting: list[str] = []
        self.printed = ""
        self.postponed: list[Callable[[], str]] = []
        self.closed = False
        self.left_in_all = ALL * timeout
        self.begin()

    def begin(self) -> None:
        """Let the time of a cell begin."""
        self.left, self.ended = self.timeout, ""

    def run(self, code: str) -> dict[str, Any]:
        """Run a cell; one that ends the process, or doesn't end, is left out from then on.

        Parameters
        ----------
        code : str
            The cell.

        Returns
        -------
        dict
            "streams", "shown" and, if the cell failed, "error", as in `Worker.run`.
        """
        self.begin()
        try:
            reply = self._ask({"do": "run", "code": code})
        except (AnswerTimeoutError, AnswerEndedError) as error:
            said = {"kind": type(error).__name__, "says": str(error), "line": "", "traceback": []}
            return {"streams": {}, "shown": [], "error": said}
        self.cells.append(code)
        return reply

    def run_later(self, code: str) -> None:
        """Run a cell when a function is called, and not at all when none is.

        Parameters
        ----------
        code : str
            The cell.
        """
        self.waiting.append(code)

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
        # The reply may hold any names; those that weren't asked for would replace what the tests rely on.
        functions = {name: RemoteFunction(self, name, unseen) for name in reply.get("functions", []) if name in wanted}
        return {name: value for name, value in reply.get("values", {}).items() if name in wanted} | functions

    def call(self, name: str, arguments: tuple, named: dict, measured: bool) -> tuple[Any, float]:
        """Call a function of the notebook, and change the arguments that it changes.

        Parameters
        ----------
        name : str
            The function.
        arguments, named : tuple, dict
            What it is called with.
        measured : bool
            Whether its memory is measured, which makes it slower.

        Returns
        -------
        result : object
            What it returns.
        megabytes : float
            The most memory that it held; NaN when that was not measured.

        Raises
        ------
        Exception
            What it raises, if that is one of Python's own errors; otherwise AnswerError, AnswerTimeoutError or
            AnswerEndedError.
        """
        self._catch_up()
        inside = measured and not self._alive().begin_measuring()
        message = {"do": "call", "name": name, "arguments": arguments, "named": named, "measured": inside}
        reply = self._ask(message, [])
        self.printed += reply.get("streams", {}).get("stdout", "")
        if "changed" in reply:
            put_back((arguments, named), reply["changed"])
        megabytes = self._alive().megabytes() if measured and not inside else reply.get("megabytes", float("nan"))
        if "error" in reply:
            raise self._as_error(reply["error"])
        return reply["result"], megabytes

    def _as_error(self, error: dict[str, Any]) -> Exception:
        """Return the error that an answer raised; where its inputs are secret, no more of it than the line."""
        if self.secret:
            lines = min(MOST_LINES, max((cell.count("\n") + 1 for cell in self.cells), default=0))
            says = f"an error in line {error['number']}" if error["number"] in range(1, lines + 1) else "an error"
            found = _standard_error(error | {"kind": "", "says": says, "line": ""})
            found.secret = says
            return found
        # A line that is in no cell was put there to say something else.
        known = any(error["line"] in cell for cell in self.cells)
        return _standard_error(error | {"line": error["line"] if known else ""})

    def _catch_up(self) -> None:
        """Run the cells that are waiting."""
        if self.waiting:
            while self.waiting:
                self.run(self.waiting.pop(0))
            self.begin()

    def _ask(self, message: dict, callbacks: list[Callable] | None = None) -> dict[str, Any]:
        """Ask the process, one that is alive; only the time that passes meanwhile counts as the student's."""
        if self.left_in_all <= 0:
            self.ended = f"all cells together have used up their time, {ALL * self.timeout:g} s"
            raise AnswerTimeoutError(self.ended)
        process, began = self._alive(), time.monotonic()
        try:
            return process.ask(message, began + self.left, callbacks)
        except TimeoutError:
            self.process, self.ended = None, f"no reply before timeout, {self.timeout:g} s: does a loop never end?"
            raise AnswerTimeoutError(self.ended) from None
        except ProcessEndedError:
            self.process, self.ended = None, "Python itself ended here: by exit(), a crash, or for want of memory?"
            raise AnswerEndedError(self.ended) from None
        finally:
            self.left -= time.monotonic() - began
            self.left_in_all -= time.monotonic() - began

    def _alive(self) -> StudentProcess:
        """Return a process; without one, start it, and run in it the cells that ran before."""
        if self.closed:
            raise NoProcessError("a hidden test calls an answer whose output the student sees")
        if self.process is None:
            self._start_again()
        return self.process

    def _start_again(self) -> None:
        """Start a process, and run in it the cells that ran before."""
        began = time.monotonic()
        try:
            self.process = self.start()
        except Exception as error:
            raise NoProcessError(f"no process could be started for students' code: {error}") from error
        self.left_in_all -= time.monotonic() - began
        cells, self.cells = self.cells, []
        for code in cells:
            self.run(code)
        self.begin()

    def stop(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.stop()
            self.process = None

    def close(self) -> None:
        """End the process for good."""
        self.stop()
        self.closed = True


class RemoteFunction:
    """A function that works in a student's process.

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
        The same function in a process of which the student is shown nothing, for the inputs of hidden tests.
    """

    def __init__(self, session: Session, name: str, unseen: Session | None = None) -> None:
        self.session, self.__name__ = session, name
        self.unseen = RemoteFunction(unseen, name) if unseen else self

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the function; parameters and result are those of `Session.call`."""
        return self.session.call(self.__name__, arguments, named, measured=False)[0]

    def judge_later(self, check: Callable[[], str]) -> str:
        """Keep a check of this answer until nothing more of its process is shown to the student.

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
        """Call the function, and return its result and how much memory it held, as `Session.call` does.

        Parameters
        ----------
        *arguments
            What it is called with.
        """
        # What is compiled or loaded on a first call isn't counted. It has no order from which the next can be foreseen.
        order = cache(np.random.default_rng().permutation)  # axes of one length belong together
        arrays = (one[np.ix_(*map(order, one.shape))] if isinstance(one, np.ndarray) else one for one in arguments)
        self(*arrays)
        return self.session.call(self.__name__, arguments, {}, measured=True)


def _standard_error(reported: dict[str, Any]) -> Exception:
    """Return the error that an answer raised, of the same standard kind."""
    kind = getattr(builtins, reported["standard"], Exception)
    # A StopIteration would silently end a loop of the test.
    if not issubclass(kind, Exception) or kind is Exception or issubclass(kind, StopIteration | StopAsyncIteration):
        kind, reported = AnswerError, reported | {"says": f"{reported['kind']}: {reported['says']}".removeprefix(": ")}
    try:
        error = kind(reported["says"])
    except TypeError:
        error = AnswerError(f"{reported['kind']}: {reported['says']}".removeprefix(": "))
    if reported["line"]:
        error.add_note(f"in your line: {reported['line']}")
    return error
