"""A test cell, run here, of answers that work elsewhere: what it may look up, and what belongs below it."""

import pytest
from nbformat.v4 import new_code_cell, new_notebook

from semgrid_edu.workshop.course.nbgrader.preprocessors import use_instructor
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS
from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.notebook import TestCells, run_submission
from semgrid_edu.workshop.course.sandbox.process import StudentProcess
from semgrid_edu.workshop.course.sandbox.session import NoProcessError


@pytest.fixture
def tests(harmless):
    use_instructor(NOTEBOOKS / "instructor")
    return TestCells(harmless, harmless)


def test_answers_are_found_by_tests_and_by_what_they_are_prepared_with(harmless, tests):
    harmless.run("def f(x):\n    return x + 1\nlimit = 7")
    tests.prepare("def _hint():\n    return f(1)")
    assert tests.test("assert _hint() == f(1) == 2 and limit == 7", "one") == []


def test_an_answer_that_is_missing_is_a_name_that_is_missing(tests):
    (output,) = tests.test("no_answer(1)", "one")
    assert (output.ename, output.evalue) == ("NameError", "name 'no_answer' is not defined")


def test_a_test_leaves_nothing_for_the_next(harmless, tests):
    harmless.run("def f():\n    return 1")
    tests.test("got = f()", "one")
    (output,) = tests.test("got", "two")
    assert output.ename == "NameError"
    harmless.run("def f():\n    return 2")
    assert tests.test("assert f() == 2", "three") == []


def test_an_error_shows_its_line_and_a_hidden_one_does_not(tests):
    (output,) = tests.test("x = 1\nassert x == 2, 'two'", "one")
    assert output.traceback == ["in the test: assert x == 2, 'two'", "AssertionError: two"]
    (output,) = tests.test("complaint = 'wrong'\nassert not complaint, complaint", "two")
    assert output.traceback == ["AssertionError: wrong"]


def test_what_an_answer_printed_is_shown_and_what_a_test_prints_is_not(harmless, tests):
    harmless.run("def f():\n    print('mine')")
    (output,) = tests.test("print('secret')\nf()", "one")
    assert output.text == "your code printed:\nmine\n"


def test_names_of_the_student_never_replace_those_of_the_instructor(harmless, tests):
    harmless.run("def len(x):\n    return 0\nlimit = 1")
    tests.prepare("limit = 7")
    assert tests.test("assert len('ab') == 2 and limit == 7", "one") == []


WAITS = """
import semgrid_instructor
heard = []
@semgrid_instructor.hidden
def check(answer):
    heard.append(answer(98765))
    assert heard[-1] != 98765, "wrong"
"""


def test_a_hidden_part_waits_until_the_seen_process_has_ended(prepared):
    use_instructor(NOTEBOOKS / "instructor")
    started = []

    def start():
        started.append(StudentProcess(Limits(memory=1000), prepared))
        return started[-1]

    alive = []
    cells = {"helpers": WAITS, "test": "complaint = check(f)\nassert not complaint, complaint"}
    marked = {"solution": False, "locked": True, "schema_version": 3, "task": False}
    notebook = new_notebook(cells=[new_code_cell("def f(x):\n    return x")])
    for name, source in cells.items():
        about = marked | {"grade_id": name, "grade": name == "test"}
        notebook.cells.append(new_code_cell(source, metadata={"nbgrader": about}))
    notebook.cells.append(new_code_cell("def f(x):\n    return x + 1"))
    seen = StudentProcess.ask

    def ask(process, message, deadline, callbacks=None):
        if 98765 in message.get("arguments", ()):
            alive.extend(one for one in started if one is not process and one.process.poll() is None)
        return seen(process, message, deadline, callbacks)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(StudentProcess, "ask", ask)
        run_submission(notebook, cells, start, 10)
    (output,) = notebook.cells[2].outputs
    assert output.evalue == "f, on inputs you haven't seen: wrong", "by the cells above the test, not the last one"
    assert (len(started), alive) == (2, [])


def test_a_cell_of_the_exercise_may_take_longer_than_an_answer(prepared):
    slow = "import time\ntime.sleep(1.5)"
    marked = {
        "grade_id": "setup",
        "grade": False,
        "solution": False,
        "locked": True,
        "schema_version": 3,
        "task": False,
    }
    notebook = new_notebook(cells=[new_code_cell(slow, metadata={"nbgrader": marked}), new_code_cell(slow)])
    ended = run_submission(notebook, {"setup": slow}, lambda: StudentProcess(Limits(memory=1000), prepared), 1)
    exercises, hers = notebook.cells
    assert exercises.outputs == []
    assert [output.ename for output in hers.outputs] == ["AnswerTimeoutError"]
    assert ended.keys() == {""}
    assert ended[""].startswith("no reply before timeout, 1 s")


def test_no_hidden_part_reaches_the_process_that_the_student_sees(session):
    session.run("def f(x):\n    return x")
    f = session.names(["f"], session)["f"]
    session.stop()
    with pytest.raises(NoProcessError):
        f(1)
