"""Checks of every committed notebook: up to date, executed without warnings, small, and free of paths of a machine.

Each function returns one sentence per problem, with the name of the notebook or cell; nothing when all is well.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import nbformat
from nbformat import NotebookNode
from nbgrader.utils import is_grade

from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.course.nbgrader.build import exercise_sources, student_version
from semgrid_edu.workshop.course.notebooks.build import (
    NOTEBOOKS,
    built_path,
    companion_sources,
    lecture_sources,
    notebook_name,
    read_percent,
)
from semgrid_edu.workshop.course.notebooks.rules import COMPANION_RULES, LECTURE_RULES

MAX_LINES = 25
"""Largest number of lines of a code cell, so that a student can take it in at a glance."""

MAX_TEST_LINES = 32
"""Largest number of lines of an exercise's test cell: its function, and a hint for each of many mistakes."""

MAX_BYTES = 2_000_000
"""Largest size of a lecture or companion, bytes: it has room for figures and one or two animations."""

MAX_BYTES_TOGETHER = 16_000_000
"""Largest size of all notebooks together, bytes, so that the project is quick to clone."""

_PARTS = table_beside(__file__)
LECTURE_PARTS, COMPANION_PARTS = (_PARTS["common"] | _PARTS[kind] for kind in ("lecture", "companion"))
"""The parts of a lecture and of a companion, and how each is recognised in its source."""

MACHINE = re.compile(r"(?<![\w.:/<])(?:/(?:home|root|tmp|work|usr|opt|mnt|srv|private|Users)/|[A-Z]:\\\\)\S*")
ADDRESS = re.compile(r"\bat 0x[0-9a-f]{6,}\b")
BARE = re.compile(r"(allclose|isclose|almost_equal|approx_equal)\(")
QUOTES = re.compile(r"""(?<!["\w])f"[^"]* """)
LINK = re.compile(r"\]\((?!https?:|#|mailto:)([^)#\s]+)[^)]*\)")


def lecture_problems(source: Path) -> list[str]:
    """List everything that is wrong with a lecture.

    Parameters
    ----------
    source : Path
        The source, `notebooks/src/NN_name.py`. The executed notebook is looked for where `built_path` puts it.
    """
    return [f"{built_path(source).name}: {problem}" for problem in _problems(source, LECTURE_PARTS, LECTURE_RULES)]


def companion_problems(source: Path) -> list[str]:
    """List everything that is wrong with a companion.

    Parameters
    ----------
    source : Path
        The source, `notebooks/src/deeper/NAME.py`. The executed notebook is looked for where `built_path` puts it.
    """
    name = f"{notebook_name(source)}.ipynb"
    problems = [*_problems(source, COMPANION_PARTS, COMPANION_RULES)]
    if not any(f"]({name})" in lecture.read_text(encoding="utf-8") for lecture in source.parents[1].glob("*.py")):
        problems.append(f"no lecture links to it; write ]({name}) where it helps")
    return [f"{name}: {problem}" for problem in problems]


def exercise_problems(source: Path) -> list[str]:
    """List everything that is wrong with the student version of an exercise.

    Parameters
    ----------
    source : Path
        The source, `notebooks/src/exercises/NAME.py`.
    """
    path = built_path(source)
    if not path.is_file():
        return [f"exercises/{path.name}: not built; run `semgrid-edu course notebooks`"]
    notebook = nbformat.read(path, as_version=4)
    problems = [*text_problems(notebook, path.parent)]
    if notebook != student_version(source):
        problems.append(f"differs from src/exercises/{source.name}; run `semgrid-edu course notebooks {source.stem}`")
    return [f"exercises/{path.name}: {problem}" for problem in problems]


def instructor_problems(folder: Path) -> list[str]:
    """List the lines of hidden tests that numpy's `allclose` lets pass with an empty array, or that quote values.

    A sentence that quotes a result may quote an input, since an answer can return one.

    Parameters
    ----------
    folder : Path
        The folder of the instructor's modules, `notebooks/instructor/semgrid_instructor`; its `close` may use it.
    """
    rules = {
        BARE: "compare by `close` of semgrid_instructor, which demands equal shapes that aren't empty",
        QUOTES: "a sentence of a hidden test quotes no values",
    }
    return [
        f"instructor/{path.name}: `{line.strip()}`: {remedy}"
        for path in sorted(folder.glob("[!_]*.py"))
        for line in path.read_text("utf-8").splitlines()
        for rule, remedy in rules.items()
        if rule.search(line)
    ]


