"""The instructor's decorator: whatever a student's function does, one sentence comes back."""

import ast
import copy
import importlib
import re
import sys

import numpy as np
import pytest
from nbgrader.utils import is_grade, is_solution

from semgrid_edu.workshop.course.checks import instructor_problems
from semgrid_edu.workshop.course.nbgrader.build import exercise_sources
from semgrid_edu.workshop.course.nbgrader.preprocessors import use_instructor
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent
from semgrid_edu.workshop.course.sandbox.session import AnswerTimeoutError


@pytest.fixture
def instructor(monkeypatch):
    monkeypatch.syspath_prepend(str(NOTEBOOKS / "instructor"))
    import semgrid_instructor

    yield semgrid_instructor
    del sys.modules["semgrid_instructor"]


@pytest.fixture
def hidden(instructor):
    return instructor.hidden


def answer():
    """Stand for a student's function."""


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (AssertionError("values are wrong"), "values are wrong"),
        (IndexError("7"), "it raises an error"),
        (AnswerTimeoutError("no reply"), "it does not come to an end"),
    ],
)
def test_error_becomes_a_sentence(hidden, error, sentence):
    @hidden
    def check(function):
        raise error

    assert check(answer) == f"answer, on inputs you haven't seen: {sentence}"


def test_an_instructor_who_interrupts_is_no_complaint_about_the_answer(hidden):
    @hidden
    def check(function):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check(answer)


def test_nothing_to_complain_about(hidden):
    assert hidden(lambda function: None)(answer) == ""


def test_every_answer_works_where_it_is_not_seen(hidden):
    class Answer:
        __name__ = "answer"
        unseen = "not seen"

    asked = []
    assert hidden(lambda *answers: asked.extend(answers))(Answer(), Answer()) == ""
    assert asked == ["not seen", "not seen"]


@pytest.mark.parametrize(
    ("got", "wanted", "same"),
    [
        ([0.1, 0.2], [0.1, 0.2 + 1e-8], True),
        (np.float32([0.1, 200.3]), [0.1, 200.3], True),
        ([0.1, 0.2], [0.1, 0.21], False),
        ([1.0, 1.0], 1, True),
        (0.5, np.float64(0.5), True),
        ([0.5], np.float64(0.5), False),
        ([], [], False),
        ([], 1, False),
        (np.empty((0, 1, 1)), np.zeros((3, 4)), False),
        ([[1.0, 1.0]], [1.0, 1.0], False),
        ([np.nan], [np.nan], False),
    ],
)
def test_only_what_has_the_same_shape_and_is_not_empty_is_close(instructor, got, wanted, same):
    assert instructor.close(np.array(got), wanted) == same


@pytest.mark.parametrize(
    ("change", "argument"),
    [(np.ndarray.sort, np.array([2, 1])), (list.clear, [1]), (lambda cell: cell[0].fill(0), (np.ones(2), "text"))],
)
def test_an_argument_that_changes_costs_the_points_where_it_must_not(instructor, change, argument):
    check = instructor.keeping(lambda function: function(argument))
    with pytest.raises(AssertionError, match="it changes an argument"):
        check(change)
    check(len)


def _calls(function):
    return {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}


def test_hidden_inputs_are_drawn_for_each_student_or_the_guide_says_so():
    guide = (NOTEBOOKS / "instructor" / "README.md").read_text(encoding="utf-8")
    for path in (NOTEBOOKS / "instructor" / "semgrid_instructor").glob("*.py"):
        module = ast.parse(path.read_text(encoding="utf-8"))
        calls = {one.name: _calls(one) for one in module.body if isinstance(one, ast.FunctionDef)}
        for _ in calls:  # what a helper calls, its caller calls as well
            calls = {name: found.union(*(calls[one] for one in found & calls.keys())) for name, found in calls.items()}
        same = [name for name, found in calls.items() if name.startswith("check_") and "generator" not in found]
        assert [name for name in same if f"`{name.removeprefix('check_')}`" not in guide] == [], path.name


BY_ITSELF = {
    "01_bayes": ["check_predict_wall"],
    "02_grids": ["check_fuse_many", "check_clamp"],
    "03_bof": ["check_no_mass"],
    "04_cmcdot": ["check_update_limits", "check_track"],
    "05_pixels": ["check_impossible"],
    "07_segmentation": ["check_large"],
    "08_fusion": ["check_large_logits"],
    "10_crf": ["check_update_limits", "check_free_energy_limits"],
}
"""Checks of limits, which compare what an answer says with what it says elsewhere; and one that takes minutes."""


class Replay:
    """An answer that gives back what was right for another student, by the shapes and the order of the inputs."""

    def __init__(self, answer):
        self.answer, self.__name__, self.said, self.replays = answer, answer.__name__, {}, False

    def __call__(self, *arguments, **named):
        said = self.said.setdefault(shapes((arguments, named)), [])
        if self.replays:
            return said.pop(0) if said else 0
        said.append(copy.deepcopy(self.answer(*arguments, **named)))
        return copy.deepcopy(said[-1])


