"""Submissions as platforms, editors and students leave them: none is merged with another, none lost without a word."""

import io
import os
import re
import subprocess
import sys
import time
import warnings
import zipfile

import nbformat
import pytest
from nbconvert import HTMLExporter
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_raw_cell
from nbgrader.utils import is_grade
from submissions import submission
from tiny_course import TINY

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.course.nbgrader import gradebook
from semgrid_edu.workshop.course.nbgrader import preprocessors as steps
from semgrid_edu.workshop.course.nbgrader.autograde import GradeSettings, UnfitError, place, student_variant
from semgrid_edu.workshop.course.nbgrader.build import MARKER, build_course, exercise_sources
from semgrid_edu.workshop.course.nbgrader.cleaning import without_scripts
from semgrid_edu.workshop.course.nbgrader.grade_class import grade_one
from semgrid_edu.workshop.course.nbgrader.gradebook import check_file
from semgrid_edu.workshop.course.nbgrader.preprocessors import rubrics
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent, write_notebook

GUIDE = (NOTEBOOKS / "instructor" / "README.md").read_text(encoding="utf-8")


def graded(course, student, notebook):
    write_notebook(notebook, place(course, "submitted", student, TINY))
    return grade_one(course, TINY, student, GradeSettings(timeout=5))


def stripped(notebook):
    for cell in notebook.cells:
        cell.metadata = {}
    return notebook


def test_a_notebook_that_lost_its_metadata_keeps_its_points(course, right):
    result = graded(course, "stripped", stripped(right))
    assert (result.score, result.to_read, result.note) == (2, 1, "")


def test_an_untouched_notebook_without_metadata_earns_nothing(course, notebooks):
    result = graded(course, "untouched", stripped(submission(notebooks / "src" / "exercises" / f"{TINY}.py", {})))
    assert (result.score, result.to_read, result.note) == (0, 0, "")


def test_a_notebook_of_something_else_is_left_to_a_person(course):
    other = new_notebook(cells=[new_code_cell("def thrice(x): return 3 * x"), new_markdown_cell("An essay.")])
    result = graded(course, "other", other)
    assert (result.score, result.points) == (0, 3)
    assert "no cell of this exercise was recognised" in result.note


def test_a_helper_that_was_handed_in_beside_is_found(course, right):
    cell = next(cell for cell in right.cells if cell.metadata.get("nbgrader", {}).get("grade_id") == "twice")
    cell.source = "from helper import twice"
    helper = place(course, "submitted", "helped", TINY).with_name("helper.py")
    (helper.parent / "data").mkdir(parents=True)
    (helper.parent / "data" / "table.txt").write_text("2")
    code = """
from pathlib import Path
assert [*Path().glob("*.ipynb")] == []
factor = int(Path("data/table.txt").read_text())
def twice(x): return factor * x
"""
    helper.write_text(code)
    assert graded(course, "helped", right).score == 2


def test_files_in_the_graders_places_cost_nothing(course, right):
    folder = place(course, "submitted", "places", TINY).parent
    modules = ("nbgrader_config", "sitecustomize", "numpy", "ipython_config", "semgrid_instructor/__init__")
    for name in ("prepared", ".prepared/fonts.json", "semgrid_edu/__init__.py", *(f"{name}.py" for name in modules)):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("raise SystemExit")
    result = graded(course, "places", right)
    assert (result.score, result.note) == (2, "")


