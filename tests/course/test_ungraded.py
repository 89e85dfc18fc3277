"""A failure of the grader costs no student a point: it is reported, and the next call grades what is left."""

import errno
import functools
import sqlite3
import subprocess
import sys

import pytest
from nbconvert.writers import FilesWriter
from nbgrader.api import Gradebook, InvalidEntry
from tiny_course import TINY
from typer.testing import CliRunner

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import write_text
from semgrid_edu.workshop.commands import main as cli
from semgrid_edu.workshop.course.nbgrader import autograde as grading
from semgrid_edu.workshop.course.nbgrader import preprocessors as nbgrader_steps
from semgrid_edu.workshop.course.nbgrader.autograde import GradeSettings, UngradedError, place
from semgrid_edu.workshop.course.nbgrader.build import build_course
from semgrid_edu.workshop.course.nbgrader.grade_class import grade_one, missing_limits
from semgrid_edu.workshop.course.nbgrader.gradebook import misplaced, ungraded, write_graded
from semgrid_edu.workshop.course.nbgrader.preprocessors import instructors_cells
from semgrid_edu.workshop.course.notebooks.build import write_notebook
from semgrid_edu.workshop.course.sandbox import process as process_module
from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.notebook import run_submission
from semgrid_edu.workshop.course.sandbox.process import StudentProcess


@pytest.fixture
def handed_in(course, right, request):
    """Hand in a right notebook; return the student's name, another one in each test."""
    write_notebook(right, place(course, "submitted", request.node.name, TINY))
    return request.node.name


def is_graded(course, student):
    return (TINY, student) not in ungraded(course)


def stays_ungraded(course, student):
    """Grade in vain; return the error's message."""
    with pytest.raises(UngradedError) as caught:
        grade_one(course, TINY, student, GradeSettings(timeout=5))
    assert not is_graded(course, student)
    assert f"\n{student}," not in write_graded(course).read_text()
    return str(caught.value)


def is_graded_next_time(course, student):
    result = grade_one(course, TINY, student, GradeSettings(timeout=5))
    assert (result.score, result.to_read, result.note) == (2, 1, "")
    return is_graded(course, student)


def test_a_gradebook_that_stays_locked(course, handed_in, monkeypatch, caplog):
    monkeypatch.setattr(grading, "TRIES", 1)
    monkeypatch.setattr(sqlite3.dbapi2, "connect", functools.partial(sqlite3.dbapi2.connect, timeout=0.2))
    held = sqlite3.connect(course / "gradebook.db", isolation_level=None)
    held.execute("BEGIN IMMEDIATE")
    with pytest.raises(UngradedError, match="database is locked"):
        grade_one(course, TINY, handed_in, GradeSettings())
    held.close()
    assert "Rolling back" not in caplog.text, "with a page of traceback"
    assert not is_graded(course, handed_in)
    assert is_graded_next_time(course, handed_in)


def test_a_gradebook_in_which_another_process_was_first_is_tried_again(course, handed_in, monkeypatch):
    first = [InvalidEntry("UNIQUE constraint failed: student.id")]
    enter = Gradebook.update_or_create_student

    def enter_late(*arguments, **named):
        if first:
            raise first.pop()
        return enter(*arguments, **named)

    monkeypatch.setattr(Gradebook, "update_or_create_student", enter_late)
    assert is_graded_next_time(course, handed_in)


def test_a_machine_without_room(course, handed_in, monkeypatch):
    failures = [OSError(errno.ENOSPC, "No space left on device"), MemoryError(), RuntimeError("the grader's own")]

    def write(*arguments, **named):
        raise failures[-1]

    with monkeypatch.context() as full:
        full.setattr(FilesWriter, "write", write)
        while failures:
            assert type(failures[-1]).__name__ in stays_ungraded(course, handed_in)
            failures.pop()
    assert is_graded_next_time(course, handed_in)


def test_an_interruption(course, handed_in, monkeypatch):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as changed:
        changed.setattr(nbgrader_steps, "run_submission", interrupted)
        assert stays_ungraded(course, handed_in) == "KeyboardInterrupt"
    assert is_graded_next_time(course, handed_in)


DIES = """
import os, sys
from pathlib import Path
from semgrid_edu.workshop.course.nbgrader import preprocessors as nbgrader_steps
from semgrid_edu.workshop.course.nbgrader.grade_class import grade_one
from semgrid_edu.workshop.course.nbgrader.autograde import GradeSettings
nbgrader_steps.run_submission = lambda *arguments: os._exit(9)
grade_one(Path(sys.argv[1]), sys.argv[2], sys.argv[3], GradeSettings())
"""


