"""A student's notebook in a process of its own, for tests to misuse."""

import pytest

from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.process import StudentProcess
from semgrid_edu.workshop.course.sandbox.session import Session


@pytest.fixture
def prepared(tmp_path):
    folder = tmp_path / "prepared"
    folder.mkdir()
    return folder


@pytest.fixture
def session(prepared):
    """Return a notebook whose cells and calls may take five seconds."""
    limits = Limits(memory=1000, written=10)
    session = Session(lambda: StudentProcess(limits, prepared), timeout=5)
    yield session
    session.stop()


@pytest.fixture
def answer(session):
    """Return a function that runs a cell and returns the function `f` that it defines."""

    def run(code):
        assert "error" not in session.run(code)
        return session.names(["f"], session)["f"]

    return run
