"""The grader's side of one student's process: starts it, asks it, and ends it if it takes too long or uses too much."""

import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.storage.files import atomic_path, table_beside
from semgrid_edu.workshop.course.sandbox.limits import PARTS, Limits
from semgrid_edu.workshop.course.sandbox.resources import (
    MEGABYTE,
    PeakMemory,
    busy_threads,
    delete_folder,
    deleted_bytes,
    exceeds_disk_limits,
    has_ended,
    memory_held,
    namespace_of,
    processes_in,
    threads_of,
)
from semgrid_edu.workshop.course.sandbox.values import MAX_BYTES, MAX_INPUT, Wire, check_reply, decode, encode

INHERITED = ("PATH", "PYTHONPATH", "LANG", "LC_ALL", "SYSTEMROOT")
"""The environment variables that a student's process inherits."""

PREPARED = ".prepared"
"""The folder of compiled functions, in the folder of a process; no file that is handed in gets there."""

ONLY_WHOLE = shutil.ignore_patterns(".*")
"""For copies of compiled functions: a file that another process is still writing has such a name."""

WORKER = (sys.executable, "-m", "semgrid_edu.workshop.course.sandbox.worker")
"""The command that starts a worker."""

UNSHARE: tuple[str, ...] = table_beside(__file__)["unshare"]
"""Starts a program without network that sees no other processes, and ends with this one (util-linux)."""

WATCH_INTERVAL = 0.5
"""Seconds between two checks of what a process uses."""

START_TIMEOUT = 60.0
"""How many seconds a process may take to start."""

END_TIMEOUT = 5.0
"""How many seconds the system may take to end a process."""

MAX_BUSY = 10
"""How many threads may work at the same time: more would take the processors from other students."""

MAX_REPLY = 2 * MAX_BYTES
"""Limit for a message without changed arguments, bytes: results, and arguments of callbacks, are shorter."""

MAX_ERROR_TEXT = 1000
"""How many characters of an error are sent back to a student's process: it may quote that process's arguments."""


def worker_environment(folder: Path) -> dict[str, str]:
    """Return the environment of a worker: one thread per library, and all caches in its folder.

    Parameters
    ----------
    folder : Path
        The fresh folder of the process.
    """
    here = {name: str(folder / PREPARED) for name in ("NUMBA_CACHE_DIR", "MPLCONFIGDIR")}
    here |= {name: str(folder) for name in ("HOME", "TMPDIR", "IPYTHONDIR")}
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    # Freed memory is returned at once; otherwise a measurement wouldn't see that it is allocated again.
    freed = dict.fromkeys(("MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"), "1000000")
    inline = {"MPLBACKEND": "module://matplotlib_inline.backend_inline", "PYTHONDONTWRITEBYTECODE": "1"}
    return {name: os.environ[name] for name in INHERITED if name in os.environ} | here | threads | freed | inline


def keep_compiled(source: Path, target: Path) -> None:
    """Copy compiled functions to where others find them, so that a reader never gets half a file.

    Parameters
    ----------
    source, target : Path
        The two folders.
    """

    def replace_file(source: str, target: str) -> None:
        with atomic_path(target) as path:
            shutil.copyfile(source, path)

    shutil.copytree(source, target, ignore=ONLY_WHOLE, copy_function=replace_file, dirs_exist_ok=True)


def files_beside(folder: Path) -> dict[str, NDArray]:
    """Return the files beside a notebook, their bytes by their paths, until a message is full.

    Parameters
    ----------
    folder : Path
        The notebook's folder.
    """
    found = {}
    room = MAX_BYTES
    for path in sorted(one for one in folder.rglob("*") if one.is_file() and not one.is_symlink()):
        if path.suffix != ".ipynb" and PREPARED not in path.relative_to(folder).parts and path.stat().st_size <= room:
            found[path.relative_to(folder).as_posix()] = np.fromfile(path, np.uint8)
            room -= path.stat().st_size
    return found


class ProcessEndedError(Exception):
    """A student's process has ended by itself, or was ended because it took too long."""


