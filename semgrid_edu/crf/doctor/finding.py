"""What a check of the CRF's input found, in the words in which one would search for it (findings.toml)."""

import textwrap
from dataclasses import asdict, dataclass

from numpy.typing import NDArray

from semgrid_edu.storage.files import table_beside

WIDTH = 110
"""Characters in a line of a printed finding."""

TEXTS = table_beside(__file__, "findings")
"""The sentences of each fault, by its name."""

PHRASES: dict[str, str] = TEXTS.pop("phrases")
"""Sentences that several faults share."""


@dataclass(frozen=True)
class Finding:
    """One thing that is probably wrong.

    Parameters
    ----------
    name : str
        The fault in a few words.
    symptom : str
        What one sees of it.
    found : str
        The evidence, with numbers.
    cause : str
        What it probably comes from.
    remedy : str
        What to do.

    Examples
    --------
    >>> print(Finding("one class", "The map is 0 everywhere.", "C is 1.", "Only the object has a class.", "Add 1 - p."))
    one class
      symptom  The map is 0 everywhere.
      found    C is 1.
      cause    Only the object has a class.
      remedy   Add 1 - p.
    """

    name: str
    symptom: str
    found: str
    cause: str
    remedy: str

    def __str__(self) -> str:
        """Return the name and, below it, one paragraph for each of the others."""
        name, *parts = asdict(self).items()
        paragraphs = (f"  {title:7}  {text}" for title, text in parts)
        return "\n".join([name[1], *(textwrap.fill(p, WIDTH, subsequent_indent=" " * 11) for p in paragraphs)])


class Findings(list[Finding]):
    """All that was found, the most likely root first; empty when nothing was."""

    def __str__(self) -> str:
        """Return the findings with an empty line between them, or a sentence that there is none."""
        return "\n\n".join(map(str, self)) or "Nothing wrong was found in shapes, numbers and parameters."

    __repr__ = __str__


def finding(key: str, name: str | None = None, **numbers: object) -> Finding:
    """Return what findings.toml says of a fault.

    Parameters
    ----------
    key : str
        Its entry: the name of the fault, or name and variant with a slash between them.
    name : str, optional
        Another name for it.
    **numbers : object
        What the braces in its sentences ask for.

    Returns
    -------
    Finding
        With the numbers filled in.
    """
    general = key.split("/")[0]
    texts = TEXTS.get(general, {}) | TEXTS[key]
    return Finding(name or general, **{part: text.format(**PHRASES, **numbers) for part, text in texts.items()})


def in_cells(mask: NDArray) -> str:
    """Say how many cells are marked, such as "3 of 120 cells".

    Parameters
    ----------
    mask : (H, W) bool
        True in marked cells.
    """
    return f"{mask.sum():,} of {mask.size:,} cells"
