"""No points without the answer: whatever a submission tries, it earns what its answers are worth."""

import hashlib
import itertools

import pytest
import tries
from class_of import NAME, REFERENCE, SETTINGS, SOURCE, cell_of, graded, handed_in, inside
from nbformat.v4 import new_code_cell, new_markdown_cell
from warm import grade_notebook

from semgrid_edu.workshop.course.nbgrader.autograde import place
from semgrid_edu.workshop.course.nbgrader.build import course_api
from semgrid_edu.workshop.course.nbgrader.grade_class import grade_one
from semgrid_edu.workshop.course.sandbox.notebook import cell_name

EASY = "\n".join(
    f"def {name}(*_, **__): return 0"
    for name in ("locate", "predict", "follow", "transition", "half_life", "build_map")
)

ATTACKS = {
    "transformer": """
def empty(lines): return [] if any("assert" in line for line in lines) else lines
get_ipython().input_transformers_post.append(empty)
""",
    "displayhook": """
import sys
sys.displayhook(3)
get_ipython().events.register("post_run_cell", lambda result: sys.displayhook(3))
""",
    "fake-module": """
import sys, types
class Fake(types.ModuleType):
    __path__ = []
    def __getattr__(self, name): return lambda *a: ""
sys.modules["semgrid_instructor"] = sys.modules["semgrid_instructor.bayes"] = Fake("semgrid_instructor")
""",
    "patched-numpy": """
np.allclose = np.isclose = np.array_equal = lambda *a, **k: True
np.testing.assert_allclose = lambda *a, **k: None
import builtins, filterpy.discrete_bayes
builtins.AssertionError = builtins.Exception
builtins.isinstance = lambda *a: True
filterpy.discrete_bayes.update = lambda *a: 0
""",
    "source": f"""
import glob, os
for pattern in ("../../../source/**", {str(SOURCE.parent)!r} + "/**", "/tmp/**/source/**"):
    for path in glob.glob(pattern, recursive=True):
        if path.endswith((".ipynb", ".py")):
            try: exec(open(path).read().partition("BEGIN SOLUTION")[2])
            except Exception: pass
""",
    "frames": """
import inspect
def steal(*_, **__):
    for frame in inspect.stack():
        for name in ("expected", "right", "by_hand"):
            if name in frame.frame.f_locals: return frame.frame.f_locals[name]
    raise ValueError
locate = predict = follow = transition = half_life = build_map = steal
""",
    "subclass": """
class Same(np.ndarray):
    def __array_function__(self, *a, **k): return True
    def __array_ufunc__(self, *a, **k): return True
    def __eq__(self, other): return True
locate = predict = follow = transition = half_life = build_map = lambda *a, **k: np.zeros(4).view(Same)
""",
    "ends-loops": """
locate = predict = follow = transition = half_life = build_map = lambda *a, **k: next(iter(()))
""",
    "no-error-kind": """
class Silent(BaseException):
    def __str__(self): return ""
    __mro__ = ()
def f(*a, **k): raise Silent
locate = predict = follow = transition = half_life = build_map = f
""",
}


EASIER = dict.fromkeys(REFERENCE, "pass")
"""Answer cells that leave to the first cell what they should define."""


FUNCTIONS = ("locate", "predict", "follow", "transition", "build_map")
"""The first function of each task."""


@pytest.mark.parametrize("first", range(0, len(tries.RETURNED), len(FUNCTIONS)))
def test_what_is_no_answer_earns_nothing_in_any_task(start, first):
    kinds = [*tries.RETURNED.values()][first : first + len(FUNCTIONS)]
    code = "\n".join(f"{attack}\n{name} = attack" for name, attack in zip(FUNCTIONS, kinds, strict=False))
    assert scores(handed_in(EASIER, first=f"{EASY}\n{code}"), start) == {}


@pytest.mark.parametrize("attack", [*ATTACKS.values(), *tries.IN_THE_WAY.values()], ids=[*ATTACKS, *tries.IN_THE_WAY])
def test_an_attack_earns_nothing(start, attack):
    assert scores(handed_in(EASIER, first=f"{EASY}\n{attack}"), start) == {}


@pytest.mark.parametrize("first", range(0, len(tries.STOPS), 3))
def test_what_stops_an_answer_costs_its_task_alone(start, first):
    lines = [*tries.STOPS.values()][first : first + 3]
    answers = [inside(name, line)[name] for name, line in zip(FUNCTIONS, lines, strict=False)]
    notebook = handed_in(REFERENCE | dict(zip(FUNCTIONS, answers, strict=False)))
    assert scores(notebook, start) == {"transition-test": 2, "half-life-test": 1, "build-map-test": 2}


def scores(notebook, start):
    """What each test cell has given, if anything."""
    return {name: cell.score for name, cell in grade_notebook(SOURCE, notebook, start, 3).items() if cell.score}


def pass_tests(notebook):
    for cell in notebook.cells:
        if cell.metadata.get("nbgrader", {}).get("grade"):
            cell.source = "pass"


def no_tests(notebook):
    notebook.cells = [cell for cell in notebook.cells if not cell_name(cell).endswith("-test")]


def helpers_after_tests(notebook):
    fakes = "def answer_array(*a): return [1, 0, 0, 0]\ndef answer_number(*a): return 0.34657\ndef _explain(*a): pass"
    notebook.cells.insert(0, new_code_cell(f"{fakes}\nnp = {{}}"))
    notebook.cells.append(notebook.cells.pop(cell_of(notebook, "setup")))


def text_for_tests(notebook):
    kinds = itertools.cycle(["markdown", "raw"])
    for cell in notebook.cells:
        if cell.metadata.get("nbgrader", {}).get("grade_id", "").endswith("-test"):
            cell.cell_type = next(kinds)
            cell.pop("outputs"), cell.pop("execution_count")


