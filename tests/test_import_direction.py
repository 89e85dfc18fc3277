"""Imports run one way: down the map of docs/house.md, never from the book to `fast` or to the workshop."""

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import semgrid_edu

PACKAGE = Path(semgrid_edu.__file__).parent
MAP = PACKAGE.parent / "docs" / "house.md"
FILES = sorted(PACKAGE.rglob("*.py"))
MODULES = [path for path in FILES if path.name not in ("__init__.py", "__main__.py")]
OPENS_FAST = "stages.stages"
"""The one module of the book that may name `fast`: `Stages.fast` loads it when it is called."""
LOADS_BY_NAME = {"__init__.py", "errors.py"}
"""Modules that load others by name: the table of public names, and what asks for an optional extra."""


def dotted(path: Path) -> str:
    """A module's or folder's name inside the package, such as crf.params or crf."""
    parts = path.relative_to(PACKAGE).parts
    return ".".join(parts).removesuffix(".py").removesuffix("__init__").removesuffix(".")


@cache
def house() -> list[str]:
    """The rooms of the map, in its order: modules of the top, and folders."""
    rows = re.findall(r"^\| (`.*?) \|", MAP.read_text(encoding="utf-8"), flags=re.MULTILINE)
    names = [name for row in rows for name in re.findall(r"`([\w/]+?)(?:\.py|/)`", row)]
    return [name.replace("/", ".") for name in names]


@cache
def room_of(name: str) -> str:
    """The room of the map that a module lies in."""
    return next((room for room in house() if f"{name}.".startswith(f"{room}.")), "")


@cache
def imported(path: Path) -> set[str]:
    """What a module imports of the package, at the top or inside functions: modules and folders, by their names."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    for node in nodes:
        if isinstance(node, ast.ImportFrom):
            inside = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= {name for name in inside if is_module(name)} or {node.module}
    return {name.removeprefix("semgrid_edu.") for name in names if name.startswith("semgrid_edu.")}


def is_module(name: str) -> bool:
    place = PACKAGE.parent.joinpath(*name.split("."))
    return place.with_suffix(".py").is_file() or (place / "__init__.py").is_file()


def storey(name: str) -> str:
    first = name.split(".")[0]
    return {"fast": "fast", "workshop": "workshop", "__main__": "workshop"}.get(first, "book")


def test_the_map_names_every_room_once():
    def rooms_in(folder: Path) -> set[str]:
        inside = [*folder.glob("*.py"), *(init.parent for init in folder.glob("*/__init__.py"))]
        return {dotted(path) for path in inside} - {dotted(folder), "workshop"}

    there = rooms_in(PACKAGE) | rooms_in(PACKAGE / "workshop")
    assert sorted(house()) == sorted(there - {""})


def test_the_book_imports_neither_fast_nor_the_workshop():
    book = [path for path in FILES if storey(dotted(path)) == "book"]
    back = {dotted(path): found for path in book if (found := {n for n in imported(path) if storey(n) != "book"})}
    assert len(book) > 50
    assert back == {OPENS_FAST: {"fast"}}


def test_fast_never_imports_the_workshop():
    fast = [path for path in FILES if storey(dotted(path)) == "fast"]
    assert len(fast) > 3
    assert {n for path in fast for n in imported(path) if storey(n) == "workshop"} == set()


def test_nothing_is_imported_by_name_at_run_time():
    by_name = re.compile(r"\bimport_module\(|\b__import__\(|\bfind_spec\(|(?<![\w.])(exec|eval)\(")
    found = {
        path.relative_to(PACKAGE).as_posix()
        for path in FILES
        if storey(dotted(path)) != "workshop" and by_name.search(path.read_text(encoding="utf-8"))
    }
    assert found == LOADS_BY_NAME


def test_a_room_imports_only_from_what_stands_above_it():
    order = {room: place for place, room in enumerate(house())}
    back = [
        f"{dotted(path)} imports {name}"
        for path in FILES
        for name in sorted(imported(path))
        if order.get(room_of(name), len(order)) > order.get(room_of(dotted(path)), len(order))
        and (dotted(path), name) != (OPENS_FAST, "fast")
    ]
    assert back == []


def test_no_module_imports_in_a_circle():
    modules = {dotted(path): path for path in MODULES}
    graph = {module: imported(path) & modules.keys() for module, path in modules.items()}
    TopologicalSorter(graph).prepare()