OFFICIAL = "full points granted by the dean"
MANY = [new_markdown_cell("more") for _ in range(1001)]
UNFIT = {
    "cells": lambda path: write_notebook(new_notebook(cells=MANY), path),
    "files": lambda path: [(path.parent / f"{number}.txt").touch() for number in range(1001)],
    "link": lambda path: (path.parent / OFFICIAL).symlink_to(path),
    "pipe": lambda path: os.mkfifo(path.parent / OFFICIAL),
    "no JSON": lambda path: path.write_text(OFFICIAL),
    "no notebook": lambda path: path.write_text(f'{{"cells": "{OFFICIAL}", "metadata": {{}}, "nbformat": 4}}'),
    "not UTF-8": lambda path: path.write_bytes(OFFICIAL.encode() + b"\xff\xfe"),
    "format 2": lambda path: path.write_text(f'{{"nbformat": 2, "worksheets": ["{OFFICIAL}"]}}'),
    "nested": lambda path: path.write_text(f'"{OFFICIAL}"' + "[" * 100_000),
    "a cell of no kind": lambda path: path.write_text(path.read_text().replace('"code"', f'"{OFFICIAL}"')),
    "no text": lambda path: path.write_text(path.read_text().replace("Since 2 is 2", "\\ud800" + OFFICIAL)),
}
"""Files that can't be graded, and say what the grader might."""


def test_a_byte_order_mark_costs_nothing(course, right):
    path = place(course, "submitted", "marked", TINY)
    write_notebook(right, path)
    path.write_text(path.read_text(encoding="utf-8"), encoding="utf-8-sig")
    result = grade_one(course, TINY, "marked", GradeSettings(timeout=5))
    assert (result.score, result.note) == (2, "")


def test_copied_cells_that_kept_their_id_cost_nothing_and_are_not_named_one_by_one(course, right):
    path = place(course, "submitted", "copied", TINY)
    write_notebook(right, path)
    path.write_text(re.sub(r'"id": "[^"]*"', '"id": "same"', path.read_text()))
    with warnings.catch_warnings(record=True) as said:
        result = grade_one(course, TINY, "copied", GradeSettings(timeout=5))
    assert (result.score, said) == (2, [])


@pytest.mark.parametrize("kind", UNFIT)
def test_no_note_quotes_what_a_student_wrote(course, right, kind):
    path = place(course, "submitted", re.sub(r"\W", "-", kind), TINY)
    write_notebook(right, path)
    UNFIT[kind](path)
    began = time.monotonic()
    with pytest.raises(UnfitError) as told:
        check_file(path)
    assert OFFICIAL not in str(told.value)
    assert time.monotonic() - began < 10


def test_what_is_shown_below_an_answer(course, right):
    cell = next(cell for cell in right.cells if cell.metadata.get("nbgrader", {}).get("grade_id") == "twice")
    cell.source = f"def twice(x):\n    print('Crashed: {OFFICIAL}')\n    return 2 * x"
    right.cells.append(new_raw_cell('my note <img src="http://elsewhere.example/seen.png">'))
    student = "o'neill-joão.silva Maria_4711"  # as platforms write names
    result = graded(course, student, right)
    assert (result.score, result.note) == (2, "")
    path = place(course, "autograded", student, TINY)
    cells = nbformat.read(path, as_version=4).cells
    printed = [o.text for c in cells for o in c.get("outputs", []) if o.output_type == "stream"]
    assert printed == [f"your code printed:\nCrashed: {OFFICIAL}\n"]
    (answer,) = (k for k, cell in enumerate(cells) if cell.source == "Since 2 is 2.")
    assert cells[answer + 1].source == "> **Rubric.** One point for the reason."
    exporter = HTMLExporter()
    exporter.register_filter("strip_files_prefix", without_scripts)  # as the course's settings do
    page, _ = exporter.from_filename(path)
    assert "my note" in page
    assert "elsewhere.example" not in page, "a raw cell becomes text, which fetches nothing"


LAYOUTS = {
    "Blackboard": (
        "{}_attempt_2027-03-01-17-12-00_00_tiny.ipynb",
        ["anna silva", "joao.silva", "silva", "o'neill"],
        ["anna silva", "joao.silva", "silva", "o'neill"],
    ),
    "Canvas": (
        "{}_00_tiny-1.ipynb",
        ["silvaanna_4711_90210", "silvajoao_LATE_4712_90211", "silvaanna_4713_90212"],
        ["4711", "4712", "4713"],
    ),
    "Moodle": (
        "{}/00_tiny.ipynb",
        ["Anna Silva_4711_assignsubmission_file", "João Silva_4712_assignsubmission_file_"],
        ["Anna Silva_4711", "João Silva_4712"],
    ),
}


