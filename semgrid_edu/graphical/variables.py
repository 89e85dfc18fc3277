"""Variables are known by name: reading names, and refusing unknown names and states."""

from collections.abc import Iterable, Mapping

import numpy as np

from semgrid_edu.errors import ArgumentError


def shared_cardinalities(tables: Iterable[Mapping[str, int]]) -> dict[str, int]:
    """Collect the variables of several tables with their numbers of states.

    Parameters
    ----------
    tables : iterable of dict of str to int
        The number of states of each variable of a table; a variable may occur in several.

    Returns
    -------
    dict of str to int
        In the order in which the variables first occur.

    Raises
    ------
    ArgumentError
        When two tables disagree about a variable's number of states.
    """
    states: dict[str, int] = {}
    for table in tables:
        for name, count in table.items():
            if states.setdefault(name, count) != count:
                raise ArgumentError(
                    f"variable {name}", f"{states[name]} states in every factor", f"{count} in one over {tuple(table)}"
                )
    return states


def as_names(names: str | Iterable[str]) -> tuple[str, ...]:
    """Return names as a tuple; a single string is one name, not a sequence of letters.

    Parameters
    ----------
    names : str or iterable of str
        One name or several.

    Returns
    -------
    tuple of str
    """
    return (names,) if isinstance(names, str) else tuple(names)


def check_name(argument: str, name: str, known: Iterable[str]) -> None:
    """Refuse the name of a variable that isn't there.

    Parameters
    ----------
    argument : str
        What the message calls the argument.
    name : str
        The variable asked for.
    known : iterable of str
        The variables there are.

    Raises
    ------
    ArgumentError
        When `name` isn't one of them.
    """
    known = tuple(known)
    if name not in known:
        raise ArgumentError(argument, f"variables among {known}", name)


def check_states(states: Mapping[str, int], cardinalities: Mapping[str, int]) -> None:
    """Refuse unknown variables, and states that a variable doesn't have.

    Parameters
    ----------
    states : dict of str to int
        What is given.
    cardinalities : dict of str to int
        The number of states of each variable.

    Raises
    ------
    ArgumentError
        Names the variable.
    """
    for name, state in states.items():
        check_name("given", name, cardinalities)
        count = cardinalities[name]
        if not isinstance(state, (int, np.integer, np.bool_)) or not 0 <= state < count:
            raise ArgumentError(f"given {name}", f"a state from 0 to {count - 1}", state)
