"""How long a student needs for a notebook, computed from its contents, so that its header can be honest."""

import re
from dataclasses import astuple, dataclass
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from semgrid_edu.workshop.course.notebooks.build import built_path, notebook_name, read_percent
from semgrid_edu.workshop.course.notebooks.figures import figures

PREDICTION = "**Predict before you run.**"
"""How every prediction begins."""

STATED = re.compile(r"\*\*Time\.\*\* (\d+) minutes")
"""How a header states its minutes."""

BLOCK_OF_CODE = re.compile(r"^(```|~~~).*?^\1", re.MULTILINE | re.DOTALL)
DISPLAY_EQUATION = re.compile(
    r"\$\$.+?\$\$|\\\[.+?\\\]|\\begin\{(align|equation|gather|multline)\*?\}.+?\\end\{\1\*?\}", re.DOTALL
)
PICTURE = re.compile(r"!\[[^\]]*\]\([^)]*\)|<img\b[^>]*>")
CODE_IN_LINE = re.compile(r"`[^`]+`")
IN_LINE = re.compile(r"`[^`]+`|\$[^$]+\$")
LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
TAG = re.compile(r"<[A-Za-z/!][^>]*>")
WORD = re.compile(r"\S*[^\W_]\S*")
NUMERAL = re.compile(r"(?<![\w.])[-+]?(?:\d[\d,]*(?:\.\d+)?|\.\d+)(?:e[-+]?\d+)?")
SECTION = re.compile(r"^(?=## )", re.MULTILINE)


@dataclass(frozen=True)
class ReadingTime:
    r"""How much there is to read, to look at and to think about in a notebook or a part of it.

    Parameters
    ----------
    words : int
        Words of text, headings, tables and folded answers. A formula or a piece of code within a line is one word. The
        targets of links, blocks of code in the text and the words that cells print don't count.
    equations : int
        Displayed equations: `$$...$$`, `\[...\]` or an `align`, `equation`, `gather` or `multline` without dollars.
    figures : int
        Images below cells or in the text, animations too.
    predictions : int
        How often the words `PREDICTION` occur.
    lines : int
        Lines of code that isn't collapsed; comments count, blank lines don't.
    numerals : int
        Numbers in the text, outside code, displayed equations and links. They take no time of their own.
    sections : int
        Headings `## ...`.

    Examples
    --------
    >>> ReadingTime(words=260, equations=1, lines=16).minutes
    8.0
    """

    words: int = 0
    equations: int = 0
    figures: int = 0
    predictions: int = 0
    lines: int = 0
    numerals: int = 0
    sections: int = 0

    @property
    def parts(self) -> dict[str, float]:
        """The minutes of each kind of work."""
        return {
            "prose": self.words / 130,
            "equations": 4.0 * self.equations,
            "figures": 1.5 * self.figures,
            "predictions": 3.0 * self.predictions,
            "code": self.lines / 8,
        }

    @property
    def minutes(self) -> float:
        """The minutes of all kinds of work together."""
        return sum(self.parts.values())

    def __add__(self, other: "ReadingTime") -> "ReadingTime":
        """Return the sum over two pieces of a notebook."""
        return ReadingTime(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))


def reading_time(notebook: NotebookNode) -> ReadingTime:
    """Return the reading time of a notebook, the sum over its sections.

    Parameters
    ----------
    notebook : NotebookNode
        The notebook; as long as it hasn't run, the figures below its cells aren't counted.
    """
    return sum(section_times(notebook).values(), ReadingTime())


def section_times(notebook: NotebookNode) -> dict[str, ReadingTime]:
    """Return the reading time of each section, by the text of its heading (`## ...`), in order.

    The part before the first heading is "(header)".

    Parameters
    ----------
    notebook : NotebookNode
        The notebook; as long as it hasn't run, the figures below its cells aren't counted.
    """
    section = "(header)"
    times = {section: ReadingTime()}
    for cell in notebook.cells:
        if cell.cell_type == "code":
            times[section] += _time_of_code(cell)
            continue
        for piece in SECTION.split(cell.source):
            if piece.startswith("## "):
                section = piece[3:].split("\n")[0].strip()
            times[section] = times.get(section, ReadingTime()) + time_of_text(piece)
    return times


def time_of_text(text: str) -> ReadingTime:
    """Return the words, displayed equations, pictures, predictions, numerals and sections of a text in Markdown.

    Parameters
    ----------
    text : str
        The text of a cell, or a part of it.

    Examples
    --------
    >>> time_of_text("See [the map](map.ipynb): $a < b$ is `true`.").words
    6
    """
    text = BLOCK_OF_CODE.sub(" ", text)
    prose = DISPLAY_EQUATION.sub(" ", text)
    words = TAG.sub(" ", LINK.sub(r"\1", IN_LINE.sub("x", PICTURE.sub(" ", prose))))
    return ReadingTime(
        words=len(WORD.findall(words)),
        equations=len(DISPLAY_EQUATION.findall(text)),
        figures=len(PICTURE.findall(prose)),
        predictions=prose.count(PREDICTION),
        numerals=len(NUMERAL.findall(TAG.sub(" ", LINK.sub(" ", CODE_IN_LINE.sub(" ", PICTURE.sub(" ", prose)))))),
        sections=len(SECTION.findall(text)),
    )


def stated_minutes(notebook: NotebookNode) -> int | None:
    """Return the minutes that the header of a notebook states; None when it states none.

    Parameters
    ----------
    notebook : NotebookNode
        The notebook, executed or not.
    """
    found = STATED.search("\n".join(cell.source for cell in notebook.cells))
    return int(found[1]) if found else None


def minutes_table(sources: list[Path]) -> str:
    """Return a table of minutes: a line for each notebook, or for each section of a single notebook.

    "stated" is the header's number. After the minutes come the counts of words, numerals and sections.

    Parameters
    ----------
    sources : list of Path
        Percent sources of lectures and companions. Figures are counted in the executed notebooks, if there are any.
    """
    notebooks = {notebook_name(source): _built(source) for source in sources}
    rows = {name: reading_time(notebook) for name, notebook in notebooks.items()}
    stated = {name: stated_minutes(notebook) for name, notebook in notebooks.items()}
    if len(notebooks) == 1:
        [notebook] = notebooks.values()
        rows = section_times(notebook) | rows
    columns = ("stated", "computed", *ReadingTime().parts, "words", "numerals", "sections")
    lines = ["".join(f"{column:>12}" for column in columns)]
    for name, time in rows.items():
        minutes = "".join(f"{number:12.1f}" for number in (time.minutes, *time.parts.values()))
        counts = "".join(f"{number:12}" for number in (time.words, time.numerals, time.sections))
        lines.append(f"{stated.get(name) or '':>12}{minutes}{counts}  {name}")
    return "\n".join(lines)


def _time_of_code(cell: NotebookNode) -> ReadingTime:
    """Return the reading time of a code cell and of the figures below it."""
    hidden = cell.metadata.get("jupyter", {}).get("source_hidden", False)
    lines = 0 if hidden else sum(bool(line.strip()) for line in cell.source.splitlines())
    return ReadingTime(lines=lines, figures=len(list(figures(cell))))


def _built(source: Path) -> NotebookNode:
    """Return the executed notebook of a source; the source itself while there is none."""
    path = built_path(source)
    return nbformat.read(path, as_version=4) if path.is_file() else read_percent(source)
