"""A class, from handing in to the exported grades: each grade is what it should be."""

import csv
import subprocess
import sys
from dataclasses import replace

import pytest
import test_sound as sound
from class_of import NAME, POINTS, REFERENCE, SETTINGS, handed_in, inside
from entries import entries_of, exercises
from typer.testing import CliRunner

from semgrid_edu.workshop.commands.main import app
from semgrid_edu.workshop.course.nbgrader import build
from semgrid_edu.workshop.course.nbgrader.autograde import place
from semgrid_edu.workshop.course.nbgrader.build import course_api
from semgrid_edu.workshop.course.nbgrader.grade_class import grade_course
from semgrid_edu.workshop.course.nbgrader.gradebook import write_graded
from semgrid_edu.workshop.course.notebooks.build import write_notebook

PATIENT = replace(SETTINGS, timeout=30)
"""No answer here goes on for ever, and two processes grade while other tests run."""


def with_entries(entries):
    """Return a notebook in which catalogued answers stand in place of the reference, and what it should earn."""
    answers = REFERENCE | {entry.task: entry.code(REFERENCE) for entry in entries}
    return handed_in(answers), 13 - sum(entry.loses for entry in entries)


def students_of_each_kind():
    """Return each student's notebook and the points that it should earn: each kind, and each task right and wrong.

    More of each kind are `test_fair`, `test_sound` and the catalogue.
    """
    entries, tasks = entries_of(NAME), list(POINTS)
    rights = {task: [e for e in entries if e.task == task and not e.loses] for task in tasks}
    wrongs = {task: [e for e in entries if e.task == task and e.loses and "timeout" not in e.says] for task in tasks}
    found = {"right-0": (handed_in(), 13), "untouched-0": (handed_in({}), 0)}
    found["right-1"] = with_entries([ways[0] for ways in rights.values()])
    half = {task: code for task, code in REFERENCE.items() if task in tasks[::2]}
    found["half"] = handed_in(half), sum(POINTS[task] for task in half)
    found |= {f"wrong-{k}": with_entries([ways[k % len(ways)] for ways in wrongs.values()]) for k in range(2)}
    found["unlucky-exit"] = handed_in(inside("predict", "exit()")), 10
    found["hostile-transformer"] = handed_in(sound.EASIER, sound.EASY + sound.ATTACKS["transformer"]), 0
    return found


@pytest.fixture(scope="module")
def graded(new_course):
    """Grade the class; return the course, the right points, and the table of scores."""
    course = new_course(NAME)
    students = students_of_each_kind()
    for student, (notebook, _) in students.items():
        write_notebook(notebook, place(course, "submitted", student, NAME))
    seen = list(grade_course(course, PATIENT, workers=2))
    assert len(seen) == len(students)
    with write_graded(course).open(newline="") as file:
        table = {row["student"]: row for row in csv.DictReader(file)}
    return course, {student: points for student, (_, points) in students.items()}, table


def test_the_command_lays_out_every_exercise_and_points_to_its_guide(tmp_path, monkeypatch):
    monkeypatch.setattr(build, "_release", lambda *arguments: None)  # nbgrader releases each in `test_catalogue`
    result = CliRunner().invoke(app, ["course", "build", str(tmp_path)], catch_exceptions=False)
    assert f"{tmp_path}: {len(exercises())} assignments, {', '.join(exercises())}" in result.output
    assert (tmp_path / "README.md").is_file()


def test_each_grade_is_what_it_should_be(graded):
    _, expected, table = graded
    assert {student: float(row["score"]) for student, row in table.items()} == expected
    assert not any(row["note"] for row in table.values())


def test_what_nbgrader_exports_are_the_same_grades(graded):
    course, expected, _ = graded
    subprocess.run([sys.executable, "-m", "nbgrader", "export"], cwd=course, check=True, capture_output=True)
    with (course / "grades.csv").open(newline="") as file:
        rows = {row["student_id"]: row for row in csv.DictReader(file) if row["assignment"] == NAME}
    assert {student: float(row["score"]) for student, row in rows.items()} == expected


def test_who_earns_little_gets_feedback(graded):
    course, expected, _ = graded
    for student in ("untouched-0", "unlucky-exit"):
        with course_api(course) as api:
            assert api.generate_feedback(NAME, student)["success"]
        page = place(course, "feedback", student, NAME).with_suffix(".html").read_text()
        assert f"{expected[student]:.1f} / 15.0" in page


def test_what_is_graded_is_not_graded_again_unless_it_is_handed_in_again(graded):
    course, _, _ = graded
    assert list(grade_course(course, PATIENT)) == []
    write_notebook(handed_in(), place(course, "submitted", "untouched-0", NAME))
    assert [(one.student, one.score) for one in grade_course(course, PATIENT)] == [("untouched-0", 13)]
