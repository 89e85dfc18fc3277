"""Products of factors: of a few, as they are; of thousands, with powers of two taken out on the way."""

from collections.abc import Iterable
from functools import reduce
from math import prod

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.variables import shared_cardinalities

MAX_ENTRIES = 10**7
"""The largest table that a product may have: 80 MB of float64."""


def product(factors: Iterable[Factor]) -> Factor:
    """Multiply factors, after checking that the table of the product isn't too large.

    Parameters
    ----------
    factors : iterable of Factor
        None at all gives the constant 1.

    Returns
    -------
    Factor

    Raises
    ------
    ArgumentError
        When the product has more than `MAX_ENTRIES` entries; the message names its variables.
    """
    return reduce(Factor.__mul__, _checked(factors), Factor((), 1.0))


def rescaled_product(factors: Iterable[Factor]) -> tuple[Factor, int]:
    """Multiply factors of which there may be thousands: a power of two is taken out after each.

    Parameters
    ----------
    factors : iterable of Factor
        None at all gives the constant 1.

    Returns
    -------
    Factor
        Their product divided by 2^n; its largest entry is from 1/2 to 1.
    int
        n.

    Raises
    ------
    ArgumentError
        As `product` does.
    """
    total, power = Factor((), 1.0).rescaled()
    for factor in _checked(factors):
        total, more = (total * factor).rescaled()
        power += more
    return total, power


def _checked(factors: Iterable[Factor]) -> tuple[Factor, ...]:
    factors = tuple(factors)
    states = shared_cardinalities(factor.cardinalities for factor in factors)
    entries = prod(states.values())
    if entries > MAX_ENTRIES:
        raise ArgumentError(
            f"clique ({', '.join(states)})", f"a table of at most {MAX_ENTRIES:,} entries", f"{entries:,}"
        )
    return factors
