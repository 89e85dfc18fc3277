"""The warm session is as honest as nbgrader's grading: nothing of one student reaches the next, and limits hold."""

import pytest
from class_of import NAME, REFERENCE, SOURCE, inside
from entries import entries_of, pack
from nbgrader_scores import autograde
from submissions import submission
from warm import grade_warm, warm_processes

from semgrid_edu.workshop.course.sandbox.linux import landlock_version


@pytest.fixture(scope="module")
def start(nursery, tmp_path_factory):
    with warm_processes(nursery, SOURCE, tmp_path_factory.mktemp(NAME)) as start:
        yield start


def points(start, answers, timeout=5):
    return sum(cell.score or 0 for cell in grade_warm(SOURCE, answers, start, timeout).values())


SPOILS = """
import builtins, pathlib, semgrid_edu.workshop.course.answers, sys, tempfile
np.asarray = np.array = np.zeros = sum
builtins.len = builtins.enumerate = semgrid_edu.workshop.course.answers.answer_array = lambda *a: None
sys.modules["numpy"] = None
for folder in (".", "..", tempfile.gettempdir()):
    try: pathlib.Path(folder, "left").write_text("x")
    except OSError: pass
"""

FINDS = """
import pathlib, tempfile
assert "SPOILED" not in globals() and np.zeros(1) == len("") == 0
assert not any(pathlib.Path(folder, "left").exists() for folder in (".", "..", tempfile.gettempdir()))
"""


def test_nothing_of_one_student_reaches_the_next(start):
    assert points(start, REFERENCE | {"locate": REFERENCE["locate"] + SPOILS + "\nSPOILED = 1"}) < 13
    assert points(start, {name: FINDS + code for name, code in REFERENCE.items()}) == 13


def test_nbgrader_with_fresh_processes_gives_the_same_points_and_messages(start, new_course):
    """To a student with a mistake in each task."""
    mistakes = pack(entry for entry in entries_of(NAME) if entry.loses and entry.kind == "answer")
    answers = REFERENCE | {task: entry.code(REFERENCE) for task, entry in mistakes[0].items()}
    warm = grade_warm(SOURCE, answers, start, timeout=30)
    scores = autograde(new_course(NAME), NAME, {"ada": submission(SOURCE, answers)})["ada"]
    assert {name: scores[name] for name in warm} == warm
    assert 0 < sum(cell.score or 0 for cell in warm.values()) < 13


@pytest.mark.skipif(not landlock_version(), reason="this system has no Landlock")
def test_the_reference_cannot_be_read(start):
    reads = f"open({str(SOURCE)!r}).read()"
    assert points(start, inside("predict", reads)) == 10
    assert points(start, inside("predict", "from semgrid_instructor import bayes")) == 10
