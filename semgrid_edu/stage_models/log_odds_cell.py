"""One cell of the log-odds grid as a graphical model: two states, and no change (lecture 02)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.layout import in_rows
from semgrid_edu.occupancy import Evidence, LogOddsParams, SensorModel, log_odds, probability, update_log_odds
from semgrid_edu.occupancy.sensor import likelihoods
from semgrid_edu.stage_models.stage_graph import StageGraph, binary, cut_edges, directed


def one_log_odds_cell(scans: ArrayLike, prior: float = 0.5) -> StageGraph:
    """Build one cell of the log-odds grid: free or occupied for ever, and scans that are independent given its state.

    Parameters
    ----------
    scans : (T, 2) float
        P(z | occupied) and P(z | free) of each scan.
    prior : float
        P(occupied) before the first scan.

    Returns
    -------
    StageGraph
        Variables m (0 free, 1 occupied) and z1 ... zT, each observed in state 1.
    """
    scans = check_scans(scans)
    names = tuple(f"z{t}" for t in range(1, len(scans) + 1))
    ratios = (scans / scans.max(axis=1, keepdims=True))[:, ::-1]
    tables = np.stack([1 - ratios, ratios], axis=-1)
    factors = [Factor(("m", name), table) for name, table in zip(names, tables, strict=True)]
    return StageGraph(
        "One cell of the log-odds grid",
        directed([binary("m", prior), *factors]),
        observed=names,
        positions=in_rows(["m"], names),
        labels={"next": "later", "front": "in front"},
        equations={"m": "free or occupied", names[-1]: "scan"},
        plates={"cells": ("m", *names)},
        cut=cut_edges("log-odds"),
        ghosts={"next": (len(names) / 2 - 0.5, 1.3), "front": (-1.4, 0.1)},
    )


def package_log_odds_cell(scans: ArrayLike, params: LogOddsParams | None = None) -> NDArray[np.float64]:
    """Return P(occupied) after each scan by the package's `update_log_odds`.

    Parameters
    ----------
    scans : (T, 2) float
        P(z | occupied) and P(z | free) of each scan.
    params : LogOddsParams, optional
        Prior and bounds; the defaults when left out. The result is exact until it reaches a bound, where it stops.

    Returns
    -------
    (T,) float64
        P(occupied) after each scan.
    """
    params = params or LogOddsParams()
    L, history = log_odds(np.array([[params.prior]])), []
    for occupied, free in check_scans(scans):
        L = update_log_odds(L, Evidence(np.array([[occupied]]), np.array([[free]])), params)
        history.append(probability(L)[0, 0])
    return np.array(history)


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
    """
    table = np.asarray(scans, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != 2 or len(table) == 0:
        raise ArgumentError("scans", "P(z | occupied) and P(z | free) of each scan, (T, 2)", f"shape {table.shape}")
    if not (np.isfinite(table).all() and (table >= 0).all() and (table.max(axis=1) > 0).all()):
        raise ArgumentError("scans", "likelihoods, not negative, one of each pair positive", table.tolist())
    return table
