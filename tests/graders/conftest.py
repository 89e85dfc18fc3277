"""Courses of one exercise, processes that are forked, and a test for each entry of an exercise's catalogue."""

import shutil
from copy import deepcopy
from functools import cache

import pytest
from class_of import NAME, SOURCE
from entries import source_of
from nbgrader_scores import alembic_asked_once  # noqa: F401 (a fixture for all tests here)
from warm import open_nursery, warm_processes

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.samples import samples_dir
from semgrid_edu.workshop.course.nbgrader import build, preprocessors
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS


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
def new_course(tmp_path_factory):
    """Return a function that builds a course with one exercise."""

    def build_one(name):
        notebooks = tmp_path_factory.mktemp("notebooks")
        exercises = notebooks / "src" / "exercises"
        exercises.mkdir(parents=True)
        shutil.copy(source_of(name), exercises)
        (notebooks / "instructor").symlink_to(NOTEBOOKS / "instructor")
        course = tmp_path_factory.mktemp("course")
        build.build_course(course, notebooks)
        return course

    return build_one


@pytest.fixture(scope="module")
def course(new_course):
    """A course with exercise 01."""
    return new_course(NAME)


@pytest.fixture(scope="session")
def nursery():
    """The process from which servers for exercises are forked."""
    with open_nursery() as found:
        yield found


@pytest.fixture(scope="module")
def start(nursery):
    """A function that forks a process for a student of exercise 01 from one that is ready."""
    with warm_processes(nursery, SOURCE) as start:
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
