"""The instructor's decorator: whatever a student's function does, one sentence comes back."""

import sys

import pytest

from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS
from semgrid_edu.workshop.course.sandbox.session import AnswerTimeoutError


@pytest.fixture
def hidden(monkeypatch):
    monkeypatch.syspath_prepend(str(NOTEBOOKS / "instructor"))
    import semgrid_instructor

    yield semgrid_instructor.hidden
    del sys.modules["semgrid_instructor"]


def answer():
    """Stand for a student's function."""


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (AssertionError("values are wrong"), "values are wrong"),
        (IndexError("7"), "it raises IndexError: 7"),
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
