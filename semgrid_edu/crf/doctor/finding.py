"""What a check of the CRF's input found, in the words in which one would search for it."""

import textwrap
from collections.abc import Iterable
from dataclasses import dataclass

WIDTH = 110
"""Characters in a line of a printed finding."""


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
        parts = {"symptom": self.symptom, "found": self.found, "cause": self.cause, "remedy": self.remedy}
        indent = " " * 11
        lines = [
            textwrap.fill(f"  {title:7}  {text}", WIDTH, subsequent_indent=indent) for title, text in parts.items()
        ]
        return "\n".join([self.name, *lines])


class Findings(list[Finding]):
    """All that was found, the most likely root first; empty when nothing was.

    Parameters
    ----------
    findings : iterable of Finding
        In the order in which they should be read.
    """

    def __init__(self, findings: Iterable[Finding] = ()) -> None:
        super().__init__(findings)

    def __str__(self) -> str:
        """Return the findings with an empty line between them, or a sentence that there is none."""
        if not self:
            return "Nothing wrong was found in shapes, numbers and parameters."
        return "\n\n".join(map(str, self))

    __repr__ = __str__


def in_cells(mask: object) -> str:
    """Say how many cells a mask marks.

    Parameters
    ----------
    mask : (H, W) bool
        The cells.

    Returns
    -------
    str
        Such as "3 of 120 cells".
    """
    return f"{mask.sum():,} of {mask.size:,} cells"
