"""A hash of the code behind a result: when it changes, the result that was kept is stale."""

import ast
import hashlib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
"""The folder that holds the package."""


def code_hash(modules: Iterable[Path], root: Path = ROOT) -> str:
    """Hash the code of modules and of all that they import from the package, without comments and docstrings.

    Parameters
    ----------
    modules : iterable of Path
        The files of the modules that make the result.
    root : Path
        The folder that holds the package.

    Returns
    -------
    str
        SHA-256, hexadecimal. It differs under a version of Python that prints syntax trees differently.
    """
    return hashlib.sha256("\n".join(sorted(import_closure(modules, root).values())).encode()).hexdigest()


def import_closure(modules: Iterable[Path], root: Path = ROOT) -> dict[Path, str]:
    """Follow the import statements of modules, and of what they import, through the package.

    A name that a package passes on in its `__init__.py` leads to the module that defines it, so that one function of
    `semgrid_edu.occupancy` doesn't bring all of its modules. Imports of other packages aren't followed.

    Parameters
    ----------
    modules : iterable of Path
        The files to begin with; they may lie outside of the package.
    root : Path
        The folder that holds the package.

    Returns
    -------
    dict of Path to str
        The syntax trees of these modules and of all that they lead to, printed without docstrings.
    """
    trees: dict[Path, str] = {}
    waiting = list(modules)
    while waiting:
        path = waiting.pop()
        if path not in trees:
            trees[path], imports = _tree_and_imports(path.read_text(encoding="utf-8"))
            waiting += filter(None, (_origin(module, name, root) for module, name, _ in imports))
    return trees


@cache  # by the text: whatever changes in a file is seen, and what doesn't is parsed once
def _tree_and_imports(text: str) -> tuple[str, list[tuple[str, str, str]]]:
    """Return a module's syntax tree, printed, and from where it imports which names, and what it calls them."""
    tree, imports = _without_docstrings(ast.parse(text)), []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imports += [(*alias.name.rpartition(".")[::2], "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            imports += [(node.module, alias.name, alias.asname or alias.name) for alias in node.names]
    return ast.dump(tree), imports


def _origin(module: str, name: str, root: Path) -> Path | None:
    """Return the file that defines a name which is imported from a module; None outside of the package."""
    place = root.joinpath(*module.split("."))
    init = place / "__init__.py"
    for path in (place / f"{name}.py", place / name / "__init__.py", place.with_suffix(".py")):
        if path.is_file():
            return path
    if not init.is_file():
        return None
    imports = _tree_and_imports(init.read_text(encoding="utf-8"))[1]
    passed_from = next((module for module, _, called in imports if called == name), None)
    return _origin(passed_from, name, root) if passed_from else init


def _without_docstrings(tree: ast.Module) -> ast.Module:
    """Drop every string that stands alone, which is how constants are described as well."""
    for node in ast.walk(tree):
        for field in ("body", "orelse", "finalbody"):
            if isinstance(statements := getattr(node, field, None), list):
                setattr(node, field, [one for one in statements if not _is_docstring(one)])
    return tree


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
