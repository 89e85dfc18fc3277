"""Inputs of a drawing: node positions and dashed edges."""

from collections.abc import Sequence
from typing import NamedTuple

Place = tuple[float, float]
"""x to the right, y upwards; neighbours are about 1 apart."""

CUT_COLOUR = "#7b3294"
"""Colour of dashed edges and their texts."""


class Dashed(NamedTuple):
    """A dashed edge of a drawing. A straight dashed edge replaces an existing arrow between the same nodes.

    Parameters
    ----------
    ends : (str, str)
        The two nodes.
    text : str
        Text on the edge.
    arrow : bool
        Whether it has an arrow head at the second node.
    bend : float
        Offset of its middle to the left of the straight line, seen from the first node, as a share of its length.
    at : float
        Position of the text: 0 at the first node, 1 at the second.
    """

    ends: tuple[str, str]
    text: str = ""
    arrow: bool = True
    bend: float = 0.0
    at: float = 0.5


def in_rows(*rows: Sequence[str | None]) -> dict[str, Place]:
    """Position variables row by row from top to bottom, each row centred.

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
