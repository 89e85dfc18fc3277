"""A test cell, run here, of answers that work elsewhere: what it may look up, and what belongs below it."""

import pytest

from semgrid_edu.workshop.course.nbgrader.preprocessors import use_instructor
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS
from semgrid_edu.workshop.course.sandbox.notebook import TestCells


@pytest.fixture
def tests(session):
    use_instructor(NOTEBOOKS / "instructor")
    return TestCells(session, session, ())


def test_answers_are_found_by_tests_and_by_what_they_are_prepared_with(session, tests):
    session.run("def f(x):\n    return x + 1\nlimit = 7")
    tests.prepare("def _hint():\n    return f(1)")
    assert tests.test("assert _hint() == f(1) == 2 and limit == 7", "one") == []


def test_an_answer_that_is_missing_is_a_name_that_is_missing(tests):
    (output,) = tests.test("f(1)", "one")
    assert (output.ename, output.evalue) == ("NameError", "name 'f' is not defined")


def test_a_test_leaves_nothing_for_the_next(session, tests):
    session.run("def f():\n    return 1")
    tests.test("got = f()", "one")
    (output,) = tests.test("got", "two")
    assert output.ename == "NameError"
    session.run("def f():\n    return 2")
    assert tests.test("assert f() == 2", "three") == []


def test_an_error_shows_its_line_and_a_hidden_one_does_not(tests):
    (output,) = tests.test("x = 1\nassert x == 2, 'two'", "one")
    assert output.traceback == ["in the test: assert x == 2, 'two'", "AssertionError: two"]
    (output,) = tests.test("complaint = 'wrong'\nassert not complaint, complaint", "two")
    assert output.traceback == ["AssertionError: wrong"]


def test_what_an_answer_printed_is_shown_and_what_a_test_prints_is_not(session, tests):
    session.run("def f():\n    print('mine')")
    (output,) = tests.test("print('secret')\nf()", "one")
    assert output.text == "mine\n"


def test_names_of_the_student_never_stand_for_those_of_the_instructor(session, tests):
    session.run("def len(x):\n    return 0\nlimit = 1")
    tests.prepare("limit = 7")
    assert tests.test("assert len('ab') == 2 and limit == 7", "one") == []