class StudentProcess:
    """A separate process for one student's code, in a fresh folder, in its own namespaces where the system allows it.

    Parameters
    ----------
    limits : Limits
        How much it may use; its number of processes is added to those that the user has now.
    prepared : Path, optional
        A folder that is copied into the fresh one, with compiled functions and fonts.
    keeps : bool
        Whether what is compiled in the fresh folder is copied back at the end; for trusted code only.
    beside : Path, optional
        A folder with a notebook and the files that were handed in with it, which are copied beside the student's code.

    Raises
    ------
    ChildProcessError
        When the process ends, or doesn't answer, before it has run any of the student's code.

    Attributes
    ----------
    unlimited : list of str
        Which of `PARTS` could not be limited.
    """

    def __init__(
        self,
        limits: Limits,
        prepared: Path | None = None,
        keeps: bool = False,
        beside: Path | None = None,
    ) -> None:
        self.prepared = prepared
        self.keeps = keeps
        self.namespace = ""
        self.folder = Path(tempfile.mkdtemp(prefix="semgrid-answers-"))
        if prepared is not None:
            shutil.copytree(prepared, self.folder / PREPARED, ignore=ONLY_WHOLE)
        unshare = UNSHARE if _can_unshare() else ()
        self.process = self._started([*unshare, *WORKER])
        self.wire = Wire(self.process.stdout, self.process.stdin)
        self.sent: queue.Queue[bytes | None] = queue.Queue()
        self.received: queue.Queue[bytes | None] = queue.Queue()
        self.speaker = threading.Thread(target=self._speak, daemon=True)
        self.speaker.start()
        self.unlimited = self._limit(limits, bool(unshare))
        if beside is not None:
            self.ask({"do": "beside", "files": files_beside(beside)}, time.monotonic() + START_TIMEOUT)
        self.namespace = namespace_of(self.process.pid)
        threading.Thread(target=self._watch, args=(limits,), daemon=True).start()

    def _started(self, command: Sequence[str]) -> subprocess.Popen:
        """Start the worker in a new session, with a pipe in each direction."""
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=self.folder,
            env=worker_environment(self.folder),
            start_new_session=True,
        )

    def _limit(self, limits: Limits, unshared: bool) -> list[str]:
        """Let the process limit itself; return what it couldn't limit."""
        ours = threads_of(Path("/proc").glob("[0-9]*"), os.getuid()) if hasattr(os, "getuid") else 0
        limits = replace(limits, processes=limits.processes + ours)
        message = {"do": "limit", "limits": asdict(limits), "folder": str(self.folder)}
        try:
            done = self.ask(message, time.monotonic() + START_TIMEOUT)["done"]
        except (ProcessEndedError, TimeoutError):
            raise ChildProcessError(f"this command starts no Python that answers: {' '.join(WORKER)}") from None
        except KeyboardInterrupt:
            self.stop()
            raise
        done += ["network", "processes", "signals"] if unshared else []
        return [part for part in PARTS if part not in done]

    def _speak(self) -> None:
        """Send and receive in a thread, so that neither a full pipe nor a silent process blocks the grader."""
        while (data := self.sent.get()) is not None:
            try:
                self.wire.send(data)
                self.received.put(self.wire.receive())
            except (OSError, ValueError, MemoryError):
                self.received.put(None)  # the process has ended

    def _watch(self, limits: Limits) -> None:
        """End the process if it and everything that it has started use too much together."""
        memory = memory_held(processes_in(self.namespace)) + limits.memory * MEGABYTE
        while self.process.poll() is None:
            try:
                too_much = self._uses_too_much(limits, memory)
            except Exception:
                too_much = True  # a process that can't be watched must not go on
            if too_much:
                self._kill()
            time.sleep(WATCH_INTERVAL)

    def _uses_too_much(self, limits: Limits, memory: int) -> bool:
        """Return whether there are too many processes, busy threads or files, or they are too large together."""
        running = processes_in(self.namespace)
        if threads_of(running) > limits.processes or busy_threads(running) > MAX_BUSY or memory_held(running) > memory:
            return True
        each = limits.written * MEGABYTE
        return exceeds_disk_limits(self.folder, 3 * each - deleted_bytes(running, each))

    def _kill(self) -> None:
        """End the process, and all processes in its session and in its namespace."""
        with suppress(OSError):
            os.killpg(self.process.pid, signal.SIGKILL) if hasattr(os, "killpg") else self.process.kill()
        for place in processes_in(self.namespace):
            with suppress(OSError):
                os.kill(int(place.name), signal.SIGKILL)

    def ask(self, message: dict, deadline: float, callbacks: list[Callable] | None = None) -> dict[str, Any]:
        """Send a message and return the reply.

        Parameters
        ----------
        message : dict
            What `Worker` takes.
        deadline : float
            When the reply must be here, `time.monotonic()` seconds.
        callbacks : list of callable, optional
            Collects the functions in the message; the process may call them before it replies.

        Raises
        ------
        TimeoutError
            When there is no reply in time. The process has then been ended.
        ProcessEndedError
            When the process has ended, or sends something that isn't a message.
        """
        callbacks = [] if callbacks is None else callbacks
        data = encode(message, callbacks, MAX_INPUT)
        while True:
            reply = self._exchange(data, deadline, callbacks)
            if "callback" not in reply:
                return reply
            data = _called(callbacks, reply)

    def _exchange(self, data: bytes, deadline: float, callbacks: list[Callable]) -> dict[str, Any]:
        """Send bytes, and return what comes back."""
        self.sent.put(data)
        try:
            received = self.received.get(timeout=max(deadline - time.monotonic(), 0))
        except queue.Empty:
            self.stop()
            raise TimeoutError from None
        try:
            reply = dict(decode(received or b"", callbacks.__getitem__))
            check_reply(reply)
            if "changed" not in reply and len(received) > MAX_REPLY:
                raise ValueError(f"{len(received)} bytes")
            return reply
        except (ArgumentError, TypeError, ValueError):
            self.stop()
            raise ProcessEndedError from None

    def peak_memory(self) -> PeakMemory:
        """Return a block that measures the growth of the worker's memory."""
        outer = self.process.pid
        if not self.namespace:
            return PeakMemory(outer, self.folder)
        try:
            # `unshare` has the worker as its only child.
            return PeakMemory(int(Path(f"/proc/{outer}/task/{outer}/children").read_text()), self.folder)
        except (OSError, ValueError):
            return PeakMemory(0, self.folder)  # it has ended, as the next call will tell

    def stop(self) -> None:
        """End the process with everything that it has started, and delete its folder."""
        self.sent.put(None)
        self._kill()
        self.process.wait()
        self._wait_for_descendants()
        self.speaker.join(timeout=1)
        if not self.speaker.is_alive():
            for pipe in (self.process.stdin, self.process.stdout):
                with suppress(OSError):
                    pipe.close()
        if self.keeps:
            keep_compiled(self.folder / PREPARED, self.prepared)
        delete_folder(self.folder)

    def _wait_for_descendants(self) -> None:
        """Wait, at most some seconds, until the system has ended everything that the process has started."""
        until = time.monotonic() + END_TIMEOUT
        while not all(map(has_ended, processes_in(self.namespace))) and time.monotonic() < until:
            time.sleep(0.01)


def _called(callbacks: list[Callable], reply: dict) -> bytes:
    """Call a function for the student's process; return the reply as bytes, an error if the result can't be sent."""
    try:
        return encode({"result": callbacks[reply["callback"]](*reply["arguments"], **reply["named"])})
    except Exception as error:
        return encode({"error": f"{type(error).__name__}: {error}"[:MAX_ERROR_TEXT]})


@cache
def _can_unshare() -> bool:
    """Return whether this system lets a program have its own namespaces."""
    return bool(shutil.which(UNSHARE[0])) and not subprocess.run([*UNSHARE, "true"], capture_output=True).returncode
