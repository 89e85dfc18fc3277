"""A class, from handing in to the exported grades: each grade is what it should be."""

import csv
from dataclasses import replace

import pytest
import test_sound as sound
from class_of import NAME, REFERENCE, SETTINGS, SOURCE, handed_in, inside
from entries import entries_of, exercises
from nbgrader_scores import scores
from typer.testing import CliRunner
from warm import grade_warm

from semgrid_edu.workshop.commands.main import app
from semgrid_edu.workshop.course.nbgrader import build
from semgrid_edu.workshop.course.nbgrader.autograde import place
from semgrid_edu.workshop.course.nbgrader.grade_class import grade_course
from semgrid_edu.workshop.course.nbgrader.gradebook import write_graded
from semgrid_edu.workshop.course.notebooks.build import write_notebook

PATIENT = replace(SETTINGS, timeout=30)
"""No answer here goes on for ever, and two processes grade while other tests run."""


MISTAKES = {entry.task: entry for entry in reversed(entries_of(NAME)) if entry.loses}
"""The first mistake in each task."""

ANSWERS = {
    "right-0": REFERENCE,
    "untouched-0": {},
    "wrong-0": REFERENCE | {task: entry.code(REFERENCE) for task, entry in MISTAKES.items()},
    "unlucky-exit": inside("predict", "exit()"),
}
"""Answers of each kind; more of each are in `test_fair`, `test_sound` and the catalogue."""

SCORES = {
    "right-0": 13,
    "untouched-0": 0,
    "wrong-0": 13 - sum(entry.loses for entry in MISTAKES.values()),
    "unlucky-exit": 10,
    "hostile-transformer": 0,
}


@pytest.fixture(scope="module")
def graded(new_course):
    """Grade the class; return the course and the table of scores."""
    course = new_course(NAME)
    students = {student: handed_in(answers) for student, answers in ANSWERS.items()}
    students["hostile-transformer"] = handed_in(sound.EASIER, sound.EASY + sound.ATTACKS["transformer"])
    for student, notebook in students.items():
        write_notebook(notebook, place(course, "submitted", student, NAME))
    seen = list(grade_course(course, PATIENT, workers=2))
    assert len(seen) == len(students)
    with write_graded(course).open(newline="") as file:
        return course, {row["student"]: row for row in csv.DictReader(file)}


def test_the_command_lays_out_every_exercise_and_points_to_its_guide(tmp_path, monkeypatch):
    monkeypatch.setattr(build, "_release", lambda *arguments: None)  # nbgrader releases one below
    result = CliRunner().invoke(app, ["course", "build", str(tmp_path)], catch_exceptions=False)
    assert f"{tmp_path}: {len(exercises())} assignments, {', '.join(exercises())}" in result.output
    assert (tmp_path / "README.md").is_file()


def test_each_grade_is_what_it_should_be(graded):
    _, table = graded
    assert {student: float(row["score"]) for student, row in table.items()} == SCORES
    assert not any(row["note"] for row in table.values())


def test_a_warm_session_gives_the_same_points_and_messages(graded, start):
    course, _ = graded
    for student in ("right-0", "untouched-0", "wrong-0"):
        warm = grade_warm(SOURCE, ANSWERS[student], start, PATIENT.timeout)
        assert scores(course, NAME, student) == warm, student
    assert 0 < SCORES["wrong-0"] < 13


def test_what_is_graded_is_not_graded_again_unless_it_is_handed_in_again(graded):
    course, _ = graded
    assert list(grade_course(course, PATIENT)) == []
    write_notebook(handed_in(), place(course, "submitted", "untouched-0", NAME))
    assert [(one.student, one.score) for one in grade_course(course, PATIENT)] == [("untouched-0", 13)]
