"""A course for each that asks for one, and a test for each entry of an exercise's catalogue."""

import os
import shutil
from copy import deepcopy
from functools import cache

import pytest
from class_of import NAME, SOURCE
from filelock import FileLock
from nbgrader_scores import alembic_asked_once  # noqa: F401 (a fixture for all tests here)
from typer.testing import CliRunner
from warm import open_nursery, warm_processes

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.samples import samples_dir
from semgrid_edu.workshop.commands.main import app
from semgrid_edu.workshop.course.nbgrader import build, preprocessors


@pytest.fixture(scope="session", autouse=True)
def exercises_read_once():
    """Let the hundreds of students here fill in copies of one student version, since no exercise changes meanwhile."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "student_version", cache(build.student_version))
        yield


@pytest.fixture(scope="session", autouse=True)
def shipped_frames_read_once():
    """Give test cells copies of the shipped drives' frames: for each student they would decode the same pictures."""
    read, frames = KittiRawDrive._frame, {}

    def copied(drive, k):
        if not drive.folder.is_relative_to(samples_dir()):
            return read(drive, k)
        key = drive.folder, *drive._sensors, k
        if key not in frames:
            frames[key] = read(drive, k)
        return deepcopy(frames[key])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(KittiRawDrive, "_frame", copied)
        yield


@pytest.fixture(scope="session")
def built(tmp_path_factory):
    """The folder of a course, and what the command says that builds it; all processes of a test run share one."""
    alone = "PYTEST_XDIST_WORKER" not in os.environ
    shared = tmp_path_factory.getbasetemp() if alone else tmp_path_factory.getbasetemp().parent
    folder, said = shared / "built", shared / "built.txt"
    with FileLock(shared / "built.lock"):
        if not said.exists():
            result = CliRunner().invoke(app, ["course", "build", str(folder)], catch_exceptions=False)
            assert result.exit_code == 0, result.output
            said.write_text(result.output, encoding="utf-8")
    return folder, said.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def new_course(built, tmp_path_factory):
    """Return a function that lays out a course of its own at each call; built once, then copied."""
    return lambda: shutil.copytree(built[0], tmp_path_factory.mktemp("course"), dirs_exist_ok=True)


@pytest.fixture(scope="module")
def course(new_course):
    """A course of the module's own."""
    return new_course()


@pytest.fixture(scope="session")
def nursery():
    """The process from which servers for exercises are forked."""
    with open_nursery() as found:
        yield found


@pytest.fixture(scope="module")
def start(nursery, course):
    """A function that forks a process for a student of exercise 01 from one that is ready."""
    with warm_processes(nursery, SOURCE, course / "prepared" / NAME) as start:
        yield start


@pytest.fixture
def forked(course, start, monkeypatch):
    """The course while its students' processes are forked: for what doesn't depend on how a process is started."""
    monkeypatch.setattr(preprocessors, "StudentProcess", lambda *_, **__: start())
    return course


def pytest_generate_tests(metafunc):
    """Run `test_entry` once for each entry of the class it belongs to."""
    if "entry" in metafunc.fixturenames:
        entries = metafunc.cls.entries
        metafunc.parametrize("entry", entries, ids=[f"{entry.task}: {entry.title}" for entry in entries])
