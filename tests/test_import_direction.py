"""Imports run one way: down the README's map of the house, which names every module."""

import ast
import re
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import semgrid_edu

PACKAGE = Path(semgrid_edu.__file__).parent
README = PACKAGE.parent / "README.md"
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path.name != "__init__.py")


def dotted(path: Path) -> str:
    """A module's name inside the package, such as crf.params."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts)


def house() -> list[str]:
    """The rooms in the order of the map's first column; a room may be part of one that stands higher up."""
    rows = re.findall(r"^\| (`.*?) \|", README.read_text(encoding="utf-8"), flags=re.MULTILINE)
    names = [name for row in rows for name in re.findall(r"`([\w/]+?)(?:\.py|/)`", row)]
    return [name.replace("/", ".") for name in names]


def room_of(module: str) -> str:
    """The innermost room of the map that a module lies in."""
    return max((room for room in house() if f"{module}.".startswith(f"{room}.")), key=len, default="")


def imported(path: Path) -> set[str]:
    """What a module imports of the package: modules and packages, by their names inside it."""
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


def test_the_map_names_every_module_once():
    there = {path.stem for path in PACKAGE.glob("*.py")} | {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    rooms = house()
    assert sorted(room for room in rooms if "." not in room) == sorted(there - {"__init__"})
    assert all(is_module(f"semgrid_edu.{room}") for room in rooms)
    assert len(set(rooms)) == len(rooms)


@pytest.mark.parametrize("room", house())
def test_a_room_imports_only_from_what_stands_above_it(room):
    order = house()
    above = {*order[: order.index(room)], room}
    files = [path for path in PACKAGE.rglob("*.py") if room_of(dotted(path).removesuffix(".__init__")) == room]
    below = {dotted(path): {name for name in imported(path) if room_of(name) not in above} for path in files}
    assert files
    assert {module: names for module, names in below.items() if names} == {}


def test_no_module_imports_in_a_circle():
    modules = {dotted(path): path for path in MODULES}
    graph = {module: imported(path) & modules.keys() for module, path in modules.items()}
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the circle
