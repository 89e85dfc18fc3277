"""What runs in the student's own JupyterLab keeps its points; a task that doesn't run costs its own points alone."""

import copy

import pytest
import tries
from class_of import NAME, REFERENCE, SOURCE, cell_of, graded, handed_in, inside
from nbformat.v4 import new_code_cell
from nbgrader.api import Gradebook
from warm import grade_notebook

from semgrid_edu.workshop.course.nbgrader.autograde import GradeSettings, place
from semgrid_edu.workshop.course.nbgrader.build import course_api

NOISE = {  # the strict one last, because it changes how the others would end
    "tqdm": "from tqdm import tqdm; list(tqdm(range(3)))",
    "logging": "import logging; logging.warning('far')",
    "stderr": "import sys; print('far', file=sys.stderr)",
    "warnings": "import warnings; warnings.simplefilter('always'); warnings.warn('far')",
    "numpy-prints": "np.seterr(all='print'); np.array([1.0]) / 0",
    "font": "import matplotlib.pyplot as plt; plt.title('a', family='no such font'); plt.show()",
    "output": "print('x' * 100_000)",
    "not-text": "print(chr(0xD800))",
    "shell": "get_ipython().system('echo 1')",
    "thread": "import threading, time; threading.Thread(target=time.sleep, args=(9,)).start()",
    "table": "from IPython.display import HTML, display; [display(HTML('<td>' * 10**6)) for _ in range(9)]",
    "strict": "import warnings; warnings.simplefilter('error'); np.seterr(all='raise')",
}


def test_what_is_said_beside_costs_nothing(forked):
    noisy = handed_in(inside("locate", "\n    ".join(NOISE.values())))
    assert graded(forked, "noisy", noisy, GradeSettings(timeout=60)).score == 13


HALVES = r"""
import numpy as np
from IPython.display import display
display({"text/plain": "half of a pair: \ud800"}, raw=True)
"""


def test_a_text_that_no_file_can_hold_costs_its_task_alone(forked):
    answers = inside("predict", r"return np.array(['\ud800'])")
    assert graded(forked, "halves", handed_in(answers, first=HALVES)).score == 10


def twin(cell):
    return new_code_cell(cell.source, metadata=copy.deepcopy(cell.metadata))


def split(notebook):
    k = cell_of(notebook, "transition")
    first, second = notebook.cells[k].source.split("\n\n\n")
    notebook.cells.insert(k + 1, twin(notebook.cells[k]))
    notebook.cells[k].source, notebook.cells[k + 1].source = first, second


def duplicate(notebook):
    k = cell_of(notebook, "follow")
    notebook.cells.insert(k, twin(notebook.cells[k]))


def delete_setup(notebook):
    del notebook.cells[cell_of(notebook, "setup")]


def import_in_setup(notebook):
    notebook.cells[cell_of(notebook, "setup")].source += "\nfrom math import log as natural"
    cell = notebook.cells[cell_of(notebook, "transition")]
    cell.source = cell.source.replace("np.log(0.5)", "natural(0.5)")


def delete_a_test(notebook):
    del notebook.cells[cell_of(notebook, "predict-wall-test")]


def change_a_test(notebook):
    notebook.cells[cell_of(notebook, "predict-test")].source = "pass"


def scratch(notebook):
    code = "before = got = belief = slips = moved = 'mine'\ndef explain(*_): raise ValueError"
    notebook.cells.insert(cell_of(notebook, "locate-test") + 1, new_code_cell(code))


def forget_everything_nbgrader_wrote(notebook):
    for cell in notebook.cells:
        if cell.metadata.get("nbgrader", {}).get("grade_id") == "locate":
            cell.metadata.nbgrader.update(points="many", grade="?", schema_version=1)


@pytest.mark.parametrize("first", [delete_setup, import_in_setup])
def test_a_changed_notebook_keeps_its_points(forked, first):
    notebook = handed_in()
    for change in (first, split, duplicate, delete_a_test, change_a_test, scratch, forget_everything_nbgrader_wrote):
        change(notebook)
    assert graded(forked, first.__name__, notebook).score == 13


def test_helpers_may_have_any_name(start):
    names = ["weights", "read", "loss", "gradient", "field", "before", "got", "slips", "moved", "row", "before", "test"]
    helpers = "\n".join(f"def {name}(x): return x" for name in names)
    uses = "x = " + "(".join(names) + "(1" + ")" * len(names)
    answers = {name: f"{helpers}\n{code}\n{uses}" for name, code in inside("follow", uses).items()}
    assert lost(grade_notebook(SOURCE, handed_in(answers), start, 60)) == {}


def lost(cells):
    """The messages of cells that cost points, but for the written answer, which nobody gives here."""
    coded = {name: cell for name, cell in cells.items() if name != "parked"}
    return {name: cell.message for name, cell in coded.items() if cell.score not in (cell.points, None)}


def test_cells_that_students_write_beside_cost_nothing(start):
    notebook = handed_in()
    place = cell_of(notebook, "setup") + 1
    notebook.cells[place:place] = [new_code_cell(code, id=f"c{k}") for k, code in enumerate(tries.UNUSUAL)]
    cells = grade_notebook(SOURCE, notebook, start, 60)
    assert lost(cells) == {}


def test_a_deleted_task_costs_its_points_alone(forked):
    notebook = handed_in()
    for name in ("predict", "predict-test", "predict-wall-test"):
        del notebook.cells[cell_of(notebook, name)]
    assert graded(forked, "deleted", notebook).score == 10


def test_who_crashed_gets_feedback_and_the_written_answer_is_read(forked):
    answers = dict.fromkeys(REFERENCE, "import os\nos._exit(0)") | {"parked": "It stays occupied."}
    result = graded(forked, "all-crash", handed_in(answers))
    assert (result.score, result.to_read) == (0, 1)
    with course_api(forked) as api:
        assert api.generate_feedback(NAME, "all-crash")["success"]
    page = place(forked, "feedback", "all-crash", NAME).with_suffix(".html").read_text()
    assert "Python itself ended here" in page
    with Gradebook(f"sqlite:///{forked / 'gradebook.db'}") as gradebook:
        comments = gradebook.find_submission_notebook(NAME, NAME, "all-crash").comments
        said = {comment.name: comment.auto_comment for comment in comments}
    assert said["locate"].startswith("Crashed: ")
