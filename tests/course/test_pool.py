"""A submission that ends the grader's own process: it is marked, and everybody else is graded in a fresh pool."""

import os
import signal
import tempfile
import threading
import time

import pytest
from submissions import reference_answers, submission
from tiny_course import TINY, tiny_notebooks

from semgrid_edu.workshop.course.nbgrader.autograde import GradeSettings, place
from semgrid_edu.workshop.course.nbgrader.build import build_course
from semgrid_edu.workshop.course.nbgrader.grade_class import grade_course
from semgrid_edu.workshop.course.nbgrader.gradebook import has_begun, ungraded
from semgrid_edu.workshop.course.notebooks.build import write_notebook

KILLS = "if twice(0) == 'kill': import os; os._exit(9)\n    "
GROWS = "np.zeros(10**9, dtype=np.uint8)[:, None] == np.zeros((1, 9)) if twice(0) == 'grow' else 0\n    "


@pytest.fixture
def course(tmp_path):
    """A course whose hidden test dies of one answer, and takes much memory for another."""
    notebooks = tiny_notebooks(tmp_path / "notebooks")
    build_course(tmp_path / "course", notebooks)
    module = tmp_path / "course" / "instructor" / "semgrid_instructor" / "tiny.py"
    text = module.read_text().replace("from semgrid_instructor", "import numpy as np\n\nfrom semgrid_instructor")
    module.write_text(text.replace("    secret_input", f"    {KILLS}{GROWS}secret_input"))
    return tmp_path / "course"


@pytest.fixture
def hand_in(course, tmp_path):
    """Return a function that hands in right answers, but for what they say to 0."""
    source = tmp_path / "notebooks" / "src" / "exercises" / f"{TINY}.py"

    def write(student, to_zero):
        code = f"def twice(x):\n    return {to_zero!r} if x == 0 else 2 * x"
        notebook = submission(source, reference_answers(source) | {"twice": code})
        write_notebook(notebook, place(course, "submitted", student, TINY))

    return write


def test_who_ends_the_grader_is_marked_and_nobody_else(course, hand_in, tmp_path_factory, monkeypatch):
    temporary = tmp_path_factory.mktemp("t")  # a short path: the address of a socket in it has 108 characters at most
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    for k in range(2):
        hand_in(f"right-{k}", 0)
    hand_in("killer", "kill")
    results = {one.student: one for one in grade_course(course, GradeSettings(timeout=5), workers=2)}
    assert {name: one.score for name, one in results.items()} == {f"right-{k}": 2 for k in range(2)} | {"killer": 0}
    assert "twice it ended the process that grades" in results["killer"].note
    assert {name for name, one in results.items() if one.note} == {"killer"}
    assert list(temporary.glob("semgrid-*")) == []
    assert list(grade_course(course, GradeSettings(timeout=5))) == []


def test_who_interrupts_the_main_process_alone_does_not_wait(course, hand_in):
    endless = type("Endless", (), {"__repr__": lambda self: "__import__('time').sleep(1000)"})()
    hand_in("endless", endless)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run in a shell's background
    graded = grade_course(course, GradeSettings(timeout=200))
    interrupt = threading.Thread(target=_interrupt_when, args=(lambda: has_begun(course, TINY, "endless"),))
    interrupt.start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        list(graded)
    assert time.monotonic() - began < 60
    assert ungraded(course) == [(TINY, "endless")]


def _interrupt_when(begun):
    """Send Ctrl-C to this process, not to its children, soon after something has begun."""
    while not begun():
        time.sleep(0.1)
    time.sleep(2)
    os.kill(os.getpid(), signal.SIGINT)


def test_memory_that_an_answer_takes_in_a_test_costs_its_points_alone(course, hand_in):
    hand_in("grows", "grow")
    hand_in("right", 0)
    results = {one.student: one.score for one in grade_course(course, GradeSettings(timeout=5, memory=1000))}
    assert results == {"grows": 0, "right": 2}
