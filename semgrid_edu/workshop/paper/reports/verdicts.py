"""Verdicts on the paper's claims, by a rule that is written down before the numbers are (section 4).

A claim is split into statements about numbers, each of the form "this is above (or below) that limit". Each number has
a 95 % interval over drives and seeds, and a one-sided p-value against its statement: how often a number would lie so
far on the wrong side if the true value lay at the limit. Then the claim is

- **reproduced**, when every interval lies entirely on the claimed side of its limit;
- **not reproduced**, when at least one number lies on the other side by more than chance explains. A claim with many
  statements has many chances to fail by chance. So the p-values are corrected as Holm does: of m statements that may
  still be true, the one with the smallest p-value is given up when that is at most 2.5 % / m, then the next of m - 1.
  A claim all of whose statements are true is called not reproduced in at most 2.5 % of cases, as one statement's 95 %
  interval would have it;
- **cannot tell** otherwise. Also whenever there are fewer than three seeds or ten drives: then the numbers are too few
  for an interval to be believed, and none is printed.

What the paper states as an expectation and doesn't measure can't be reproduced. Its verdicts are "as expected" and "not
as expected".
"""

from collections.abc import Sequence
from typing import NamedTuple

from semgrid_edu.workshop.scoring.score_with_interval import ScoreWithInterval
from semgrid_edu.workshop.scoring.statistics import MIN_DRIVES

REPRODUCED, NOT_REPRODUCED, CANNOT_TELL = "reproduced", "not reproduced", "cannot tell"
"""The three verdicts."""

TOO_SMALL = "cannot tell (too small)"
"""The third one, when there are too few seeds or drives."""

EXPECTED = {REPRODUCED: "as expected", NOT_REPRODUCED: "not as expected"}
"""What the first two are called where the paper states an expectation."""

MIN_SEEDS = 3
"""With fewer seeds, or fewer than `MIN_DRIVES` drives, no verdict."""

ERROR_RATE = 0.025
"""How often a true claim may be called not reproduced: what a 95 % interval leaves on one side."""


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
    p : float or None
        The one-sided p-value against the statement, see `EstimatedMean.p_value`; None where there is no interval.
    judged : bool
        Whether the claim needs it. What the claim doesn't need is shown beside it.
    """

    what: str
    value: ScoreWithInterval
    limit: float = 0.0
    above: bool = True
    p: float | None = None
    judged: bool = True

    @property
    def confirmed(self) -> bool:
        """Whether the interval lies entirely on the claimed side."""
        low, high = self.value["low"], self.value["high"]
        if low is None or high is None:
            return False
        return low > self.limit if self.above else high < self.limit


def holm(p_values: Sequence[float | None], error_rate: float = ERROR_RATE) -> list[bool]:
    """Return which of several hypotheses are rejected, so that any true one is rejected rarely (Holm 1979).

    Parameters
    ----------
    p_values : sequence of float or None
        One for each hypothesis; None for one that can't be rejected.
    error_rate : float
        How often at least one true hypothesis may be rejected, however the p-values depend on each other.

    Examples
    --------
    >>> holm([0.012, 0.5, 0.001, None], 0.05)
    [True, False, True, False]
    """
    rejected, left = [False] * len(p_values), len(p_values)
    for p, number in sorted((p, number) for number, p in enumerate(p_values) if p is not None):
        if p > error_rate / left:
            break
        rejected[number], left = True, left - 1
    return rejected


def which_hold(statements: Sequence[Statement]) -> list[bool | None]:
    """Return of each statement True when its interval confirms it, False when Holm's rule gives it up, else None.

    Parameters
    ----------
    statements : sequence of Statement
        All statements of a claim. Those that aren't judged are neither counted nor given up.
    """
    given_up = iter(holm([one.p for one in statements if one.judged]))
    return [False if one.judged and next(given_up) else True if one.confirmed else None for one in statements]


def verdict(statements: Sequence[Statement], seeds: int, drives: int, expectation: bool = False) -> str:
    """Return the verdict on a claim.

    Parameters
    ----------
    statements : sequence of Statement
        All that it says.
    seeds, drives : int
        How many of them the numbers rest on.
    expectation : bool
        Whether the paper states the claim as an expectation.

    Returns
    -------
    str
        `REPRODUCED`, `NOT_REPRODUCED`, `CANNOT_TELL` or `TOO_SMALL`; of an expectation the words of `EXPECTED`.

    Examples
    --------
    >>> gain = Statement("gain", {"mean": 0.02, "low": 0.01, "high": 0.03, "seeds": []}, p=0.999)
    >>> verdict([gain], seeds=3, drives=110), verdict([gain._replace(above=False, p=0.001)], 3, 110)
    ('reproduced', 'not reproduced')
    >>> verdict([gain], seeds=3, drives=110, expectation=True), verdict([gain], seeds=3, drives=2)
    ('as expected', 'cannot tell (too small)')
    """
    if seeds < MIN_SEEDS or drives < MIN_DRIVES:
        return TOO_SMALL
    found = which_hold([one for one in statements if one.judged])
    said = NOT_REPRODUCED if False in found else REPRODUCED if all(found) else CANNOT_TELL
    return EXPECTED.get(said, said) if expectation else said
