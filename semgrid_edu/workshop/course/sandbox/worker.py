"""A student's process: it runs cells as a notebook's kernel does, and calls the functions that they define.

It is started as `python -m semgrid_edu.workshop.course.sandbox.worker` and talks to the grader over its standard
input and output. Whatever the student's code does here, only plain values leave the process (`values`).
"""

import linecache
import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from IPython.core.interactiveshell import InteractiveShell
from IPython.utils.capture import RichOutput, capture_output
from traitlets.config import Config

from semgrid_edu.workshop.course.sandbox.limits import Limits, limit_this_process
from semgrid_edu.workshop.course.sandbox.values import MAX_INPUT, NotPlainError, Wire, decode, encode, writable

MAX_TEXT = 20_000
"""How many characters of a text are kept."""

FORBIDDEN = "not allowed where answers are graded: pools of processes, the network, files outside the notebook's folder"
"""Added to the message of a PermissionError."""

MAX_OUTPUTS = 1000
"""How many of the things that a cell displays are kept."""

MAX_SHOWN = 5_000_000
"""How many characters of what a cell displays are kept, pictures included."""


class Shell(InteractiveShell):
    """Runs cells as a notebook's kernel does, without a screen."""

    def enable_gui(self, gui: str | None = None) -> None:
        """Ignore a magic that asks for a screen.

        Parameters
        ----------
        gui : str, optional
            The screen.
        """

    def ask_exit(self) -> None:
        """End the cell or call that runs `exit()`."""
        raise SystemExit

    # Without the terminal that IPython would give a line that begins with "!".
    system = InteractiveShell.system_raw


class Worker:
    """One student's notebook, cell by cell and call by call.

    Parameters
    ----------
    wire : Wire
        To the grader.
    """

    def __init__(self, wire: Wire) -> None:
        quiet = Config(HistoryManager={"enabled": False}, InteractiveShell={"colors": "NoColor"})
        self.wire = wire
        self.shell = Shell.instance(config=quiet)
        self.traceback: list[str] = []
        self.shell._showtraceback = lambda kind, value, lines: self.traceback.extend(lines)

    def serve(self) -> None:
        """Answer the grader until it hangs up."""
        while (data := self.wire.receive()) is not None:
            message = decode(data, self._callback)
            if message["do"] == "call":
                message["sent"] = data
            try:
                # Functions among changed arguments go back by their numbers.
                reply = encode(getattr(self, message.pop("do"))(**message), [], MAX_INPUT)
            except NotPlainError as error:
                reply = encode({"error": _report(error)})
            self.wire.send(reply)

    def limit(self, limits: dict, folder: str) -> dict:
        """Set limits; report which of them are set.

        Parameters
        ----------
        limits : dict
            The fields of `Limits`.
        folder : str
            The only folder to which the student's code may write.
        """
        return {"done": limit_this_process(Limits(**limits), Path(folder))}

    def run(self, code: str) -> dict:
        """Run a cell; report its outputs and the error that ended it.

        Parameters
        ----------
        code : str
            The cell.
        """
        self.traceback.clear()
        with capture_output() as captured:
            result = self.shell.run_cell(code)
        error = result.error_before_exec or result.error_in_exec
        found = {"streams": _streams(captured), "shown": _shown(captured.outputs)}
        if error is not None:
            found["error"] = _report(error) | {"traceback": [_text(line) for line in self.traceback]}
        return found

    def beside(self, files: dict) -> dict:
        """Write the files that were handed in beside the notebook.

        Parameters
        ----------
        files : dict
            Their bytes, arrays of shape (n,), by their paths.
        """
        for name, content in files.items():
            Path(name).parent.mkdir(parents=True, exist_ok=True)
            Path(name).write_bytes(content.tobytes())
        return {}

    def names(self, wanted: list[str]) -> dict:
        """Report which of some names are functions, and the values of the others.

        Parameters
        ----------
        wanted : list of str
            The names.
        """
        known = {name: self.shell.user_ns[name] for name in wanted if name in self.shell.user_ns}
        functions = [name for name, value in known.items() if callable(value)]
        return {"functions": functions, "values": {n: v for n, v in known.items() if n not in functions and _passes(v)}}

    def call(self, name: str, arguments: tuple, named: dict, sent: bytes) -> dict:
        """Call a function; report its result or error, what it printed, and what it changed in its arguments.

        Parameters
        ----------
        name : str
            The function.
        arguments, named : tuple, dict
            What it is called with.
        sent : bytes
            The message in which the arguments came.
        """
        reply: dict[str, Any] = {}
        with capture_output(display=False) as captured:
            try:
                reply["result"] = self.shell.user_ns[name](*arguments, **named)
                encode(reply["result"])
            except BaseException as error:
                reply = {"error": _report(error)}
        before = decode(sent, self._callback)
        given = (before["arguments"], before["named"])
        now = _what_passes((arguments, named))
        if encode(given, [], MAX_INPUT) != encode(now, [], MAX_INPUT):
            reply["changed"] = now
        return reply | {"streams": _streams(captured)}

    def _callback(self, number: int) -> Callable:
        """Return a function that the grader computes."""

        def call(*arguments: Any, **named: Any) -> Any:
            self.wire.send(encode({"callback": number, "arguments": arguments, "named": named}))
            reply = decode(self.wire.receive() or b"")
            if "error" in reply:
                raise ValueError(reply["error"])
            return reply["result"]

        return call