def test_a_grader_that_is_killed_while_it_grades_again(course, handed_in):
    assert is_graded_next_time(course, handed_in)
    died = subprocess.run([sys.executable, "-c", DIES, course, TINY, handed_in], check=False, capture_output=True)
    assert died.returncode == 9
    assert place(course, "autograded", handed_in, TINY).exists(), "a half-made notebook, beside the old scores"
    assert not is_graded(course, handed_in)
    assert f"\n{handed_in}," not in write_graded(course).read_text()
    assert is_graded_next_time(course, handed_in)


def test_a_worker_that_does_not_start(course, handed_in, monkeypatch):
    assert is_graded_next_time(course, handed_in), "the reference has passed"
    monkeypatch.setattr(process_module, "WORKER", ("false",))
    assert "this command starts no Python that answers: false" in stays_ungraded(course, handed_in)
    with pytest.raises(OSError, match="answers: false"):
        missing_limits()


def test_no_process_for_the_hidden_tests(course, right, tmp_path):
    started = []

    def start():
        if started:
            raise OSError(errno.ENOMEM, "Cannot allocate memory")
        started.append(StudentProcess(Limits(), tmp_path))
        return started[0]

    cells = instructors_cells(right) | {"twice-test": "_ = twice.unseen(3)"}
    test = next(cell for cell in right.cells if cell.metadata.get("nbgrader", {}).get("grade_id") == "twice-test")
    test.source, before = cells["twice-test"], test.source
    with pytest.raises(ChildProcessError, match="Cannot allocate memory"):
        run_submission(right, cells, start, 5)
    test.source = before


def test_a_time_that_cannot_be_read_is_the_instructors(course, handed_in):
    note = place(course, "submitted", handed_in, TINY).with_name("timestamp.txt")
    note.write_text("on Monday, late")
    assert "timestamp.txt: expected a time" in stays_ungraded(course, handed_in)
    note.write_text("2027-03-01 17:12:00 UTC")
    assert is_graded_next_time(course, handed_in)


def test_reference_answers_that_crash(notebooks, right, tmp_path):
    course = tmp_path / "course"
    build_course(course, notebooks)
    write_notebook(right, place(course, "submitted", "ada", TINY))
    module = course / "instructor" / "semgrid_instructor" / "tiny.py"
    text = module.read_text()
    module.write_text(text.replace("197530", "1 / 0"))
    assert "expected reference answers that pass their tests" in stays_ungraded(course, "ada")
    module.write_text(text)
    for name in [name for name in sys.modules if name.startswith("semgrid_instructor")]:
        del sys.modules[name]
    assert is_graded_next_time(course, "ada")


def test_who_is_ungraded_is_named_in_the_end_after_all_others(course, handed_in, right):
    write_notebook(right, place(course, "submitted", "late", TINY))
    place(course, "submitted", "late", TINY).with_name("timestamp.txt").write_text("late")
    result = CliRunner().invoke(cli.app, ["course", "grade", str(course), TINY, "--workers", "1"])
    assert result.exit_code != 0
    assert f"late, {TINY}: " in str(result.exception)
    assert f"\n{handed_in},{TINY},2.0," in (course / "graded.csv").read_text()


def test_notebooks_in_wrong_places_are_named(course, handed_in):
    folder = place(course, "submitted", handed_in, TINY).parent
    write_text(folder / "draft.ipynb", "beside one that is graded")
    wrong = [f"submitted/bob/{TINY}/{TINY} (1).ipynb", "submitted/bob/00_tyni/00_tyni.ipynb", "submitted/cy.ipynb"]
    for name in wrong:
        write_text(course / name, "{}")
    assert {path.as_posix() for path in misplaced(course)} == set(wrong)


def test_nbgraders_error_is_one_line(course, notebooks, handed_in):
    grade_one(course, TINY, handed_in, GradeSettings())
    source = notebooks / "src" / "exercises" / f"{TINY}.py"
    text = source.read_text()
    source.write_text(text[: text.rindex("# %% [markdown]")])
    with pytest.raises(DataError, match="Cannot add or remove cells") as caught:
        build_course(course, notebooks)
    source.write_text(text)
    build_course(course, notebooks)
    assert "\n" not in str(caught.value)