def added_test(notebook):
    nbgrader = {"grade": True, "grade_id": "bonus", "locked": True, "points": 50, "solution": False, "task": False}
    notebook.cells.append(new_code_cell("1", metadata={"nbgrader": nbgrader | {"schema_version": 3}}))


def more_points(notebook):
    for cell in notebook.cells:
        if "points" in cell.metadata.get("nbgrader", {}):
            cell.metadata.nbgrader.points = 100


def answers_for_tests(notebook):
    for cell in notebook.cells:
        if cell.metadata.get("nbgrader", {}).get("grade"):
            cell.metadata.nbgrader.update(solution=True, locked=False)
            cell.source += "\n#"


def two_of_a_name(notebook):
    k = cell_of(notebook, "locate-test")
    notebook.cells.append(new_code_cell("pass", metadata=notebook.cells[k].metadata))


CHANGES = {
    "other tests": [pass_tests, added_test, more_points],
    "no tests": [no_tests],
    "other helpers": [helpers_after_tests, two_of_a_name],
    "answers for tests": [answers_for_tests],
    "text for tests": [text_for_tests],
}


@pytest.mark.parametrize("kind", CHANGES)
def test_changed_tests_earn_nothing(forked, kind):
    notebook = handed_in(EASIER, first=EASY)
    for change in CHANGES[kind]:
        change(notebook)
    result = graded(forked, kind, notebook)
    assert (result.score, result.points) == (0, 15)


def test_nobodys_grades_or_tests_can_be_changed(forked):
    def contents():
        files = [forked / "gradebook.db", *(forked / "instructor").rglob("*.py"), *(forked / "source").rglob("*.ipynb")]
        return {path: hashlib.sha256(path.read_bytes()).hexdigest() for path in files if path.name != "gradebook.db"}

    before = contents()
    graded(forked, "victim", handed_in())
    code = f"""
import pathlib, sqlite3
for path in pathlib.Path({str(forked)!r}).rglob("*"):
    try: path.write_text("mine")
    except OSError: pass
try:
    with sqlite3.connect({str(forked / "gradebook.db")!r}) as db: db.execute("update grade set auto_score = 0")
except sqlite3.Error: pass
"""
    assert graded(forked, "vandal", handed_in(first=code)).score == 13
    assert contents() == before
    assert graded(forked, "victim-again", handed_in()).score == 13


def test_hidden_inputs_are_not_in_the_feedback(forked):
    """The secret: hidden tests of `locate` draw thirty cells, visible ones have four."""
    spy = "seen.append(len(belief)); print('cells:', len(belief)); assert len(belief) < 5, f'cells: {len(belief)}'"
    notebook = handed_in(inside("locate", spy), first="seen = []", last="print('cells:', max(seen))")
    assert graded(forked, "spy", notebook).score == 11
    with course_api(forked) as api:
        assert api.generate_feedback(NAME, "spy")["success"]
    page = place(forked, "feedback", "spy", NAME).with_suffix(".html").read_text()
    assert "cells: 4" in page
    assert "cells: 30" not in page
    assert "cells: 5" not in page


def test_feedback_runs_no_scripts(forked):
    show = """
from IPython.display import HTML, Javascript, display
display(HTML("<script>" + "alert(1)</script>"))
display(Javascript("alert" + "(2)"))
display({"image/svg+xml": "<svg onload=" + "'alert(3)'/>", "image/png": '"><script>' + "alert(4)</script>"}, raw=True)
"""
    notebook = handed_in(first=show)
    text = "**bold** $a < b$\n\n<script>alert(5)</script><img src=x onerror='alert(6)'>"
    notebook.cells.append(new_markdown_cell(text))
    notebook.cells.append(
        new_code_cell("print('<script>alert(9)</script>')\nraise type('<script>alert(10)', (Exception,), {})")
    )
    notebook.cells[-2]["attachments"] = {"a": {"image/png": '"><script>alert(11)</script>'}}
    notebook.cells[-2].source += "![a](attachment:a) $\\href{javascript:alert(12)}{x}$"
    notebook.metadata["language_info"] = {"name": "python", "pygments_lexer": "<script>alert(13)</script>"}
    notebook.metadata["title"] = "<script>alert(7)</script>"
    notebook.metadata["widgets"] = {"application/vnd.jupyter.widget-state+json": {"x": "<script>alert(8)</script>"}}
    assert graded(forked, "scripts", notebook).score == 13
    with course_api(forked) as api:
        assert api.generate_feedback(NAME, "scripts")["success"]
    page = place(forked, "feedback", "scripts", NAME).with_suffix(".html").read_text()
    for number in range(1, 14):
        assert f"<script>alert({number})" not in page
    assert "\\href" not in page
    assert "onerror" not in page
    assert "<svg onload=" not in page
    assert "<strong>bold</strong>" in page


def test_links_are_not_followed(forked):
    graded(forked, "owner", handed_in())
    folder = place(forked, "submitted", "borrower", NAME).parent
    folder.parent.mkdir()
    folder.symlink_to(place(forked, "submitted", "owner", NAME).parent)
    result = grade_one(forked, NAME, "borrower", SETTINGS)
    assert result.score == 0
    assert "a link" in result.note


def test_a_name_that_nbgrader_takes_for_a_pattern_reaches_nobody_else(forked):
    before = graded(forked, "neighbour", handed_in())
    for name in ("*", "neighbou[r]"):
        result = graded(forked, name, handed_in({}))
        assert "rename the folder" in result.note
    assert grade_one(forked, NAME, "neighbour", SETTINGS) == before