def _passes(value: Any, *options: Any) -> bool:
    """Return whether a value can be sent, with options of `encode`."""
    try:
        encode(value, *options)
    except NotPlainError:
        return False
    return True


def _what_passes(value: Any) -> Any:
    """Return a value with NaN for each part that can't be sent: NaN equals nothing, so a test sees the change."""
    if _passes(value, [], MAX_INPUT):
        return value
    if isinstance(value, dict):
        return dict(_what_passes(pair) for pair in value.items())
    if isinstance(value, list | tuple):
        return (list if isinstance(value, list) else tuple)(map(_what_passes, value))
    return float("nan")


def _streams(captured: Any) -> dict[str, str]:
    """Return what was printed."""
    return {"stdout": _text(captured.stdout), "stderr": _text(captured.stderr)}


def _text(text: str) -> str:
    """Return the beginning of a text, with question marks for characters that can't be encoded."""
    return writable(text[:MAX_TEXT])


def _shown(outputs: list[RichOutput]) -> list[dict[str, str]]:
    """Return the displayed texts and pictures, until there are too many."""
    kept = []
    size = 0
    for output in outputs[:MAX_OUTPUTS]:
        data = {kind: data for kind, data in output.data.items() if isinstance(data, str)}
        size += sum(map(len, data.values()))
        if size > MAX_SHOWN:
            break
        kept.append(data)
    return kept


def _report(error: BaseException) -> dict[str, Any]:
    """Describe an error in plain values: its class, the standard class that it derives from, message and line."""
    kinds = [kind.__name__ for kind in type(error).__mro__ if kind.__module__ == "builtins"]
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename.startswith("<ipython")]
    line = linecache.getline(frames[-1].filename, frames[-1].lineno).strip() if frames else ""
    message = f"{error}: {FORBIDDEN}" if isinstance(error, PermissionError) else str(error)
    report = {"kind": type(error).__name__, "standard": kinds[0], "message": _text(message), "line": _text(line)[:200]}
    return report | {"number": frames[-1].lineno if frames else 0}


def _main() -> None:
    """Talk to the grader over standard input and output, to which the student's code has no access."""
    wire = Wire(os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb"))
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    # Files that were handed in may be imported, but never replace a library.
    sys.path[:] = [*sys.path[1:], ""]
    Worker(wire).serve()


if __name__ == "__main__":
    _main()
