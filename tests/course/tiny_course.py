"""A folder of notebooks with one tiny exercise, laid out as the real one."""

# ruff: noqa: E501 (nbgrader's metadata has no line breaks)

import shutil
from pathlib import Path

from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS

TINY = "00_tiny"

EXERCISE = """\
# %% [markdown]
# # A tiny exercise

# %% nbgrader={"grade": false, "grade_id": "twice", "locked": false, "schema_version": 3, "solution": true, "task": false}
def twice(x):
    ### BEGIN SOLUTION
    return 2 * x
    ### END SOLUTION

# %% nbgrader={"grade": true, "grade_id": "twice-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
assert twice(3) == 6, f"twice 3 is 6, got {twice(3)}"
### BEGIN HIDDEN TESTS
from semgrid_instructor import tiny
complaint = tiny.check_twice(twice)
assert not complaint, complaint
### END HIDDEN TESTS

# %% [markdown] nbgrader={"grade": true, "grade_id": "why", "locked": false, "points": 1, "schema_version": 3, "solution": true, "task": false}
# Because two is two. One point for the
# reason.
"""

HIDDEN = '''\
"""Hidden tests of the tiny exercise."""

from semgrid_instructor import hidden


@hidden
def check_twice(twice):
    secret_input, secret_result = 98765, 197530
    assert twice(secret_input) == secret_result, "wrong"
'''


def tiny_notebooks(folder: Path) -> Path:
    """Write the sources of the tiny course, and return its folder of notebooks."""
    exercises = folder / "src" / "exercises"
    exercises.mkdir(parents=True)
    (exercises / f"{TINY}.py").write_text(EXERCISE)
    shutil.copytree(NOTEBOOKS / "instructor", folder / "instructor", ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "instructor" / "semgrid_instructor" / "tiny.py").write_text(HIDDEN)
    return folder
