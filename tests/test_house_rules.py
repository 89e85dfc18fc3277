"""The rules of CONTRIBUTING that a program can check: short modules, described parameters, and names used once."""

import ast
import inspect
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from code_lines import code_lines

import semgrid_edu

PACKAGE = Path(semgrid_edu.__file__).parent
SOURCES = {
    path.relative_to(PACKAGE).as_posix(): path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py"))
}

ENTRY = re.compile(r"(?P<names>\*{0,2}\w+(?:, \*{0,2}\w+)*)( : \S.*)?")
"""The first line of an entry in a numpydoc section, such as `low, high : float`."""

REFERENCE = re.compile(r"\bParameters[\w, ]* are those of `([\w.]+)`")
"""The sentence by which a docstring leaves its parameters to that of a twin or of a base class."""


SHARED_OPTIONS = ("Force", "Resume", "Runs")
"""Options of several commands, which declare their help text once."""


@cache
def tree(module: str) -> ast.Module:
    """A module's syntax: asked for by tests alone, so that a process that only collects them doesn't parse."""
    return ast.parse(SOURCES[module])


def definitions(body: list[ast.stmt], *kinds: type) -> list:
    """The public functions, classes or both that a module or a class defines."""
    nodes = [node for node in body if isinstance(node, kinds or (ast.FunctionDef, ast.ClassDef))]
    return [node for node in nodes if not node.name.startswith("_") and "overload" not in decorators(node)]


def decorators(node: ast.FunctionDef | ast.ClassDef) -> str:
    return " ".join(map(ast.unparse, node.decorator_list))


def documented(module: str) -> Iterator[tuple[str, str, list[str]]]:
    """Every public function, class and method of a module: its name, its docstring and the parameters it takes."""
    for node in definitions(tree(module).body):
        takes = arguments(node) if isinstance(node, ast.FunctionDef) else constructor_arguments(node)
        yield node.name, ast.get_docstring(node) or "", takes
        for method in definitions(node.body, ast.FunctionDef) if isinstance(node, ast.ClassDef) else ():
            first = 0 if "staticmethod" in decorators(method) else 1
            yield f"{node.name}.{method.name}", ast.get_docstring(method) or "", arguments(method)[first:]


def arguments(function: ast.FunctionDef) -> list[str]:
    """The names of a function's arguments, without those that declare a help text for the command line."""
    a = function.args
    every = [*a.posonlyargs, *a.args, *filter(None, [a.vararg]), *a.kwonlyargs, *filter(None, [a.kwarg])]
    annotations = {one.arg: ast.unparse(one.annotation) if one.annotation else "" for one in every}
    return [name for name, one in annotations.items() if "typer." not in one and one not in SHARED_OPTIONS]


def constructor_arguments(node: ast.ClassDef) -> list[str]:
    """What a class is made from: the arguments of `__init__`, or the fields of a dataclass or named tuple."""
    for method in node.body:
        if isinstance(method, ast.FunctionDef) and method.name == "__init__":
            return arguments(method)[1:]
    if "dataclass" not in decorators(node) and "NamedTuple" not in map(ast.unparse, node.bases):
        return []
    fields = [field for field in node.body if isinstance(field, ast.AnnAssign)]
    return [field.target.id for field in fields if not re.search("init=False|ClassVar", ast.unparse(field))]


def described(docstring: str) -> set[str]:
    """The parameters about which a numpydoc docstring says more than name and type."""
    section = re.search(r"^Parameters\n-{10}\n(.*?)(?=^\w[\w ]*\n-{3}|\Z)", inspect.cleandoc(docstring), re.M | re.S)
    names: set[str] = set()
    entry: list[str] = []
    for line in section[1].splitlines() if section else ():
        if opens := ENTRY.fullmatch(line):
            entry = re.findall(r"\w+", opens["names"])
        elif line.strip():
            names.update(entry)
    return names


@cache
def described_by_themselves() -> dict[str, set[str]]:
    """What each public thing of the package describes itself, by "function", "Class" or "Class.method".

    A fast twin may leave its parameters to the book's version, which has the same name.
    """
    known = defaultdict(set)
    for module in SOURCES:
        for name, docstring, _ in documented(module):
            known[name] |= described(docstring)
    return known


def described_elsewhere(docstring: str, known: dict[str, set[str]]) -> set[str]:
    """The parameters that another docstring describes, if this one refers to it by the sentence of `REFERENCE`."""
    named = REFERENCE.search(" ".join(docstring.split()))
    return known.get(named[1], set()) if named else set()


def undescribed(module: str) -> list[str]:
    """What the docstrings of a module leave out, one line per function, class or method."""
    found = [] if ast.get_docstring(tree(module)) else [f"{module} has no docstring"]
    for name, docstring, takes in documented(module):
        known = described(docstring) | described_elsewhere(docstring, described_by_themselves())
        missing = [argument for argument in takes if argument not in known]
        if missing or not docstring:
            found.append(f"{module}: {name} doesn't describe {', '.join(missing) or 'itself'}")
    return found


def test_no_module_has_more_than_250_lines_of_code():
    long = [module for module, source in SOURCES.items() if source.count("\n") > 250]
    lengths = {module: len(code_lines(str(PACKAGE / module))) for module in long}
    assert {module: length for module, length in lengths.items() if length > 250} == {}


def test_every_parameter_has_a_description():
    assert [line for module in SOURCES for line in undescribed(module)] == []


def test_no_two_public_things_share_a_name():
    """But for fast twins, which have the names of the book, and commands, which have the names of what they run."""
    places = defaultdict(set)
    for module in SOURCES:
        if module.startswith(("workshop/commands/", "fast/")):
            continue
        for node in definitions(tree(module).body):
            places[node.name].add(module)
    assert {name: modules for name, modules in places.items() if len(modules) > 1} == {}


def test_no_two_test_files_share_a_name():
    """Pytest imports them by name, and refuses the second."""
    names = [path.name for path in Path(__file__).parent.rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))


def test_the_docstring_reader_knows_a_parameter_without_words():
    docstring = """Add.

    Parameters
    ----------
    a, b : int
        Summands.
    c : int
    **rest
        What else.

    Returns
    -------
    d : int
        Sum.
    """
    assert described(docstring) == {"a", "b", "rest"}


@pytest.mark.parametrize(
    ("docstring", "parameters"),
    [
        ("Fly. Parameters and result are those of `fly`.", {"dt", "rng"}),
        ("Fly.\n\n    Parameters, result and\n    errors are those of `Bird.fly`, without wind.", {"dt"}),
        ("Fly. Parameters are those of `swim`, which nothing describes.", set()),
        ("Fly: the literal twin of `fly`.", set()),
        ("Fly as `fly` does. Parameters of birds. The wings are those of `fly`.", set()),
    ],
)
def test_a_docstring_may_leave_its_parameters_to_one_that_describes_them(docstring, parameters):
    assert described_elsewhere(docstring, {"fly": {"dt", "rng"}, "Bird.fly": {"dt"}}) == parameters
