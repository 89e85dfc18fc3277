"""Runs whose work several processes share, started by torchrun."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tiny_notes import Note, SharedNote, wait_for

from semgrid_edu.errors import ArgumentError
from semgrid_edu.workshop.paper.reports.reproduce import Request, reproduce
from semgrid_edu.workshop.scheduler.execute import run_one
from semgrid_edu.workshop.scheduler.runs import OUTPUT

SCRIPT = """
import sys
from tiny_notes import SharedNote
from semgrid_edu.workshop.scheduler.execute import run_one
run_one(SharedNote("long", seconds_each=600.0), sys.argv[1], processes=2)
"""


@pytest.fixture(autouse=True)
def _found_by_processes(monkeypatch):
    """What this process finds, its processes find too."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).parents[1]), *sys.path]))


def test_an_error_in_a_process_is_that_of_the_run(tmp_path):
    run = SharedNote("weak", fails_without="help")
    assert "status 1" in run_one(run, tmp_path, processes=2)
    assert "RuntimeError: no help" in (run.folder(tmp_path) / OUTPUT).read_text()
    assert not run.has_ended(tmp_path)


def test_processes_end_with_the_one_that_started_them(tmp_path):
    script, root = tmp_path / "script.py", tmp_path / "runs"
    script.write_text(SCRIPT)
    process = subprocess.Popen([sys.executable, str(script), str(root)])
    lines = [SharedNote("long").folder(root) / f"lines-{rank}" for rank in range(2)]
    wait_for(lambda: all(path.exists() and path.stat().st_size for path in lines))
    process.send_signal(signal.SIGKILL)
    process.wait()
    wait_for(lambda: all(stays(path) for path in lines))
    assert [path.read_text().splitlines()[0] for path in lines] == [f"{rank} of 2, 1 thread" for rank in range(2)]


def test_other_runs_take_one_process(tmp_path):
    run = Note("a")
    assert run_one(run, tmp_path, processes=2) is None
    assert "processes" not in run.record(tmp_path)


def test_a_plan_that_torchrun_starts_twice_is_refused(monkeypatch, tmp_path):
    monkeypatch.setenv("WORLD_SIZE", "2")
    request = Request(experiment="table1", scale="quick", runs=tmp_path / "runs", out=tmp_path / "out")
    with pytest.raises(ArgumentError, match="--processes: expected 2"):
        reproduce(request, print)
    assert not (tmp_path / "runs").exists()


def stays(path, seconds=1.0):
    """Whether nothing is written to a file for a second, in which its processes would write twenty lines."""
    before = path.stat().st_size
    time.sleep(seconds)
    return path.stat().st_size == before
