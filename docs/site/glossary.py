"""The site's page of terms, quoted from the lectures that introduce them, as `glossary.toml` lists them."""

import re
import tomllib
from pathlib import Path

import nbformat

HERE = Path(__file__).resolve().parent
NOTEBOOKS = HERE.parents[1] / "notebooks"
SENTENCE_ENDS = re.compile(r"(?<=[.!?])(?<!eq\.)(?<!sec\.)\s+(?=[A-Z$*(`])")


def glossary_page() -> str:
    """Return the page as Markdown, whose links work one folder above the notebooks."""
    terms = tomllib.loads((HERE / "glossary.toml").read_text(encoding="utf-8"))
    entries = [(term, name, number) for name, of in terms.items() for term, number in of.items()]
    parts = [
        "# Terms",
        "Each term in the words of the lecture that introduces it, and a link to it.",
        *("", "| term | in the words of the lecture | lecture |", "|---|---|---|"),
    ]
    for term, name, number in sorted(entries, key=lambda entry: entry[0].lower()):
        words = definition(texts(name), term, number).rstrip(" ;:,").replace("|", "\\|")
        words = words.replace("](", "](notebooks/")  # a lecture's links are to its neighbours
        parts.append(f"| {term} | {words} | {link(name)} |")
    return "\n".join(parts) + "\n"


def texts(name: str) -> list[str]:
    """Return the text cells of a lecture.

    Parameters
    ----------
    name : str
        Name of the notebook, such as "01_bayes".
    """
    cells = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4).cells
    return [cell.source for cell in cells if cell.cell_type == "markdown"]


def link(name: str) -> str:
    """Link a lecture by its number.

    Parameters
    ----------
    name : str
        Name of the notebook.
    """
    number = name.partition("_")[0]
    return f"[{number}](notebooks/{name}.ipynb)"


def definition(cells: list[str], term: str, number: int = 1) -> str:
    """Return the sentence in which a term is emphasised for the first time, with the next ones or those before it.

    Parameters
    ----------
    cells : list of str
        The text cells of a lecture.
    term : str
        The term, as it stands there in bold or in italics.
    number : int
        How many sentences; a negative one says how many before the term's own are wanted.

    Raises
    ------
    ValueError
        When the term isn't emphasised anywhere.

    Examples
    --------
    >>> definition(["A cell has a state. Its **belief** is a row of numbers. They sum to one."], "belief")
    'Its **belief** is a row of numbers.'
    """
    for block in (block for cell in cells for block in re.split(r"\n\s*\n|\n(?=- |\d\. |\|)", cell)):
        sentences = SENTENCE_ENDS.split(" ".join(re.sub(r"^(- |\d\. )", "", block).split()))
        for k, sentence in enumerate(sentences):
            if re.search(rf"\*{re.escape(term)}\.?\*", sentence):
                return " ".join(sentences[k : k + number] if number > 0 else sentences[max(0, k + number) : k + 1])
    raise ValueError(f"{term!r} is nowhere emphasised")
