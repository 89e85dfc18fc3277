"""Grading without nbgrader: the same sandbox and test cells, with students' processes forked from one that is ready.

One process (`warm_server`) loads the large libraries, and forks a server for each exercise, which runs its source once,
so that everything is imported and compiled. From then on that forks a new process for each student, with a fresh
namespace, and with its own folder and limits as in real grading.
"""

import os
import select
import shutil
import socket
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from nbformat.v4 import new_code_cell
from nbgrader.utils import determine_grade, is_grade, is_solution
from nbgrader_scores import CellScore, error_message, tasks
from numba.core.caching import UserProvidedCacheLocator
from submissions import submission

from semgrid_edu.fast.numba_cache import PACKAGE
from semgrid_edu.workshop.course.nbgrader.preprocessors import instructors_cells, use_instructor
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent
from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.notebook import TestCells, _prepare, cell_name, run_submission
from semgrid_edu.workshop.course.sandbox.process import PREPARED, StudentProcess, worker_environment
from semgrid_edu.workshop.course.sandbox.session import Session

SERVER = Path(__file__).with_name("warm_server.py")


def grade_warm(source, answers, start, timeout, tested=None, first=""):
    """Run one submission; return the result of each test cell, by its grade_id.

    `tested` names the tasks whose tests are run, where that isn't all; `first` is a cell before all others.
    """
    notebook = submission(source, answers)
    if tested is not None:
        left_out = {name for task, names in tasks(source).items() if task not in tested for name in names}
        notebook.cells = [cell for cell in notebook.cells if is_solution(cell) or cell_name(cell) not in left_out]
    if first:
        notebook.cells.insert(0, new_code_cell(first))
    return grade_notebook(source, notebook, start, timeout)


def grade_notebook(source, notebook, start, timeout):
    """Run a notebook that was handed in; `grade_warm` describes the result."""
    run_submission(restored(source, notebook), _trusted(source), start, timeout)
    cells = {cell_name(cell): cell for cell in notebook.cells if is_grade(cell)}
    return {name: _score(cell) for name, cell in cells.items()}


def restored(source, notebook):
    """Give a notebook its hidden tests, as nbgrader's OverwriteCells does."""
    for cell in filter(is_test, notebook.cells):
        cell.source = _trusted(source)[cell_name(cell)]
    return notebook


def is_test(cell):
    """Return whether a cell is a test of the exercise."""
    return is_grade(cell) and not is_solution(cell)


def grade_disguised(source, answers, honest, pointless, start, timeout):
    """Return the errors of each kind of disguise (`answers_in_disguise`) by test cell.

    Visible tests run with the honest kinds, hidden ones with all, one kind after the other in the same two processes.
    Before a cell's hidden tests, answers that spoil their arguments run, which must not affect those after them.
    """
    notebook, errors = restored(source, submission(source, answers)), {kind: {} for kind in (*honest, *pointless)}
    seen, unseen = Session(start, timeout), Session(start, timeout, secret=True)
    tests = TestCells(seen, unseen)
    try:
        _prepare(notebook, _trusted(source), tests)
        for cell in (cell for cell in notebook.cells if cell.cell_type == "code"):
            if not is_test(cell):
                seen.run(cell.source)
                unseen.run_later(cell.source)
                continue
            name = cell_name(cell)
            for kind in honest:
                seen.run(f"_kind = {kind!r}")
                errors[kind][name] = tests.test(cell.source, name)
            checks = tests.postponed[name]
            for kind in ("spoil", *errors):
                unseen.run_later(f"_kind = {kind!r}")
                tests.postponed[name] = checks
                found = tests.judge(name)
                if kind in errors:
                    errors[kind][name] = errors[kind].get(name, []) + found
    finally:
        seen.stop()
        unseen.stop()
    return errors


@cache
def _trusted(source):
    return instructors_cells(read_percent(source))


def _score(cell):
    score, points = determine_grade(cell)
    return CellScore(points, score, error_message(cell))


@contextmanager
def open_nursery():
    """Load the large libraries in a process that knows what is compiled; give a socket that takes exercises."""
    with tempfile.TemporaryDirectory() as folder:
        for file in PACKAGE.rglob("__pycache__/*.nb[ic]"):
            # Where a process looks that keeps in a folder of its own what numba compiles.
            subfolder = UserProvidedCacheLocator.get_suitable_cache_subpath(str(file.parents[1] / "module.py"))
            place = Path(folder, PREPARED, subfolder)
            place.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, place)
        ours, theirs = socket.socketpair()
        command = [sys.executable, SERVER, str(theirs.fileno())]
        environment = worker_environment(Path(folder)) | {"NUMBA_THREADING_LAYER": "workqueue"}
        with subprocess.Popen(command, cwd=folder, env=environment, pass_fds=[theirs.fileno()]), ours:
            theirs.close()
            yield ours


@contextmanager
def warm_processes(nursery, source):
    """Start a server for an exercise; give a function that returns a new process.

    `nursery` is what `open_nursery` gives.
    """
    use_instructor(NOTEBOOKS / "instructor")
    if not hasattr(os, "pidfd_open"):
        yield lambda: StudentProcess(Limits())
        return
    ours, theirs = socket.socketpair()
    with ours:
        socket.send_fds(nursery, [str(source).encode()], [theirs.fileno()])
        theirs.close()
        assert ours.recv(1), "the exercise has run"
        yield lambda: ForkedProcess(ours)


class ForkedProcess(StudentProcess):
    """A student's process that the server forks."""

    def __init__(self, server):
        self.server = server
        super().__init__(Limits())

    def _started(self, command):
        read, theirs_out = os.pipe()
        theirs_in, write = os.pipe()
        socket.send_fds(self.server, [str(self.folder).encode()], [theirs_in, theirs_out])
        os.close(theirs_in), os.close(theirs_out)
        pid = int.from_bytes(self.server.recv(8), "big")
        return Forked(pid, os.fdopen(write, "wb"), os.fdopen(read, "rb"))


class Forked:
    """What `StudentProcess` uses of `subprocess.Popen`, for a process that is the server's child."""

    def __init__(self, pid, stdin, stdout):
        self.pid, self.stdin, self.stdout = pid, stdin, stdout
        self.handle = os.pidfd_open(pid)

    def __del__(self):
        os.close(self.handle)

    def poll(self):
        return 0 if select.select([self.handle], [], [], 0)[0] else None

    def wait(self):
        select.select([self.handle], [], [])
