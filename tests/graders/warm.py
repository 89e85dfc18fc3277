"""Grading without nbgrader: the same sandbox and test cells, with students' processes forked from one that is ready.

A server runs an exercise's source once, so that everything is imported and compiled. From then on it forks a new
process for each student, with a fresh namespace, and with a folder and limits of its own as in real grading.
"""

import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

from nbgrader.utils import determine_grade, is_grade, is_solution
from nbgrader_scores import CellScore, error_message

from semgrid_edu.workshop.course.nbgrader.autograde import submission
from semgrid_edu.workshop.course.nbgrader.preprocessors import instructors_cells, use_instructor
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent
from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.notebook import cell_name, run_submission
from semgrid_edu.workshop.course.sandbox.process import StudentProcess, worker_environment
from semgrid_edu.workshop.course.sandbox.values import Wire
from semgrid_edu.workshop.course.sandbox.worker import Shell, Worker


def grade_warm(source, answers, start, timeout):
    """Run one submission; return the result of each test cell, by its grade_id."""
    trusted = instructors_cells(read_percent(source))
    notebook = submission(source, answers)
    for cell in notebook.cells:
        if is_grade(cell) and not is_solution(cell):
            cell.source = trusted[cell_name(cell)]  # with its hidden tests, as nbgrader's OverwriteCells does
    run_submission(notebook, trusted, start, timeout)
    cells = {cell_name(cell): cell for cell in notebook.cells if is_grade(cell)}
    return {name: _score(cell) for name, cell in cells.items()}


def _score(cell):
    score, points = determine_grade(cell)
    return CellScore(points, score, error_message(cell))


@contextmanager
def warm_processes(source, prepared):
    """Start a server for an exercise, with what `prepare` had compiled; give a function that returns a new process."""
    use_instructor(NOTEBOOKS / "instructor")
    if not hasattr(os, "pidfd_open"):
        yield lambda: StudentProcess(Limits(), prepared)
        return
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(prepared, Path(folder, "prepared"))
        ours, theirs = socket.socketpair()
        command = [sys.executable, __file__, str(source), str(theirs.fileno())]
        environment = worker_environment(Path(folder)) | {"NUMBA_THREADING_LAYER": "workqueue"}
        with subprocess.Popen(command, cwd=folder, env=environment, pass_fds=[theirs.fileno()]), ours:
            theirs.close()
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


def _serve(source, server):
    """Run the exercise; then fork a worker for each folder and pair of pipes that come in."""
    use_instructor(NOTEBOOKS / "instructor")
    worker = Worker(None)
    for cell in read_percent(source).cells:
        if cell.cell_type == "code" and "error" in (reply := worker.run(cell.source)):
            raise SystemExit("\n".join(reply["error"]["traceback"]))
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        folder, pipes, _, _ = socket.recv_fds(server, 4096, 2)
        if not folder:
            return
        if (pid := os.fork()) == 0:
            _be_student(folder.decode(), pipes)
        server.send(pid.to_bytes(8, "big"))
        for pipe in pipes:
            os.close(pipe)


def _be_student(folder, pipes):
    """Serve the grader in a fresh namespace until it hangs up."""
    os.setsid()
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.chdir(folder)
    os.environ.update(dict.fromkeys(("HOME", "TMPDIR", "IPYTHONDIR"), folder))
    tempfile.tempdir = None
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    Shell.clear_instance()
    Worker(Wire(os.fdopen(pipes[0], "rb"), os.fdopen(pipes[1], "wb"))).serve()
    os._exit(0)


if __name__ == "__main__":
    _serve(Path(sys.argv[1]), socket.socket(fileno=int(sys.argv[2])))
