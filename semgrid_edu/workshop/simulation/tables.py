"""The tables of the simulator: numbers, colours and names that lie in TOML files beside its modules."""

import tomllib
from pathlib import Path
from types import SimpleNamespace


def read_table(name: str) -> dict:
    """Read one of the simulator's tables.

    Parameters
    ----------
    name : str
        The file's path below this folder, without its suffix.
    """
    return tomllib.loads((Path(__file__).parent / f"{name}.toml").read_text(encoding="utf-8"))


def named_rows(table: dict[str, dict]) -> dict[str, SimpleNamespace]:
    """Return the rows of a table by their names, each with its columns as attributes.

    Parameters
    ----------
    table : dict
        A part of a table from `read_table`: rows by their names.
    """
    return {name: SimpleNamespace(**row) for name, row in table.items()}
