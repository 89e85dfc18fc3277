"""The tables of the simulator: numbers, colours and names that lie in TOML files beside its modules."""

import tomllib
from pathlib import Path
from types import SimpleNamespace


def read_table(name: str) -> dict:
    """Read one of the simulator's tables; its lists become tuples.

    Parameters
    ----------
    name : str
        The file's path below the folder of the simulator, without its suffix.
    """
    return _frozen(tomllib.loads((Path(__file__).parents[1] / f"{name}.toml").read_text(encoding="utf-8")))


def _frozen(value: object) -> object:
    if isinstance(value, dict):
        return {name: _frozen(part) for name, part in value.items()}
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def named_rows(table: dict[str, dict]) -> dict[str, SimpleNamespace]:
    """Return the rows of a table by their names, each with its columns as attributes.

    Parameters
    ----------
    table : dict
        A part of a table from `read_table`: rows by their names.
    """
    return {name: SimpleNamespace(**row) for name, row in table.items()}