@pytest.mark.parametrize("platform", LAYOUTS)
def test_the_guides_pattern_tells_a_platforms_students_apart(platform):
    name, names, students = LAYOUTS[platform]
    pattern = re.findall(r"named_regexp='(.*)'", GUIDE)[[*LAYOUTS].index(platform)]
    found = [re.match(pattern, f"/downloaded/{name.format(one)}") for one in names]
    assert [one["student_id"] for one in found] == students
    assert {one["file_id"] for one in found} == {TINY}


def test_each_student_of_a_platform_gets_a_folder(course):
    name, names, students = LAYOUTS["Blackboard"]
    archive = course / "downloaded" / TINY / "archive"
    archive.mkdir(parents=True)
    with zipfile.ZipFile(archive / "all of them.zip", "w") as file:
        for one in names:
            file.writestr(name.format(one), one)
        for kind, hers in enumerate((name.format("nobody"), name.format("o'neill").replace("2027", "2028"))):
            inner = io.BytesIO()
            with zipfile.ZipFile(inner, "w") as nested:
                nested.writestr(hers, "hers")
            file.writestr(name.format("silva").replace("00_tiny.ipynb", f"{kind}.zip"), inner.getvalue())
            file.writestr(name.format("silva").replace("00_tiny.ipynb", hers), "hers")
            file.writestr(f"silva/deep/{hers}", "hers")
            file.writestr(name.format("silva").replace("00_tiny.ipynb", f"x\\{hers}"), "hers")
        file.writestr(name.format("large"), bytes(gradebook.MAX_BYTES + 1), zipfile.ZIP_DEFLATED)
    option = "--FileNameCollectorPlugin.named_regexp=" + re.search(r"named_regexp='(.*)'", GUIDE)[1]
    command = [sys.executable, "-m", "nbgrader", "zip_collect", TINY, option]
    subprocess.run(command, cwd=course, check=True, capture_output=True)
    assert [place(course, "submitted", student, TINY).read_text() for student in students] == names
    assert not {"nobody", "large"} & {folder.name for folder in (course / "submitted").iterdir()}


def test_every_written_question_has_a_rubric():
    for source in exercise_sources():
        written = [c for c in read_percent(source).cells if c.cell_type == "markdown" and is_grade(c)]
        assert len(written) == len(rubrics(read_percent(source))) == 1, source


def test_hidden_inputs_are_a_students_alone_and_the_same_each_time(course, right, monkeypatch):
    drawn = []

    def draw(*_):
        drawn.append(sys.modules[steps.INSTRUCTOR].generator(7).random())
        return {}

    graded(course, "ada", right)  # with it the reference, which draws the usual inputs
    monkeypatch.setattr(steps, "run_submission", draw)
    for student, by_student in (("ada", False), ("ada", True), ("bob", True), ("ada", True), ("bob", False)):
        write_notebook(right, place(course, "submitted", student, TINY))
        grade_one(course, TINY, student, GradeSettings(seed_by_student=by_student))
    usual, ada, bob, ada_again, usual_again = drawn
    assert (ada_again, usual_again) == (ada, usual)
    assert len({usual, ada, bob}) == 3


def test_nobody_knows_a_students_hidden_inputs_without_the_courses_salt(course, notebooks, tmp_path):
    build_course(tmp_path, notebooks)
    there, here = student_variant(tmp_path, "ada"), student_variant(course, "ada")
    assert there != here
    build_course(tmp_path, notebooks)
    assert student_variant(tmp_path, "ada") == there, "a second build keeps the salt"
    write_json(tmp_path / MARKER, read_json(tmp_path / MARKER) | {"salt": ""})
    with pytest.raises(DataError, match="course build"):
        student_variant(tmp_path, "ada")
