"""Provenance: how a result was made, a hash of the code behind it, and checksums."""

import ast
import hashlib
import platform
import subprocess
from collections.abc import Iterable
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import sha256, write_json
from semgrid_edu.storage.reading import read_json

ROOT = Path(__file__).parents[2]
"""The folder that contains the package, by the path that Python imports it from."""

PROVENANCE = "provenance.json"
"""Name of the file in a folder of results that records how they were made."""


def versions(*packages: str) -> dict[str, str]:
    """Return the versions of Python, semgrid_edu and other packages.

    Parameters
    ----------
    *packages : str
        Names of the other packages.

    Returns
    -------
    dict of str to str
        The version of each by its name.

    Examples
    --------
    >>> sorted(versions("numpy"))
    ['numpy', 'python', 'semgrid_edu']
    """
    return {"python": platform.python_version()} | {name: version(name) for name in ("semgrid_edu", *packages)}


def made_by(command: str, *packages: str) -> dict[str, object]:
    """Return how a result was made: the command that reproduces it, today's date, and versions.

    Parameters
    ----------
    command : str
        The command line.
    *packages : str
        Names of the packages whose versions matter, see `versions`.

    Returns
    -------
    dict
        "command", "date" (UTC) and "versions".
    """
    return {"command": command, "date": f"{datetime.now(UTC):%Y-%m-%d}", "versions": versions(*packages)}


def commit() -> str | None:
    """Return the commit of the package's source tree, with "+" after it when files were changed since.

    Returns
    -------
    str or None
        None when the package isn't in a git checkout.
    """
    git = ["git", "-C", str(Path(__file__).parent)]
    try:
        head, changes = (
            subprocess.run([*git, *command], capture_output=True, text=True, check=True).stdout.strip()
            for command in (["rev-parse", "--short=12", "HEAD"], ["status", "--porcelain", "--untracked-files=no"])
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return head + ("+" if changes else "")


def write_provenance(folder: str | Path, command: str, seed: int, packages: tuple[str, ...], **details: object) -> None:
    """Record how the files of a folder were made, as its `provenance.json`.

    Parameters
    ----------
    folder : path-like
        The folder. All files below it are recorded with their SHA-256, except files in `cache/`, which can be
        recomputed, and hidden files and folders, which a killed writer may leave.
    command : str
        The command that made the files.
    seed : int
        The command's seed.
    packages : tuple of str
        Names of the packages whose versions can change the result.
    **details
        Further facts for a reader, such as a date, a duration or scores: anything that JSON can hold.
    """
    folder = Path(folder)
    record = {"command": command, "seed": seed, "versions": versions(*packages), **details}
    write_json(folder / PROVENANCE, record | {"sha256": _checksums(folder)})


def provenance_problems(folder: str | Path) -> list[str]:
    """Compare the files of a folder with its `provenance.json`.

    Parameters
    ----------
    folder : path-like
        A folder with a `provenance.json`.

    Returns
    -------
    list of str
        One line for each file that is missing, changed or not recorded.
    """
    folder = Path(folder)
    record = folder / PROVENANCE
    expected = read_json(record).get("sha256")
    if not isinstance(expected, dict):
        raise DataError(record, "a provenance file with checksums by file name", repr(expected)[:200])
    found = _checksums(folder)
    changed = sorted(name for name in expected.keys() | found.keys() if expected.get(name) != found.get(name))
    how = {name: "changed" if name in expected else f"not in {PROVENANCE}" for name in found}
    return [f"{folder / name}: {how.get(name, 'missing')}" for name in changed]


def _checksums(folder: Path) -> dict[str, str]:
    files = {path.relative_to(folder): path for path in sorted(folder.rglob("*")) if path.is_file()}
    left_out = (PROVENANCE, "cache")
    return {
        name.as_posix(): sha256(path)
        for name, path in files.items()
        if name.parts[0] not in left_out and not any(part.startswith(".") for part in name.parts)
    }


def code_hash(modules: Iterable[Path], root: Path = ROOT) -> str:
    """Hash the code of modules and of everything that they import from the package, without comments and docstrings.

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

    A name re-exported by an `__init__.py` leads to the module that defines it, so that importing one function of
    `semgrid_edu.occupancy` doesn't include all of its modules. Imports of other packages aren't followed.

    Parameters
    ----------
    modules : iterable of Path
        The files to start from; they may be outside the package.
    root : Path
        The folder that holds the package.

    Returns
    -------
    dict of Path to str
        The syntax trees of these modules and of all that they import, printed without docstrings.
    """
    trees: dict[Path, str] = {}
    waiting = list(modules)
    while waiting:
        path = waiting.pop()
        if path not in trees:
            trees[path], imports = _tree_and_imports(path.read_text(encoding="utf-8"))
            waiting += filter(None, (_origin(module, name, root) for module, name, _ in imports))
    return trees


@cache  # keyed by the text: a changed file is parsed again, an unchanged one only once
def _tree_and_imports(text: str) -> tuple[str, list[tuple[str, str, str]]]:
    """Return a module's syntax tree, printed, and its imports: module, name and local name."""
    tree = _without_docstrings(ast.parse(text))
    imports = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imports += [(*alias.name.rpartition(".")[::2], "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            imports += [(node.module, alias.name, alias.asname or alias.name) for alias in node.names]
    return ast.dump(tree), imports


def _origin(module: str, name: str, root: Path) -> Path | None:
    """Return the file that defines a name imported from a module; None outside the package."""
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
    """Drop every statement that is only a string: docstrings, and descriptions of constants."""
    for node in ast.walk(tree):
        for field in ("body", "orelse", "finalbody"):
            if isinstance(statements := getattr(node, field, None), list):
                setattr(node, field, [one for one in statements if not _is_docstring(one)])
    return tree


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