def course_problems(folder: Path = NOTEBOOKS) -> list[str]:
    """List everything that is wrong with the lectures, companions, exercises and hidden tests in a folder of notebooks.

    Parameters
    ----------
    folder : Path
        The folder of notebooks, with their sources in `src`.

    Raises
    ------
    DataError
        When the folder holds no lectures.
    """
    problems = [problem for source in lecture_sources(folder) for problem in lecture_problems(source)]
    problems += [problem for source in companion_sources(folder) for problem in companion_problems(source)]
    problems += [problem for source in exercise_sources(folder) for problem in exercise_problems(source)]
    problems += instructor_problems(folder / "instructor" / "semgrid_instructor")
    together = sum(path.stat().st_size for path in folder.rglob("*.ipynb"))
    if together > MAX_BYTES_TOGETHER:
        problems.append(f"all notebooks together: {together / 1e6:.1f} MB, more than {MAX_BYTES_TOGETHER / 1e6:.0f} MB")
    return problems


def text_problems(notebook: NotebookNode, folder: Path) -> Iterator[str]:
    """List long cells, paths of a machine and links that lead nowhere.

    Parameters
    ----------
    notebook : NotebookNode
        The notebook, executed or not.
    folder : Path
        The folder of the notebook, to which its links are relative.
    """
    for cell in notebook.cells:
        name = cell.metadata.get("nbgrader", {}).get("grade_id") or cell.source.strip().split("\n")[0][:60]
        lines = len(cell.source.splitlines())
        limit = MAX_TEST_LINES if is_grade(cell) else MAX_LINES
        if cell.cell_type == "code" and lines > limit:
            yield f"cell '{name}' has {lines} lines, more than {limit}"
        for found in MACHINE.findall(cell.source + _printed(cell)):
            yield f"cell '{name}' names a path of one machine: {found}"
        for target in LINK.findall(_shown(cell)):
            if not (folder / target).exists():
                yield f"cell '{name}' links to {target}, which does not exist"


def _problems(source: Path, parts: dict[str, str], rules: Iterable[Callable]) -> Iterator[str]:
    """List what is wrong with a lecture or a companion; they differ in the parts they need and the rules they keep."""
    wanted = read_percent(source)
    path = built_path(source)
    name = notebook_name(source)
    text = "\n\n".join(cell.source for cell in wanted.cells)
    yield from (f"lacks {part}" for part, pattern in parts.items() if not re.search(pattern, text, re.MULTILINE))
    if not path.is_file():
        yield "not built; run `semgrid-edu course notebooks`"
        return
    notebook = nbformat.read(path, as_version=4)
    if _inputs(notebook) != _inputs(wanted):
        yield f"differs from src/{name}.py; run `semgrid-edu course notebooks {source.stem}`"
    if path.stat().st_size > MAX_BYTES:
        yield f"{path.stat().st_size / 1e6:.1f} MB, more than {MAX_BYTES / 1e6} MB"
    for number, cell in enumerate((c for c in notebook.cells if c.cell_type == "code"), start=1):
        yield from (f"code cell {number} {problem}" for problem in _run_problems(cell, number))
    yield from text_problems(notebook, path.parent)
    yield from (problem for rule in rules for problem in rule(notebook))


def _run_problems(cell: NotebookNode, number: int) -> Iterator[str]:
    """List the signs that a code cell ran out of order, raised an error or gave a warning."""
    if cell.execution_count != number:
        yield f"has execution count {cell.execution_count}; execute the whole notebook in order"
    for output in cell.outputs:
        if output.output_type == "error":
            yield f"ends in an error: {output.ename}: {output.evalue}"
        if output.output_type == "stream" and output.name == "stderr":
            yield f"writes to stderr: {output.text.strip()[:80]}"
    if ADDRESS.search(_printed(cell)):
        yield "prints the address of an object; end a plot cell with plt.show()"


def _printed(cell: NotebookNode) -> str:
    """Return all text that a cell shows below itself."""
    outputs = cell.get("outputs", [])
    return "".join(output.get("text", "") + output.get("data", {}).get("text/plain", "") for output in outputs)


def _shown(cell: NotebookNode) -> str:
    """Return the Markdown that a cell shows: its own text, or what its code displays."""
    displayed = [output.get("data", {}).get("text/markdown", "") for output in cell.get("outputs", [])]
    return cell.source if cell.cell_type == "markdown" else "\n".join(displayed)


def _inputs(notebook: NotebookNode) -> list[tuple]:
    """Return the parts of a notebook that come from its source: kind, id, text and metadata of every cell."""
    return [(cell.cell_type, cell.id, cell.source, dict(cell.metadata)) for cell in notebook.cells]
