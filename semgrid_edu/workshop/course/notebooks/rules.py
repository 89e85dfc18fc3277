"""Rules that protect the reader of a notebook: honest minutes, no answer in sight, figures that everybody can read."""

import ast
import re
from collections.abc import Callable, Iterator

from nbformat import NotebookNode

from semgrid_edu.plotting import FIGURE_DPI, MAX_ANIMATION_BYTES
from semgrid_edu.workshop.course.notebooks.figures import PNG, alternative_text, figures, moves, png_bytes, resolution
from semgrid_edu.workshop.course.notebooks.minutes import PREDICTION, reading_time, stated_minutes

LIMITS = {"minutes": 80, "words": 3_300, "numerals": 110, "sections": 13}
"""The most that a lecture may have of each; a lecture aims at 75 minutes, 2,800 words, 80 numerals and ten sections."""

MIN_ALT_WORDS = 4
"""An alternative text with fewer words than this doesn't describe a figure."""

HEADING = re.compile(r"^#{1,6} ", re.MULTILINE)


def dishonest_minutes(notebook: NotebookNode) -> Iterator[str]:
    """Report a header that states fewer minutes than `reading_time` computes.

    Parameters
    ----------
    notebook : NotebookNode
        An executed notebook.
    """
    needed = round(reading_time(notebook).minutes)
    stated = stated_minutes(notebook)
    if stated is not None and stated < needed:
        yield f"states {stated} minutes and takes {needed}; `semgrid-edu course minutes NAME` shows where they go"


def too_long(notebook: NotebookNode) -> Iterator[str]:
    """Report a lecture with more minutes, words, numerals or sections than `LIMITS`.

    Parameters
    ----------
    notebook : NotebookNode
        An executed notebook.
    """
    time = reading_time(notebook)
    for what, limit in LIMITS.items():
        needed = round(getattr(time, what))
        if needed > limit:
            yield f"has {needed} {what}, more than {limit}; move what is beside the path to a companion, or delete it"


def answers_in_sight(notebook: NotebookNode) -> Iterator[str]:
    """Report a cell that shows the answer to a prediction before the reader has asked for it.

    The answer is taken to be the first code cell with output below the prediction. If a heading comes before that
    cell, the prediction has only its folded answer.

    Parameters
    ----------
    notebook : NotebookNode
        An executed notebook.
    """
    open_question = False
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            _, asked, after = cell.source.rpartition(PREDICTION)
            open_question = (open_question or bool(asked)) and not HEADING.search(after)
        elif open_question and cell.outputs:
            open_question = False
            if not _collapsed(cell, "outputs_hidden"):
                remedy = 'give it jupyter={"outputs_hidden": true}'
                yield f"cell {_first_line(cell)} shows the answer to a prediction; {remedy}"


def plot_code_in_sight(notebook: NotebookNode) -> Iterator[str]:
    """Report plot code that isn't collapsed: a cell with a figure that defines, asserts and prints nothing.

    Parameters
    ----------
    notebook : NotebookNode
        An executed notebook.
    """
    for cell in notebook.cells:
        if any(figures(cell)) and _only_plots(cell.source) and not _collapsed(cell, "source_hidden"):
            yield f'cell {_first_line(cell)} only plots; give it jupyter={{"source_hidden": true}}'


def missing_alternative_texts(notebook: NotebookNode) -> Iterator[str]:
    """Report a figure whose alternative text is missing or too short to describe it.

    Parameters
    ----------
    notebook : NotebookNode
        An executed notebook.
    """
    for cell, figure in _figures(notebook):
        words = len(alternative_text(cell, figure).split())
        if words < MIN_ALT_WORDS:
            found = f"one of {words} words" if words else "none"
            yield f'the figure of cell {_first_line(cell)} needs an alternative text, alt="...", has {found}'


def coarse_figures(notebook: NotebookNode) -> Iterator[str]:
    """Report figures of fewer dots per inch than `FIGURE_DPI`.

    Parameters
    ----------
    notebook : NotebookNode
        An executed notebook.
    """
    for cell, figure in _figures(notebook):
        dpi = resolution(png_bytes(figure)) if PNG in figure.data else None
        if dpi is not None and dpi < FIGURE_DPI:
            yield f"the figure of cell {_first_line(cell)} has {dpi} dots per inch, not {FIGURE_DPI}"


def unfit_animations(notebook: NotebookNode) -> Iterator[str]:
    """Report animations of more than `MAX_ANIMATION_BYTES`, and kinds of images that only JupyterLab shows.

    Parameters
    ----------
    notebook : NotebookNode
        An executed notebook.
    """
    for cell, figure in _figures(notebook):
        name = _first_line(cell)
        for kind in {"image/gif", "image/webp"} & set(figure.data):
            yield f"cell {name} shows {kind}, which nbconvert leaves out; use plotting.animate"
        if PNG in figure.data and moves(png := png_bytes(figure)) and len(png) > MAX_ANIMATION_BYTES:
            limit = f"{MAX_ANIMATION_BYTES // 1000} kB"
            yield f"the animation of cell {name} has {len(png) // 1000} kB, more than {limit}"


COMPANION_RULES: tuple[Callable[[NotebookNode], Iterator[str]], ...] = (
    dishonest_minutes,
    answers_in_sight,
    plot_code_in_sight,
    missing_alternative_texts,
    coarse_figures,
    unfit_animations,
)
"""The rules for a companion: functions that take an executed notebook and yield one sentence per problem."""

LECTURE_RULES = (*COMPANION_RULES, too_long)
"""The rules for a lecture. A companion may be long, because students choose whether to read it."""


def _figures(notebook: NotebookNode) -> Iterator[tuple[NotebookNode, NotebookNode]]:
    """Yield every figure with the cell that shows it."""
    yield from ((cell, figure) for cell in notebook.cells for figure in figures(cell))


def _collapsed(cell: NotebookNode, what: str) -> bool:
    """Return whether JupyterLab hides a cell's source or its outputs."""
    return cell.metadata.get("jupyter", {}).get(what, False)


def _only_plots(source: str) -> bool:
    """Return whether code neither defines nor asserts nor prints anything; False for magics, which aren't Python."""
    try:
        nodes = list(ast.walk(ast.parse(source)))
    except SyntaxError:
        return False
    calls = [ast.unparse(node.func) for node in nodes if isinstance(node, ast.Call)]
    speaks = any(call == "print" or "assert" in call for call in calls)
    return not speaks and not any(isinstance(n, ast.FunctionDef | ast.ClassDef | ast.Assert) for n in nodes)


def _first_line(cell: NotebookNode) -> str:
    """Name a cell by its first line."""
    return f"'{cell.source.strip().splitlines()[0][:60]}'"
