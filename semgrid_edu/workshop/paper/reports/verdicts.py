"""Verdicts on the paper's claims, by a rule that was written down before the numbers were (section 4).

A claim is split into statements about numbers, each of the form "this is above (or below) that limit". Each number has
a 95 % interval over drives and seeds. Then the claim is

- **reproduced**, when every interval lies entirely on the claimed side of its limit;
- **not reproduced**, when at least one interval lies entirely on the other side;
- **cannot tell** otherwise. Also whenever there are fewer than three seeds or ten drives: then the numbers are too few
  for an interval to be believed, whatever it is.
"""

from collections.abc import Sequence
from typing import NamedTuple

from semgrid_edu.workshop.scoring.score_with_interval import ScoreWithInterval

REPRODUCED, NOT_REPRODUCED, CANNOT_TELL = "reproduced", "not reproduced", "cannot tell"
"""The three verdicts."""

TOO_SMALL = "cannot tell (too small)"
"""The third one, when there are too few seeds or drives."""

MIN_SEEDS, MIN_DRIVES = 3, 10
"""With fewer seeds or drives, no verdict."""


class Statement(NamedTuple):
    """One number that a claim is about.

    Parameters
    ----------
    what : str
        What the number is.
    value : dict
        The number with its interval, as `score_with_interval` and `compared` return it.
    limit : float
        What it is compared with, in the same unit.
    above : bool
        Whether the claim says that it is above the limit; else below.
    """

    what: str
    value: ScoreWithInterval
    limit: float = 0.0
    above: bool = True

    @property
    def holds(self) -> bool | None:
        """True when the interval lies entirely on the claimed side, False when on the other one, None otherwise."""
        low, high = self.value["low"], self.value["high"]
        if low is None or high is None:
            return None
        sides = {True: low > self.limit, False: high < self.limit}
        return True if sides[self.above] else False if sides[not self.above] else None


def verdict(statements: Sequence[Statement], seeds: int, drives: int) -> str:
    """Return the verdict on a claim.

    Parameters
    ----------
    statements : sequence of Statement
        All that it says.
    seeds, drives : int
        How many of them the numbers rest on.

    Returns
    -------
    str
        `REPRODUCED`, `NOT_REPRODUCED`, `CANNOT_TELL` or `TOO_SMALL`.

    Examples
    --------
    >>> gain = Statement("gain", {"mean": 0.02, "low": 0.01, "high": 0.03, "seeds": []})
    >>> verdict([gain], seeds=3, drives=110), verdict([gain._replace(above=False)], 3, 110), verdict([gain], 3, 2)
    ('reproduced', 'not reproduced', 'cannot tell (too small)')
    """
    if seeds < MIN_SEEDS or drives < MIN_DRIVES:
        return TOO_SMALL
    found = [statement.holds for statement in statements]
    if False in found:
        return NOT_REPRODUCED
    return REPRODUCED if all(found) else CANNOT_TELL
