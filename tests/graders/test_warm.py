"""The warm session is as honest as nbgrader's grading: nothing of one student reaches the next, and limits hold."""

import pytest
from class_of import REFERENCE, SOURCE, inside
from warm import grade_warm

from semgrid_edu.workshop.course.sandbox.linux import landlock_version


def points(start, answers, timeout=5):
    return sum(cell.score or 0 for cell in grade_warm(SOURCE, answers, start, timeout).values())


SPOILS = """
import builtins, pathlib, semgrid_edu.workshop.course.answers, sys, tempfile
np.asarray = np.array = np.zeros = sum
builtins.len = builtins.enumerate = semgrid_edu.workshop.course.answers.answer_array = lambda *a: None
sys.modules["numpy"] = None
for folder in (".", "..", tempfile.gettempdir(), "/dev/shm", "/var/tmp"):
    try: pathlib.Path(folder, "left").write_text("x")
    except OSError: pass
"""

FINDS = """
import pathlib, tempfile
assert "SPOILED" not in globals() and np.zeros(1) == len("") == 0
folders = (".", "..", tempfile.gettempdir(), "/dev/shm", "/var/tmp")
assert not any(pathlib.Path(folder, "left").exists() for folder in folders)
"""


def test_nothing_of_one_student_reaches_the_next(start):
    assert points(start, REFERENCE | {"locate": REFERENCE["locate"] + SPOILS + "\nSPOILED = 1"}) < 13
    assert points(start, {name: FINDS + code for name, code in REFERENCE.items()}) == 13


@pytest.mark.skipif(not landlock_version(), reason="this system has no Landlock")
def test_the_reference_cannot_be_read(start):
    reads = f"open({str(SOURCE)!r}).read()"
    assert points(start, inside("predict", reads)) == 10
    assert points(start, inside("predict", "from semgrid_instructor import bayes")) == 10
