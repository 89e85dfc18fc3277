"""A private variant of an exercise, as the guide describes it; `test_catalogue` grades references with other inputs."""

import re
import shutil
import sys

import pytest
from nbgrader.utils import is_grade

from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent


def changed(text, diff):
    """Carry out a diff of the guide: each line that begins with a minus goes, for those with a plus behind it."""
    for block in re.findall(r"((?:^-.*\n)+)((?:^\+.*\n)+)", diff, re.MULTILINE):
        old, new = ("".join(line[1:] for line in part.splitlines(keepends=True)) for part in block)
        assert text.count(old) >= 1, old
        text = text.replace(old, new)
    return text


def passes(cells, names, task):
    """Whether the tests of a task pass with the answers among these names."""
    for cell in cells:
        if is_grade(cell) and cell.metadata.nbgrader.grade_id.startswith(task):
            try:
                exec(cell.source, names)
            except AssertionError:
                return False
    return True


def forget_instructor():
    """Let the next import of the instructor's modules find them anew."""
    for name in [name for name in sys.modules if name.split(".")[0] == "semgrid_instructor"]:
        del sys.modules[name]


@pytest.fixture
def instructor_forgotten():
    """No module of the instructor before the test, and none of its variant after it, which others would meet."""
    forget_instructor()
    yield
    forget_instructor()


@pytest.mark.usefixtures("instructor_forgotten")
def test_the_guides_private_variant_passes_with_its_answer_and_not_with_the_public_one(tmp_path, monkeypatch):
    guide = (NOTEBOOKS / "instructor" / "README.md").read_text(encoding="utf-8")
    exercise, hidden = re.findall(r"```diff\n(.*?)```", guide, re.DOTALL)
    shutil.copytree(NOTEBOOKS / "instructor" / "semgrid_instructor", tmp_path / "semgrid_instructor")
    checks = tmp_path / "semgrid_instructor" / "bayes.py"
    checks.write_text(changed(checks.read_text(encoding="utf-8"), hidden), encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    source = NOTEBOOKS / "src" / "exercises" / "01_bayes.py"
    private = tmp_path / "01_bayes.py"
    private.write_text(changed(source.read_text(encoding="utf-8"), exercise), encoding="utf-8")
    public_cells, cells = ([c for c in read_percent(one).cells if c.cell_type == "code"] for one in (source, private))
    answers = [cell for cell in cells if not is_grade(cell)]
    names, public = {"__name__": "__main__"}, {"__name__": "__main__"}
    for cell in answers:
        exec(cell.source, names)
    for cell in (cell for cell in public_cells if not is_grade(cell)):
        exec(cell.source, public)
    assert passes(cells, names, "")
    assert not passes(cells, public, "locate-test")
    assert not passes(cells, public, "locate-stuck-test")  # the guide says so
