"""Companion notebooks and exercises without a number go the same ways as those of the lectures."""

import nbformat
import pytest
from tiny_course import EXERCISE, tiny_notebooks

from semgrid_edu.workshop.course import checks
from semgrid_edu.workshop.course.nbgrader.build import build_exercise, exercise_sources
from semgrid_edu.workshop.course.notebooks.build import (
    build_lecture,
    built_path,
    companion_sources,
    read_percent,
    write_notebook,
)

COMPANION = """\
# %% [markdown]
# # Messages
#
# **In one sentence.** A message is a sum.
#
# **You will be able to** pass one.
#
# **Prerequisites.** None.
#
# **Time.** 3 minutes.

# %%
from pathlib import Path

from semgrid_edu.datasets.samples import sample_drive

print(Path.cwd().name, len(sample_drive()))

# %% [markdown]
# ## Where this breaks
#
# In loops.
#
# ## Further reading
#
# Back to [its lecture](../00_tiny.ipynb).
"""


@pytest.fixture
def folder(tmp_path):
    """A lecture that links to a companion, which has an exercise."""
    notebooks = tiny_notebooks(tmp_path / "notebooks")
    (notebooks / "src" / "deeper").mkdir()
    (notebooks / "src" / "deeper" / "messages.py").write_text(COMPANION)
    (notebooks / "src" / "exercises" / "messages.py").write_text(EXERCISE)
    lecture = notebooks / "src" / "00_tiny.py"
    lecture.write_text("# %% [markdown]\n# [More](deeper/messages.ipynb)\n")
    write_notebook(read_percent(lecture), built_path(lecture))
    return notebooks


def test_a_companion_runs_in_its_folder_and_finds_the_samples(folder):
    [source] = companion_sources(folder)
    path = build_lecture(source)
    assert path == built_path(source) == folder / "deeper" / "messages.ipynb"
    assert nbformat.read(path, as_version=4).cells[1].outputs[0].text == "deeper 20\n"
    assert checks.companion_problems(source) == []


def test_each_flaw_of_a_companion_is_found(folder):
    [source] = companion_sources(folder)
    assert "deeper/messages.ipynb: not built; run `semgrid-edu course notebooks`" in checks.companion_problems(source)
    source.write_text(COMPANION.replace("../00_tiny.ipynb", "00_tiny.ipynb").replace("## Where", "## When"))
    notebook = read_percent(source)
    notebook.cells[1].execution_count = 1  # as if it had run
    write_notebook(notebook, built_path(source))
    (folder / "src" / "00_tiny.py").write_text("# %% [markdown]\n# Nothing more.\n")
    problems = checks.companion_problems(source)
    assert [problem.removeprefix("deeper/messages.ipynb: ") for problem in problems] == [
        "lacks a limit",
        "lacks the link back to its lecture or exercise",
        "cell '## When this breaks' links to 00_tiny.ipynb, which does not exist",
        "no lecture links to it; write ](deeper/messages.ipynb) where it helps",
    ]


def test_the_course_check_sees_companions_and_their_exercises(folder, monkeypatch):
    monkeypatch.setattr(checks, "LECTURE_PARTS", {})
    for source in exercise_sources(folder):
        build_exercise(source)
    assert checks.course_problems(folder) == [
        "00_tiny.ipynb: cell '[More](deeper/messages.ipynb)' links to deeper/messages.ipynb, which does not exist",
        "deeper/messages.ipynb: not built; run `semgrid-edu course notebooks`",
    ]
    monkeypatch.setattr(checks, "MAX_BYTES_TOGETHER", 1000)
    assert "all notebooks together" in checks.course_problems(folder)[-1]
