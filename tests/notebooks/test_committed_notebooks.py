"""The committed lectures and exercises are what their sources say, have run, and are fit to be shown."""

import pytest

from semgrid_edu.course.checks import exercise_problems, lecture_problems
from semgrid_edu.course.exercises import exercise_sources
from semgrid_edu.course.notebooks import NOTEBOOKS, lecture_sources


@pytest.mark.parametrize("source", lecture_sources(), ids=lambda source: source.stem)
def test_lecture(source):
    assert lecture_problems(source) == []


@pytest.mark.parametrize("source", exercise_sources(), ids=lambda source: source.stem)
def test_exercise(source):
    assert exercise_problems(source) == []


def test_every_lecture_has_its_exercise():
    assert [s.stem for s in lecture_sources()] == [s.stem for s in exercise_sources()]


def test_every_exercise_has_its_catalogue():
    graders = {path.stem for path in (NOTEBOOKS.parent / "tests" / "graders").glob("test_grader_*.py")}
    assert graders == {f"test_grader_{source.stem}" for source in exercise_sources()}


def test_no_notebook_without_a_source():
    committed = {path.stem for path in NOTEBOOKS.glob("*.ipynb")} | {
        p.stem for p in NOTEBOOKS.glob("exercises/*.ipynb")
    }
    assert committed == {source.stem for source in lecture_sources()}


def test_all_together_are_small_enough_to_clone():
    assert sum(path.stat().st_size for path in NOTEBOOKS.rglob("*.ipynb")) < 8_000_000
