"""Test cells of all exercises: each is one function that relies on the setup, the answers and its own names alone.

So students may call helpers and scratch variables whatever they like, and a grader may run answers in another process.
"""

import ast
import builtins
import functools
import symtable

import pytest
from nbformat import NotebookNode
from nbgrader.utils import is_grade, is_locked, is_solution

from semgrid_edu.workshop.course.nbgrader.build import exercise_sources
from semgrid_edu.workshop.course.notebooks.build import read_percent

EXERCISES = exercise_sources()


@functools.cache
def code_cells(source) -> list[NotebookNode]:
    return [cell for cell in read_percent(source).cells if cell.cell_type == "code"]


def name_of(cell: NotebookNode) -> str:
    return cell.metadata.nbgrader.grade_id


def defined(code: str) -> set[str]:
    """The names that a cell leaves behind."""
    return {symbol.get_name() for symbol in symtable.symtable(code, "cell", "exec").get_symbols() if bound(symbol)}


def bound(symbol: symtable.Symbol) -> bool:
    return symbol.is_assigned() or symbol.is_imported()


def relied_on(code: str) -> set[str]:
    """The names that a cell takes from elsewhere, builtins left out."""
    cell = symtable.symtable(code, "cell", "exec")
    names, tables = set(), [cell]
    while tables:
        table = tables.pop()
        tables += table.get_children()
        names |= {s.get_name() for s in table.get_symbols() if s.is_global() or (table is cell and s.is_referenced())}
    return names - defined(code) - set(dir(builtins))


def setup(source) -> NotebookNode:
    return next(cell for cell in code_cells(source) if name_of(cell) == "setup")


@functools.cache
def answers(source) -> set[str]:
    return set().union(*(defined(cell.source) for cell in code_cells(source) if is_solution(cell)))


def fixtures(source) -> list[NotebookNode]:
    """Locked cells that are neither the setup nor a test."""
    return [c for c in code_cells(source) if is_locked(c) and not is_grade(c) and name_of(c) != "setup"]


def checks(source) -> list[NotebookNode]:
    return [cell for cell in code_cells(source) if is_grade(cell) and not is_solution(cell)]


def offenders(cells, fault) -> list[str]:
    """The cells of all exercises in which something is wrong, and what."""
    found = [(source, cell, fault(source, cell)) for source in EXERCISES for cell in cells(source)]
    return [f"{source.stem}, {name_of(cell)}: {wrong}" for source, cell, wrong in found if wrong]


def test_each_test_cell_is_one_function_and_its_call():
    def fault(source, cell):
        body = ast.parse(cell.source).body
        names = [getattr(body[0], "name", None), ast.unparse(body[-1])]
        return len(body) != 2 or not isinstance(body[0], ast.FunctionDef) or names != ["_test", "_test()"]

    assert offenders(checks, fault) == []


def fixed(source) -> set[str]:
    """The names of locked cells; those without an underscore are given to the student, in view above the task."""
    return {name for cell in fixtures(source) for name in defined(cell.source)}


def needed(source) -> set[str]:
    """What the reference answers take from elsewhere."""
    return set().union(*(relied_on(cell.source) for cell in code_cells(source) if is_solution(cell)))


def test_tests_rely_on_nothing_that_a_student_may_overwrite():
    def fault(source, cell):
        return relied_on(cell.source) - defined(setup(source).source) - answers(source) - fixed(source)

    def by_chance(source, cell):
        given = {name for name in fixed(source) if not name.startswith("_")}
        return relied_on(cell.source) & given - needed(source)

    assert offenders(lambda source: [*checks(source), *fixtures(source)], fault) == []
    assert offenders(checks, by_chance) == []


def test_tests_change_no_name_outside():
    def fault(source, cell):
        nodes = ast.walk(ast.parse(cell.source))
        return [ast.unparse(node) for node in nodes if isinstance(node, ast.Global | ast.Nonlocal)]

    assert offenders(checks, fault) == []


def test_tests_look_at_results_of_answers_and_never_into_them():
    def fault(source, cell):
        nodes = list(ast.walk(ast.parse(cell.source)))
        inside = {ast.unparse(n.value) for n in nodes if isinstance(n, ast.Attribute)} & answers(source)
        return inside | ({"inspect", "tracemalloc"} & {n.id for n in nodes if isinstance(n, ast.Name)})

    assert offenders(checks, fault) == []


def test_solutions_use_nothing_of_the_tests():
    def fault(source, cell):
        offered = {name for name in defined(setup(source).source) | fixed(source) if not name.startswith("_")}
        return relied_on(cell.source) - offered - answers(source)

    assert offenders(lambda source: filter(is_solution, code_cells(source)), fault) == []


def test_helpers_that_only_tests_use_are_private():
    def fault(source, cell):
        used = set().union(*(relied_on(cell.source) for cell in code_cells(source) if is_solution(cell)))
        text = "\n".join(cell.source for cell in read_percent(source).cells if cell.cell_type == "markdown")
        helpers = [node.name for node in ast.parse(cell.source).body if isinstance(node, ast.FunctionDef)]
        return [h for h in helpers if not h.startswith("_") and h not in used and f"`{h}" not in text]

    assert offenders(lambda source: [setup(source)], fault) == []


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("def _test():\n    got = twice(np.pi)\n    assert got == 2 * before\n\n\n_test()", {"twice", "np", "before"}),
        ("def _test():\n    from tiny import pi\n    scale = 2\n    return [scale * pi for _ in range(3)]", set()),
        ("def _test():\n    def inner():\n        return hidden\n    return inner()", {"hidden"}),
        ("scale = 2\nprint(scale * before)", {"before"}),
    ],
)
def test_names_that_a_cell_takes_from_elsewhere_are_found(code, names):
    assert relied_on(code) == names
