"""Imports run one way: down the README's map of the house, which names every module."""

import ast
import re
from pathlib import Path

import pytest

import semgrid_edu

PACKAGE = Path(semgrid_edu.__file__).parent
README = PACKAGE.parent / "README.md"


def house() -> list[str]:
    """The modules and folders of the package in the order of the map's first column."""
    rows = re.findall(r"^\| (`.*?) \|", README.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return [name for row in rows for name in re.findall(r"`(\w+)(?:\.py|/)`", row)]


def imported(path: Path) -> set[str]:
    """What a module imports of the package, by the names of the map."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    names = [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    names += [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return {name.split(".")[1] for name in names if name.startswith("semgrid_edu.")}


def test_the_map_names_every_module_once():
    there = {path.stem for path in PACKAGE.glob("*.py")} | {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert sorted(house()) == sorted(there - {"__init__"})


@pytest.mark.parametrize("name", house())
def test_a_module_imports_only_from_what_stands_above_it(name):
    order = house()
    files = [PACKAGE / f"{name}.py"] if (PACKAGE / f"{name}.py").is_file() else (PACKAGE / name).glob("*.py")
    above = {*order[: order.index(name)], name}
    assert {path.name: imported(path) - above for path in files if imported(path) - above} == {}
