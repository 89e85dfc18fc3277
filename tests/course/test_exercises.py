"""Student versions and the instructor's course, against what nbgrader itself makes of the same source."""

import os
import re
import subprocess
import sys

import nbformat
import pytest
from nbgrader.api import Gradebook
from nbgrader_scores import autograde
from submissions import reference_answers, submission
from tiny_course import tiny_notebooks

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import write_text
from semgrid_edu.workshop.course.nbgrader import build
from semgrid_edu.workshop.course.nbgrader.autograde import GradeSettings, UngradedError, autograde_one, place
from semgrid_edu.workshop.course.nbgrader.build import (
    build_course,
    exercise_sources,
    point_links,
    student_version,
)
from semgrid_edu.workshop.course.nbgrader.grade_class import grade_one
from semgrid_edu.workshop.course.nbgrader.gradebook import ungraded, write_graded
from semgrid_edu.workshop.course.notebooks.build import write_notebook


def sources(notebook):
    return [(cell.cell_type, cell.source, dict(cell.metadata)) for cell in notebook.cells]


def test_student_version_is_what_nbgrader_releases(course, source):
    released = nbformat.read(course / "release" / "00_tiny" / "00_tiny.ipynb", as_version=4)
    assert sources(student_version(source)) == sources(released)


@pytest.fixture(scope="module")
def released():
    """The cells that students get, by exercise."""
    return {source: student_version(source).cells for source in exercise_sources()}


def test_students_get_neither_solutions_nor_hidden_tests(released):
    for source, cells in released.items():
        text = "\n".join(cell.source for cell in cells)
        secrets = ["SOLUTION", "HIDDEN", "semgrid_instructor", *reference_answers(source).values()]
        assert [secret for secret in secrets if secret in text] == [], source.stem


def test_scores_come_from_nbgrader_and_a_second_build_keeps_them(course, notebooks, source):
    students = {"right": reference_answers(source), "stub": {}}
    before = dict(os.environ)
    scores = autograde(course, "00_tiny", {name: submission(source, a) for name, a in students.items()})
    assert dict(os.environ) == before, "as changed by the course's settings"
    assert {name: cells["twice-test"].score for name, cells in scores.items()} == {"right": 2, "stub": 0}
    assert scores["right"]["why"].score is None, "a written answer waits for a person"
    assert scores["stub"]["why"].score == 0, "an untouched one doesn't"
    build_course(course, notebooks)
    environment = os.environ | {"PATH": os.defpath}  # the venv isn't activated
    export = [sys.executable, "-m", "nbgrader", "export"]
    subprocess.run(export, cwd=course, env=environment, check=True, capture_output=True)
    rows = [line.split(",") for line in (course / "grades.csv").read_text().splitlines()]
    score, student = rows[0].index("score"), rows[0].index("student_id")
    assert {row[student]: float(row[score]) for row in rows[1:]} == {"right": 2, "stub": 0}


def test_a_written_answer_that_was_read_stays_read(course, source):
    write_notebook(submission(source, reference_answers(source)), place(course, "submitted", "reader", "00_tiny"))
    assert grade_one(course, "00_tiny", "reader", GradeSettings()).to_read == 1
    with Gradebook(f"sqlite:///{course / 'gradebook.db'}") as gradebook:
        grade = gradebook.find_grade("why", "00_tiny", "00_tiny", "reader")
        grade.manual_score, grade.needs_manual_grade = 1, False  # what formgrader writes
        gradebook.db.commit()
    assert ("00_tiny", "reader") not in ungraded(course), "or else it would wait for a person again"
    assert "reader,00_tiny,3.0,3.0,0," in write_graded(course).read_text()


def test_notebook_that_nbgrader_cannot_read_is_an_error_not_a_zero(course):
    path = place(course, "submitted", "breaker", "00_tiny")
    write_text(path, "{")
    with pytest.raises(UngradedError, match="NotJSONError"):
        autograde_one(course, "00_tiny", "breaker", GradeSettings())


def test_a_broken_source_is_named(tmp_path):
    notebooks = tiny_notebooks(tmp_path / "notebooks")
    broken = notebooks / "src" / "exercises" / "00_tiny.py"
    broken.write_text(broken.read_text().replace('"points": 2, ', ""))
    with pytest.raises(DataError, match="00_tiny"):
        build_course(tmp_path / "course", notebooks)


CHANGED = ["nbgrader_config.py", "instructor/semgrid_instructor/tiny.py"]


@pytest.fixture
def unreleased(monkeypatch):
    """Builds a course without nbgrader's part, which takes most of the time."""
    monkeypatch.setattr(build, "_release", lambda *arguments: None)


@pytest.mark.usefixtures("unreleased")
def test_what_the_instructor_changed_stays_and_is_named(tmp_path, notebooks):
    build_course(tmp_path / "course", notebooks)
    settings, module = (tmp_path / "course" / name for name in CHANGED)
    mine = settings.read_text() + "c.ExecuteApart.timeout = 99\n"
    settings.write_text(mine)
    built = build_course(tmp_path / "course", notebooks)
    assert built.kept == ["nbgrader_config.py"]
    assert settings.read_text() == mine
    original = module.read_text()
    changed = tiny_notebooks(tmp_path / "newer")
    newer = changed / "instructor" / "semgrid_instructor" / "tiny.py"
    newer.write_text(original + "\n# newer\n")
    assert build_course(tmp_path / "course", changed).kept == ["nbgrader_config.py"]
    assert module.read_text() == newer.read_text()
    module.write_text(original)
    assert build_course(tmp_path / "course", changed).kept == CHANGED


RELATIVE = r"\]\((?!https?://)"


@pytest.mark.usefixtures("unreleased")
def test_exercises_link_to_where_students_find_the_lectures(tmp_path):
    notebooks = tiny_notebooks(tmp_path / "notebooks")
    source = notebooks / "src" / "exercises" / "00_tiny.py"
    source.write_text(source.read_text().replace("# # A tiny exercise", "# See [the tour](../00_tour.ipynb)."))
    course = tmp_path / "course"
    exercise = course / "source" / "00_tiny" / "00_tiny.ipynb"
    build_course(course, notebooks)
    assert "See the tour." in exercise.read_text()
    build_course(course, notebooks, "https://course.example/lectures/")
    assert "See [the tour](https://course.example/lectures/00_tour.ipynb)." in exercise.read_text()
    build_course(course, notebooks)
    assert "https://course.example/lectures/00_tour.ipynb" in exercise.read_text(), "it is remembered"
    assert build_course(course, notebooks, "../lectures").kept == []
    assert "See [the tour](../lectures/00_tour.ipynb)." in exercise.read_text()
    with pytest.raises(ArgumentError, match="blanks"):
        build_course(course, notebooks, "my lectures")


def test_no_link_of_a_released_exercise_is_dead(released):
    for source, cells in released.items():
        text = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
        assert "](../" in text, f"{source.stem}: an exercise links to its lecture"
        assert not re.search(RELATIVE, point_links(text, "")), f"{source.stem}: a link that course build doesn't know"


def test_without_exercises_nothing_is_written(tmp_path):
    with pytest.raises(DataError, match="exercises of a clone"):
        build_course(tmp_path / "course", tmp_path / "nothing")
    assert not (tmp_path / "course").exists()


def test_instructors_guide_names_every_folder_that_is_made(course):
    guide = (course / "README.md").read_text()
    for name in ("source/", "release/", "instructor/", "gradebook.db", "nbgrader_config.py"):
        assert f"`{name}`" in guide
        assert (course / name).exists()
