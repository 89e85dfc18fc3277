"""Everything that the register names exists, and its code says which equation or section it is."""

import inspect
import re
import sys

from nbgrader_scores import tasks
from worlds.lecture_00_equations import EQUATIONS, equation_table, find_code

from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent


def names_equation(text, number):
    """Whether a text says "equation (2)", "eq. (2)" or "equations (1), (2)"."""
    return re.search(rf"(?i)\beq(s?\.|uations?)\s+(\(\d\)(,|\s+and)?\s+)*\({number}\)", text)


def names_section(text, section):
    """Whether a text says "section 3.2" or "sections 3.1 and 3.2"."""
    return re.search(rf"(?i)\bsec(s?\.|tions?)\s+([\d.]+(,|\s+and)?\s+)*{re.escape(section)}(?![.\d]*\d)", text)


def test_code_names_its_equation():
    functions = [(entry, name) for entry in EQUATIONS for name in (entry.literal, entry.fast) if name]
    functions = [(entry, name) for entry, name in functions if not name.startswith("semgrid_edu.fast.")]
    assert [name for entry, name in functions if not says_where(entry, name)] == []


def test_a_fast_twin_has_the_name_of_the_books_code():
    twins = [entry for entry in EQUATIONS if entry.fast and entry.fast.startswith("semgrid_edu.fast.")]
    assert all(callable(find_code(entry.fast)) for entry in twins)
    in_the_book = [f"{e.literal.rpartition('.')[0]}.{e.fast.rpartition('.')[2]}" for e in twins]
    assert all(callable(find_code(name)) for name in in_the_book)


def says_where(entry, name):
    """Whether the code of an entry names its equation or section."""
    code = find_code(name)
    docstring = inspect.getdoc(code) or ""
    if entry.id.startswith("eq-"):
        return names_equation(docstring, entry.id.removeprefix("eq-"))
    text = docstring + "\n" + sys.modules[code.__module__].__doc__.splitlines()[0]
    numbers = [e.id.removeprefix("eq-") for e in EQUATIONS if e.section == entry.section and e.id.startswith("eq-")]
    return names_section(text, entry.section) or any(names_equation(text, number) for number in numbers)


def test_each_lecture_has_the_tagged_cell():
    assert [entry.id for entry in EQUATIONS if entry.lecture and not has_cell(entry.lecture)] == []


def has_cell(place):
    name, _, tag = place.partition("#")
    cells = read_percent(NOTEBOOKS / "src" / f"{name}.py").cells
    return any(tag in cell.metadata.get("tags", []) for cell in cells)


def test_each_exercise_has_the_task():
    places = [entry.exercise.split("#") for entry in EQUATIONS if entry.exercise]
    assert [at for at in places if at[1] not in tasks(NOTEBOOKS / "src" / "exercises" / f"{at[0]}.py")] == []


def test_every_numbered_equation_is_registered_once():
    ids = [entry.id for entry in EQUATIONS]
    assert len(set(ids)) == len(ids)
    assert {"eq-1", "eq-2", "eq-3", "eq-4"} <= set(ids)
    assert {f"cmcdot-{step}" for step in range(1, 5)} <= set(ids)


def test_table_has_a_row_for_each_and_says_what_is_to_come():
    header, _, *rows = equation_table().splitlines()
    assert len(rows) == len(EQUATIONS)
    assert {row.count("|") for row in rows} == {header.count("|")}
    for entry, row in zip(EQUATIONS, rows, strict=True):
        assert ("to come" in row) == (entry.lecture is None or entry.exercise is None)
