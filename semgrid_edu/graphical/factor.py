"""A factor: a non-negative table with one named axis per variable, and the operations of inference.

Every algorithm of this package is a sequence of four operations: product, sum, maximum, slice (Koller and Friedman,
Probabilistic Graphical Models, section 4.2 and chapter 9).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from math import frexp, prod

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError

MAX_ENTRIES = 10**7
"""Maximum table size of a product: 80 MB of float64."""


@dataclass(frozen=True, eq=False)
class Factor:
    """A non-negative table over named variables.

    Parameters
    ----------
    names : tuple of str
        One name per axis of the table; a string is a single name. () makes a constant.
    table : (K_1, ..., K_n) float
        Non-negative and finite, stored as a read-only float64 copy. K_i is the number of states of variable i.

    Raises
    ------
    ArgumentError
        When a name occurs twice, names and axes differ in number, or an entry is negative, NaN or infinite.

    Examples
    --------
    >>> rain = Factor("rain", [0.8, 0.2])
    >>> wet = Factor(("rain", "wet"), [[0.9, 0.1], [0.2, 0.8]])
    >>> (rain * wet).sum("rain").table
    array([0.76, 0.24])
    >>> (rain * wet).given(wet=1).normalised().table.round(2)
    array([0.33, 0.67])
    """

    names: tuple[str, ...]
    table: NDArray[np.float64]

    def __post_init__(self) -> None:
        names = as_names(self.names)
        table = np.array(self.table, dtype=np.float64, order="C")
        table.setflags(write=False)
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "table", table)
        if len(set(names)) < len(names):
            raise ArgumentError("names", "each variable once", names)
        if table.ndim != len(names) or table.size == 0:
            raise ArgumentError("table", f"one axis of at least one state for each of {names}", f"shape {table.shape}")
        if (bad := ~(np.isfinite(table) & (table >= 0))).any():
            raise ArgumentError("table", "finite entries, none of them negative", table[bad][0])

    @property
    def cardinalities(self) -> dict[str, int]:
        """Number of states of each variable: {name: K}."""
        return dict(zip(self.names, self.table.shape, strict=True))

    def __mul__(self, other: "Factor") -> "Factor":
        """Multiply entry by entry. The axes are the left factor's, then the remaining ones of the right factor.

        Parameters
        ----------
        other : Factor
            The right factor. Shared variables must have the same number of states in both.
        """
        if not isinstance(other, Factor):
            return NotImplemented
        names = tuple(dict.fromkeys(self.names + other.names))
        shared_cardinalities([self.cardinalities, other.cardinalities])
        with np.errstate(over="ignore"):  # the constructor rejects infinity
            return Factor(names, self._spread(names) * other._spread(names))

    def _spread(self, names: tuple[str, ...]) -> NDArray[np.float64]:
        """Return the table with axes in the order of `names`, and an axis of length 1 for each missing name."""
        states = self.cardinalities
        ordered = self.ordered(*(name for name in names if name in states))
        return ordered.table.reshape([states.get(name, 1) for name in names])

    def ordered(self, *names: str) -> "Factor":
        """Return the same factor with its axes in another order.

        Parameters
        ----------
        *names : str
            All variables of the factor, each once.

        Examples
        --------
        >>> Factor(("x", "y"), [[1, 2, 3], [4, 5, 6]]).ordered("y", "x").table.shape
        (3, 2)
        """
        if sorted(names) != sorted(self.names):
            raise ArgumentError("names", f"the variables {self.names} in some order", names)
        return Factor(names, self.table.transpose([self.names.index(name) for name in names]))

    def sum(self, *names: str) -> "Factor":
        """Sum variables out: f.sum("x"), f.sum("x", "y").

        Parameters
        ----------
        *names : str
            The variables to sum out; summing out all of them leaves a constant.
        """
        return self._reduce(np.sum, names)

    def marginal(self, name: str) -> "Factor":
        """Sum out all variables except one: f.marginal("x").

        Parameters
        ----------
        name : str
            The variable to keep.
        """
        check_name("name", name, self.names)
        return self.sum(*(other for other in self.names if other != name))

    def max(self, *names: str) -> "Factor":
        """Maximise over variables: keep the largest entry over all their states.

        Parameters
        ----------
        *names : str
            The variables to maximise over.
        """
        return self._reduce(np.max, names)

    def _reduce(self, operation: Callable, names: tuple[str, ...]) -> "Factor":
        for name in names:
            check_name("names", name, self.names)
        axes = tuple(self.names.index(name) for name in names)
        return Factor([name for name in self.names if name not in names], operation(self.table, axis=axes))

    def given(self, /, **states: int) -> "Factor":
        """Return the slice of the table at given states: f.given(x=1).

        Parameters
        ----------
        **states : int
            The state of each given variable, from 0. The slice isn't normalised.
        """
        check_states(states, self.cardinalities)
        index = tuple(int(states[name]) if name in states else slice(None) for name in self.names)
        return Factor([name for name in self.names if name not in states], self.table[index])

    def normalised(self) -> "Factor":
        """Divide by the sum of all entries, so that they sum to 1.

        Raises
        ------
        ArgumentError
            When all entries are 0, so the given states are impossible under the model.
        """
        table = self.rescaled()[0].table  # keeps the sum of huge or tiny entries in range
        if not table.any():
            zeros = "only zeros: no assignment agrees with all factors and with what is given"
            raise ArgumentError(f"factor over {self.names}", "at least one positive entry to normalise by", zeros)
        return Factor(self.names, table / table.sum())

    def rescaled(self) -> tuple["Factor", int]:
        """Divide by a power of two so that the largest entry is in [1/2, 1): thousands of products stay in range.

        Returns
        -------
        Factor
            This factor divided by 2^n. The division is exact, because it changes only the exponents.
        int
            n; 0 when all entries are 0.

        Examples
        --------
        >>> factor, n = Factor("x", [0, 5, 10]).rescaled()
        >>> factor.table.tolist(), n
        ([0.0, 0.3125, 0.625], 4)
        """
        power = frexp(self.table.max())[1]
        return Factor(self.names, np.ldexp(self.table, -power)), power


def product(factors: Iterable[Factor]) -> Factor:
    """Multiply factors, after checking the size of the product.

    Parameters
    ----------
    factors : iterable of Factor
        An empty iterable gives the constant 1.

    Raises
    ------
    ArgumentError
        When the product has more than `MAX_ENTRIES` entries; the message names its variables.
    """
    return reduce(Factor.__mul__, _checked(factors), Factor((), 1.0))


def rescaled_product(factors: Iterable[Factor]) -> tuple[Factor, int]:
    """Multiply any number of factors, rescaling by a power of two after each, so that thousands stay in range.

    Parameters
    ----------
    factors : iterable of Factor
        An empty iterable gives the constant 1.

    Returns
    -------
    Factor
        The product divided by 2^n, with its largest entry in [1/2, 1).
    int
        n.
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
        wanted = f"a table of at most {MAX_ENTRIES:,} entries"
        raise ArgumentError(f"clique ({', '.join(states)})", wanted, f"{entries:,}")
    return factors


