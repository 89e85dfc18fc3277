"""What tests of courses share: a course with one tiny exercise, and right answers to it."""

import pytest
from nbgrader_scores import alembic_asked_once  # noqa: F401 (a fixture for all tests here)
from submissions import reference_answers, submission
from tiny_course import TINY, tiny_notebooks

from semgrid_edu.workshop.course.nbgrader.build import build_course


@pytest.fixture(scope="module")
def notebooks(tmp_path_factory):
    """The folder of the tiny course's sources."""
    return tiny_notebooks(tmp_path_factory.mktemp("notebooks"))


@pytest.fixture(scope="module")
def source(notebooks):
    """The source of its exercise."""
    return notebooks / "src" / "exercises" / f"{TINY}.py"


@pytest.fixture(scope="module")
def course(notebooks, tmp_path_factory):
    """The course, as an instructor builds it."""
    folder = tmp_path_factory.mktemp("courses") / "course"
    build_course(folder, notebooks)
    return folder


@pytest.fixture
def right(source):
    """A notebook that earns all points, in which a person has to read one answer."""
    return submission(source, reference_answers(source) | {"why": "Since 2 is 2."})
