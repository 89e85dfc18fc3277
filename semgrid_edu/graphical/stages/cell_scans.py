"""What a sequence of scans says of one cell, as the package's likelihoods."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.occupancy import SensorModel
from semgrid_edu.occupancy.sensor import likelihoods


def read_scans(says: str, sensor: SensorModel | None = None) -> NDArray[np.float64]:
    """Translate what scans say of a cell, in lecture 01's letters, into the package's likelihoods.

    Parameters
    ----------
    says : str
        One letter per scan: "." for a beam that passes the cell, "#" for an obstacle return, " " for nothing.
    sensor : SensorModel, optional
        How the scanner errs; the package's default when left out.

    Returns
    -------
    (T, 2) float64
        P(z | occupied) and P(z | free) of each scan.

    Raises
    ------
    ArgumentError
        When `says` holds another letter.

    Examples
    --------
    >>> read_scans(".# ").round(2).tolist()
    [[0.3, 0.7], [0.8, 0.05], [1.0, 1.0]]
    """
    if set(says) - set(".# "):
        raise ArgumentError("says", "letters '.', '#' and ' '", repr(says))
    letters = np.array(list(says))
    evidence = likelihoods((letters == "#").astype(int), letters == ".", sensor or SensorModel())
    return np.stack([evidence.occupied, evidence.free], axis=1).astype(np.float64)


def check_scans(scans: ArrayLike) -> NDArray[np.float64]:
    """Return scans as a table of likelihoods, or refuse them.

    Parameters
    ----------
    scans : (T, 2) float
        P(z | occupied) and P(z | free) of each scan, not both 0.

    Returns
    -------
    (T, 2) float64
        The same numbers.

    Raises
    ------
    ArgumentError
        When `scans` isn't such a table.
    """
    table = np.asarray(scans, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != 2 or len(table) == 0:
        raise ArgumentError("scans", "P(z | occupied) and P(z | free) of each scan, (T, 2)", f"shape {table.shape}")
    if not (np.isfinite(table).all() and (table >= 0).all() and (table.max(axis=1) > 0).all()):
        raise ArgumentError("scans", "likelihoods, not negative, one of each pair positive", table.tolist())
    return table
