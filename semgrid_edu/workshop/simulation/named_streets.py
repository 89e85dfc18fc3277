"""Named streets: ten that are hard for occupancy filters, each for its own reason, and the sample drive's street."""

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.simulation.street import road_users
from semgrid_edu.workshop.simulation.street.light import Light
from semgrid_edu.workshop.simulation.street.plan import Wishes

_TABLES = table_beside(__file__, "streets")
_STREETS = {name: _TABLES[common] | row for name, (common, row) in _TABLES["streets"].items()}
"""Per street: fields of `Wishes`, the name of the cast, and the range of the recording car's mean speed, m/s."""
TEST_STREETS = tuple(_STREETS)
"""The names of the test streets."""


def wishes_of(row: dict) -> Wishes:
    """Return a table row as `Wishes`.

    Parameters
    ----------
    row : dict
        Fields of `Wishes`. The field `cast` is the name of a function in `street/road_users.py`.
    """
    cast = {"cast": getattr(road_users, row["cast"])} if "cast" in row else {}
    return Wishes(**row | cast)


def draw_test_street(name: str, seed: int) -> tuple[np.random.SeedSequence, Wishes]:
    """Return seed and properties of a drive through a test street.

    On streets with a border, the recording car drives at 12 to 14 m/s, 3 to 6 m to the left of the border.

    Parameters
    ----------
    name : str
        One of `TEST_STREETS`.
    seed : int
        Seed for the drive. With the same seed, different names still give different streets.

    Raises
    ------
    ArgumentError
        When there is no such street.
    """
    if name not in _STREETS:
        raise ArgumentError("street", " or ".join(_STREETS), name)
    row = dict(_STREETS[name])
    speeds = row.pop("speeds")
    root = np.random.SeedSequence([seed, *name.encode()])
    speed = float(np.random.default_rng(root.spawn(1)[0]).uniform(*speeds))
    return root, wishes_of(row | {"speed": speed})


SAMPLE_WISHES = wishes_of(_TABLES["sample"] | {"light": Light(**_TABLES["sunny"])})
"""The street of the shipped sample drive: it has one of everything that the course discusses."""
