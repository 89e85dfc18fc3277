"""A student's notebook in a separate process, for tests to misuse."""

import pytest

from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.process import StudentProcess
from semgrid_edu.workshop.course.sandbox.session import Session


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """The folder of what the reference has compiled: nothing."""
    return tmp_path_factory.mktemp("prepared")


@pytest.fixture
def session(prepared):
    """A notebook in its own process, whose cells and calls may take five seconds."""
    limits = Limits(memory=1000, written=10)
    session = Session(lambda: StudentProcess(limits, prepared), timeout=5)
    yield session
    session.stop()


@pytest.fixture(scope="module")
def harmless(prepared):
    """A notebook for all tests of a module that neither end its process nor change how it works."""
    session = Session(lambda: StudentProcess(Limits(memory=1000, written=10), prepared), timeout=60)
    session.left_in_all = 600
    yield session
    session.stop()


def defined(session, code):
    """Run a cell, and return the function `f` that it defines."""
    assert "error" not in session.run(code)
    session.begin()
    return session.names(["f"], session)["f"]


@pytest.fixture
def answer(harmless):
    """A function that runs a cell in the shared process and returns the function `f` that it defines."""
    return lambda code: defined(harmless, code)


@pytest.fixture
def hostile_answer(session):
    """The same in a process that no other test uses."""
    return lambda code: defined(session, code)
