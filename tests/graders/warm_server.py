"""Load the large libraries once; fork a server for each exercise, which runs it once and forks a process a student.

python warm_server.py SOCKET
"""

import gc
import os
import signal
import socket
import sys
import tempfile
from importlib import import_module
from pathlib import Path

from nbformat.v4 import new_code_cell

from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent
from semgrid_edu.workshop.course.sandbox.values import Wire
from semgrid_edu.workshop.course.sandbox.worker import Shell, Worker

LIBRARIES = ("matplotlib.pyplot", "mpmath", "scipy.stats", "sympy", "filterpy.discrete_bayes")
LIBRARIES += ("semgrid_edu.crf", "semgrid_edu.networks", "semgrid_edu.pipeline")


def hatch(nursery):
    """Fork a server for each exercise and socket that come in."""
    for name in LIBRARIES:
        import_module(name)
    new_code_cell()  # compiles the schema of notebooks
    gc.freeze()  # or the first full collection of each process would touch, and so copy, all that is loaded
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        source, sockets, _, _ = socket.recv_fds(nursery, 4096, 1)
        if not source:
            return
        if os.fork() == 0:
            nursery.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            run(Path(source.decode()))
            return serve(socket.socket(fileno=sockets[0]))
        os.close(sockets[0])


def run(source):
    """Run the exercise with its solutions and tests; forget the instructor's module, which no student can import."""
    before = set(sys.modules)
    sys.path.insert(0, str(NOTEBOOKS / "instructor"))
    worker = Worker(None)
    for cell in read_percent(source).cells:
        if cell.cell_type == "code" and "error" in (reply := worker.run(cell.source)):
            raise SystemExit("\n".join(reply["error"]["traceback"]))
    sys.path.pop(0)
    for name in {name for name in sys.modules if name.startswith("semgrid_instructor")} - before:
        del sys.modules[name]


def serve(server):
    """Fork a process whenever one is asked for, and reply with its number."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    gc.freeze()  # what the exercise loaded, too
    server.send(b"!")
    while True:
        folder, pipes, _, _ = socket.recv_fds(server, 4096, 2)
        if not folder:
            return
        if (pid := os.fork()) == 0:
            server.close()
            be_student(folder.decode(), pipes)
        server.send(pid.to_bytes(8, "big"))
        for pipe in pipes:
            os.close(pipe)


def be_student(folder, pipes):
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
    hatch(socket.socket(fileno=int(sys.argv[1])))
