"""The committed lectures and exercises are what their sources say, have run, and are fit to be shown."""

import pytest

from semgrid_edu.workshop.course.checks import (
    MAX_BYTES_TOGETHER,
    companion_problems,
    exercise_problems,
    lecture_problems,
)
from semgrid_edu.workshop.course.nbgrader.build import exercise_sources
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, built_path, companion_sources, lecture_sources


@pytest.mark.parametrize("source", lecture_sources(), ids=lambda source: source.stem)
def test_lecture(source):
    assert lecture_problems(source) == []


@pytest.mark.parametrize("source", companion_sources(), ids=lambda source: source.stem)
def test_companion(source):
    assert companion_problems(source) == []


@pytest.mark.parametrize("source", exercise_sources(), ids=lambda source: source.stem)
def test_exercise(source):
    assert exercise_problems(source) == []


def test_every_lecture_has_its_exercise_and_every_exercise_its_notebook():
    lectures, companions, exercises = (
        {source.stem for source in sources()} for sources in (lecture_sources, companion_sources, exercise_sources)
    )
    assert lectures <= exercises <= lectures | companions


def test_every_exercise_has_its_catalogue():
    catalogues = {path.stem for path in (NOTEBOOKS.parent / "tests" / "graders" / "catalogue").glob("*.toml")}
    assert catalogues == {source.stem for source in exercise_sources()}


def test_no_notebook_without_a_source():
    sources = [*lecture_sources(), *companion_sources(), *exercise_sources()]
    assert {*NOTEBOOKS.glob("*.ipynb"), *NOTEBOOKS.glob("*/*.ipynb")} == {built_path(source) for source in sources}


def test_all_together_are_small_enough_to_clone():
    assert sum(path.stat().st_size for path in NOTEBOOKS.rglob("*.ipynb")) <= MAX_BYTES_TOGETHER