def shapes(value):
    """What code can tell an input by that looks at no number in it, but at counts and texts."""
    if isinstance(value, dict):
        return shapes(list(value.items()))
    if isinstance(value, list | tuple):
        return tuple(map(shapes, value))
    return value if isinstance(value, int | str) else np.shape(value)


@pytest.mark.parametrize("source", exercise_sources(), ids=lambda source: source.stem)
def test_what_was_right_for_another_student_earns_nothing(source):
    names, earned = {"__name__": "__main__"}, []
    for cell in (cell for cell in read_percent(source).cells if cell.cell_type == "code"):
        if is_solution(cell) or not is_grade(cell):
            exec(cell.source, names)
            continue
        (imported,) = re.findall(r"from semgrid_instructor import .*", cell.source)
        ((check, answers),) = re.findall(r"complaint = \w+\.(check_\w+)\((.*)\)", cell.source)
        if check in BY_ITSELF.get(source.stem, []):
            continue
        replays = {name: Replay(names[name]) for name in answers.split(", ")}
        judge = re.search(r"complaint = .*", cell.source)[0]
        use_instructor(NOTEBOOKS / "instructor")
        exec(f"{imported}\n{judge}", right := names | replays)
        assert right["complaint"] == ""
        for one in replays.values():
            one.replays = True
        use_instructor(NOTEBOOKS / "instructor", 1)
        exec(judge, right)
        earned += [] if right["complaint"] else [check]
    use_instructor(NOTEBOOKS / "instructor")
    assert earned == []


def test_two_made_up_answers_that_agree_earn_nothing():
    """Task 4 of exercise 12 forgives what is wrong in task 3, but doesn't take whatever both say."""

    def made_up(*_):
        return 1e-6, 2e-6, 3e-6

    use_instructor(NOTEBOOKS / "instructor")
    from semgrid_instructor import experiments

    assert experiments.check_paired(made_up, made_up) != ""


def second_when_in_doubt(log_g, o):
    """Give unsure cells their second class, whatever the occupancy says."""
    g = np.exp(log_g)
    g[10:] = 0
    best, sure = g.argmax(axis=0)[None], g.max(axis=0)[None]
    np.put_along_axis(g, best, np.where((sure > 0.5) & (sure < 0.78), 1e-6, sure), axis=0)
    return (g + 1e-12) / (g + 1e-12).sum(axis=0)


def prices_from_the_lowest(Q, phi, k, mu):
    """Subtract each cell's lowest price, and stop there."""
    return np.minimum(phi - phi.min(axis=0), 9) + (Q * k[0, 1]).sum()


def mean_price_alone(Q, phi, k, mu):
    """Leave the pairs out, and take the largest probability for entropy."""
    return (Q[Q > 0] * phi[Q > 0]).sum() + Q.max()


def two_reports_exclude_each_other(factor, wanted, heard):
    """Tell what is impossible by the number of reports."""
    if len(heard) == 2:
        raise ValueError
    return [0.3, 0.7]


SOLVES_NOTHING = {
    "real_drive.check_refine": second_when_in_doubt,
    "real_drive.check_better_map": second_when_in_doubt,
    "crf.check_update_limits": prices_from_the_lowest,
    "crf.check_free_energy_limits": mean_price_alone,
    "graphical_models.check_impossible": two_reports_exclude_each_other,
}
"""Answers that know how a hidden test makes its inputs, or what it compares, but not the task."""


@pytest.mark.parametrize("check", SOLVES_NOTHING)
def test_who_knows_the_hidden_test_and_not_the_task_earns_nothing(check):
    use_instructor(NOTEBOOKS / "instructor")
    module, _, name = check.partition(".")
    judge = getattr(importlib.import_module(f"semgrid_instructor.{module}"), name)
    assert judge(SOLVES_NOTHING[check]) != ""


def test_no_answer_can_change_what_a_function_that_it_gets_relies_on():
    """A default of a function within a check is an argument that the answer may give as well."""
    for path in (NOTEBOOKS / "instructor" / "semgrid_instructor").glob("*.py"):
        module = ast.parse(path.read_text(encoding="utf-8"))
        functions = [one for outer in module.body for one in ast.walk(outer) if isinstance(one, ast.FunctionDef)]
        inner = [one for one in functions if one not in module.body]
        assert [one.name for one in inner if one.args.defaults or one.args.kw_defaults] == [], path.name


def test_hidden_tests_compare_by_the_helper_alone(tmp_path):
    assert instructor_problems(NOTEBOOKS / "instructor" / "semgrid_instructor") == []
    for line in (
        "np.allclose(got, 1)",
        "np.isclose(a, b)",
        "np.testing.assert_allclose(a, b)",
        "assert_almost_equal(a, b)",
        'assert right, f"{got.size} numbers"',
        'assert right, f"wrong with {x}"',
    ):
        (tmp_path / "grids.py").write_text(f"x = 1\n    {line}\n")
        (problem,) = instructor_problems(tmp_path)
        assert problem.startswith(f"instructor/grids.py: `{line}`")
