"""Stages from a student's file: which functions count, and what is said of a file that won't do."""

import re

import numpy as np
import pytest

from semgrid_edu.errors import DataError
from semgrid_edu.workshop.demo.stages_file import load_stages


def write(folder, text, name="my_stages.py"):
    path = folder / name
    path.write_text(text)
    return path


def test_functions_with_the_names_of_stages_count_and_others_do_not(tmp_path):
    stages = load_stages(write(tmp_path, "def refine(log_g, o): return 7\ndef blur(g): return g\nwidth = 3\n"))
    assert stages.given == ("refine",)
    assert stages.refine(None, None) == 7


def test_a_file_may_import_its_neighbours_and_have_dataclasses(tmp_path):
    write(tmp_path, "WIDTH = 3\n", "neighbour_of_my_stages.py")
    text = (
        "from __future__ import annotations\n"
        "from dataclasses import dataclass\n"
        "from neighbour_of_my_stages import WIDTH\n"
        "@dataclass\n"
        "class Blur:\n"
        "    width: int\n"
        "    def __call__(self, log_g, o): return self.width * np.exp(log_g)\n"
        "import numpy as np\n"
        "refine = Blur(WIDTH)\n"
    )
    np.testing.assert_array_equal(load_stages(write(tmp_path, text)).refine(np.zeros(2), None), [3, 3])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def smooth(log_g, o): pass", "expected at least one function named track, .*, found smooth"),
        ("x = 1", "found no function at all"),
        ("refine = [1]", r"expected refine to be a function refine\(log_g, o\), found a list"),
        ("def refine(g): pass", r"expected refine to be a function refine\(log_g, o\), found refine\(g\)"),
        (
            "class refine:\n    def __call__(self, log_g, o): return log_g",
            r"found the class refine itself: write refine = ",
        ),
        ("def refine(log_g, o)", r"a file that Python can import, found SyntaxError: .* \(my_stages.py, line 1\)"),
        ("x = 1\ny = [][x]", r"found IndexError: list index out of range \(my_stages.py, line 2\)"),
        ("import sys\nsys.exit(2)", r"found SystemExit: 2 \(my_stages.py, line 2\)"),
        ("import no_such_module_anywhere", "found ModuleNotFoundError: No module named"),
    ],
)
def test_a_file_that_will_not_do_is_named_with_what_is_wrong(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(DataError, match=rf"^{re.escape(str(path))}: .*{message}"):
        load_stages(path)


@pytest.mark.parametrize(
    ("name", "found"), [("missing.py", "no such file"), ("", "a folder"), ("notes.txt", "another file")]
)
def test_what_is_no_python_file_is_refused(tmp_path, name, found):
    write(tmp_path, "", "notes.txt")
    with pytest.raises(DataError, match=f"expected a Python file with functions named track, .*, found {found}$"):
        load_stages(tmp_path / name)
