"""A course for each that asks for one, and a test for each entry of an exercise's catalogue."""

import shutil

import pytest

from semgrid_edu.workshop.course.nbgrader.build import build_course

pytest.register_assert_rewrite("grader_checks")


@pytest.fixture(scope="session")
def new_course(tmp_path_factory):
    """Return a function that lays out a course of its own at each call; built once, then copied."""
    built = tmp_path_factory.mktemp("built")
    build_course(built)
    return lambda: shutil.copytree(built, tmp_path_factory.mktemp("course"), dirs_exist_ok=True)


def pytest_generate_tests(metafunc):
    """Run `test_entry` once for each entry of the class it belongs to."""
    if "entry" in metafunc.fixturenames:
        entries = metafunc.cls.entries
        metafunc.parametrize("entry", entries, ids=[f"{entry.task}: {entry.title}" for entry in entries])