def shared_cardinalities(tables: Iterable[Mapping[str, int]]) -> dict[str, int]:
    """Merge {name: number of states} of several tables, in order of first occurrence.

    Parameters
    ----------
    tables : iterable of dict of str to int
        The number of states of each variable of a table. Tables that share a variable must agree.
    """
    states: dict[str, int] = {}
    for table in tables:
        for name, count in table.items():
            if states.setdefault(name, count) != count:
                found = f"{count} in one over {tuple(table)}"
                raise ArgumentError(f"variable {name}", f"{states[name]} states in every factor", found)
    return states


def as_names(names: str | Iterable[str]) -> tuple[str, ...]:
    """Return names as a tuple; a string is one name, not a sequence of letters.

    Parameters
    ----------
    names : str or iterable of str
        One name or several.
    """
    return (names,) if isinstance(names, str) else tuple(names)


def check_name(argument: str, name: str, known: Iterable[str]) -> None:
    """Raise an error for the name of a variable that doesn't exist.

    Parameters
    ----------
    argument : str
        Name of the argument, for the error message.
    name : str
        The variable to check.
    known : iterable of str
        The existing variables.
    """
    if name not in (known := tuple(known)):
        raise ArgumentError(argument, f"variables among {known}", name)


def check_states(states: Mapping[str, int], cardinalities: Mapping[str, int]) -> None:
    """Raise an error for unknown variables and for states out of range.

    Parameters
    ----------
    states : dict of str to int
        The given states.
    cardinalities : dict of str to int
        The number of states of each variable.
    """
    for name, state in states.items():
        check_name("given", name, cardinalities)
        count = cardinalities[name]
        if not isinstance(state, (int, np.integer, np.bool_)) or not 0 <= state < count:
            raise ArgumentError(f"given {name}", f"a state from 0 to {count - 1}", state)
