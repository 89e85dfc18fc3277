"""The instructor's decorator: whatever a student's function does, one sentence comes back."""

import ast
import sys

import numpy as np
import pytest

from semgrid_edu.workshop.course.checks import instructor_problems
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS
from semgrid_edu.workshop.course.sandbox.session import AnswerTimeoutError


@pytest.fixture
def instructor(monkeypatch):
    monkeypatch.syspath_prepend(str(NOTEBOOKS / "instructor"))
    import semgrid_instructor

    yield semgrid_instructor
    del sys.modules["semgrid_instructor"]


@pytest.fixture
def hidden(instructor):
    return instructor.hidden


def answer():
    """Stand for a student's function."""


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (AssertionError("values are wrong"), "values are wrong"),
        (IndexError("7"), "it raises an error"),
        (AnswerTimeoutError("no reply"), "it does not come to an end"),
    ],
)
def test_error_becomes_a_sentence(hidden, error, sentence):
    @hidden
    def check(function):
        raise error

    assert check(answer) == f"answer, on inputs you haven't seen: {sentence}"


def test_an_instructor_who_interrupts_is_no_complaint_about_the_answer(hidden):
    @hidden
    def check(function):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check(answer)


def test_nothing_to_complain_about(hidden):
    assert hidden(lambda function: None)(answer) == ""


def test_every_answer_works_where_it_is_not_seen(hidden):
    class Answer:
        __name__ = "answer"
        unseen = "not seen"

    asked = []
    assert hidden(lambda *answers: asked.extend(answers))(Answer(), Answer()) == ""
    assert asked == ["not seen", "not seen"]


@pytest.mark.parametrize(
    ("got", "wanted", "same"),
    [
        ([0.1, 0.2], [0.1, 0.2 + 1e-8], True),
        (np.float32([0.1, 200.3]), [0.1, 200.3], True),
        ([0.1, 0.2], [0.1, 0.21], False),
        ([1.0, 1.0], 1, True),
        (0.5, np.float64(0.5), True),
        ([0.5], np.float64(0.5), False),
        ([], [], False),
        ([], 1, False),
        (np.empty((0, 1, 1)), np.zeros((3, 4)), False),
        ([[1.0, 1.0]], [1.0, 1.0], False),
        ([np.nan], [np.nan], False),
    ],
)
def test_only_what_has_the_same_shape_and_is_not_empty_is_close(instructor, got, wanted, same):
    assert instructor.close(np.array(got), wanted) == same


@pytest.mark.parametrize(
    ("change", "argument"),
    [(np.ndarray.sort, np.array([2, 1])), (list.clear, [1]), (lambda cell: cell[0].fill(0), (np.ones(2), "text"))],
)
def test_an_argument_that_changes_costs_the_points_where_it_must_not(instructor, change, argument):
    check = instructor.keeping(lambda function: function(argument))
    with pytest.raises(AssertionError, match="it changes an argument"):
        check(change)
    check(len)


def _calls(function):
    return {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}


def test_hidden_inputs_are_drawn_for_each_student_or_the_guide_says_so():
    guide = (NOTEBOOKS / "instructor" / "README.md").read_text(encoding="utf-8")
    for path in (NOTEBOOKS / "instructor" / "semgrid_instructor").glob("*.py"):
        module = ast.parse(path.read_text(encoding="utf-8"))
        calls = {one.name: _calls(one) for one in module.body if isinstance(one, ast.FunctionDef)}
        for _ in calls:  # what a helper calls, its caller calls as well
            calls = {name: found.union(*(calls[one] for one in found & calls.keys())) for name, found in calls.items()}
        same = [name for name, found in calls.items() if name.startswith("check_") and "generator" not in found]
        assert [name for name in same if f"`{name.removeprefix('check_')}`" not in guide] == [], path.name


def test_hidden_tests_compare_by_the_helper_alone(tmp_path):
    assert instructor_problems(NOTEBOOKS / "instructor" / "semgrid_instructor") == []
    for line in (
        "np.allclose(got, 1)",
        "np.isclose(a, b)",
        "np.testing.assert_allclose(a, b)",
        "assert_almost_equal(a, b)",
        'assert right, f"{got.size} numbers"',
        'assert right, f"wrong with {x}"',
    ):
        (tmp_path / "grids.py").write_text(f"x = 1\n    {line}\n")
        (problem,) = instructor_problems(tmp_path)
        assert problem.startswith(f"instructor/grids.py: `{line}`")
