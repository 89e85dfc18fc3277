"""What a drawing is given: the places of nodes, and dashed edges."""

from collections.abc import Sequence
from typing import NamedTuple

Place = tuple[float, float]
"""x to the right, y upwards; neighbours are about 1 apart."""

CUT_COLOUR = "#7b3294"
"""Colour of every dashed edge and of its text."""


class Dashed(NamedTuple):
    """A dashed edge of a drawing. A straight one replaces the arrow between the same nodes, if there is one.

    Parameters
    ----------
    ends : (str, str)
        The two nodes.
    text : str
        What is written on it.
    arrow : bool
        Whether it has an arrow head at the second node.
    bend : float
        How far its middle is to the left of the straight line, seen from the first node; in units of its length.
    at : float
        Where the text is: 0 at the first node, 1 at the second.
    """

    ends: tuple[str, str]
    text: str = ""
    arrow: bool = True
    bend: float = 0.0
    at: float = 0.5


def in_rows(*rows: Sequence[str | None]) -> dict[str, Place]:
    """Place variables row by row from top to bottom, each row centred.

    Parameters
    ----------
    *rows : sequence of str or None
        The names from left to right; None leaves a gap.

    Returns
    -------
    dict of str to (float, float)
        For `draw(model, positions=...)`.

    Examples
    --------
    >>> in_rows(["m1", "m2"], ["r"])
    {'m1': (0.0, 0.0), 'm2': (1.0, 0.0), 'r': (0.5, -1.0)}
    """
    widest = max(map(len, rows), default=0)
    return {
        name: ((widest - len(row)) / 2 + column, 0.0 - line)
        for line, row in enumerate(rows)
        for column, name in enumerate(row)
        if name is not None
    }
