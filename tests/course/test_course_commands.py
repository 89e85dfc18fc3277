"""The `semgrid-edu course` commands say what they did, and what they could not do."""

from tiny_course import tiny_notebooks
from typer.testing import CliRunner

from semgrid_edu.workshop.commands import course as course_commands
from semgrid_edu.workshop.commands import main as cli
from semgrid_edu.workshop.course.nbgrader import grade_class as grade
from semgrid_edu.workshop.course.nbgrader.build import build_course
from semgrid_edu.workshop.course.sandbox.limits import PARTS


def test_missing_tools_are_named(monkeypatch):
    monkeypatch.setattr(course_commands, "find_spec", lambda name: None)
    result = CliRunner().invoke(cli.app, ["course", "check"])
    assert "jupytext and nbgrader" in str(result.exception)


def test_grading_says_what_the_system_cannot_limit(tmp_path, monkeypatch):
    assert set(grade.missing_limits()) < set(PARTS)
    monkeypatch.setattr(grade, "missing_limits", lambda: ["network", "files"])
    build_course(tmp_path / "course", tiny_notebooks(tmp_path / "notebooks"))
    result = CliRunner().invoke(cli.app, ["course", "grade", str(tmp_path / "course")], catch_exceptions=False)
    assert "can't limit for students' code: network, files" in result.output
