"""A single cell of the log-odds grid, and of CMCDOT, a chain of four states (paper, section 3.2).

A scan enters as virtual evidence (Pearl 1988, section 2.2.2): z_t has two states, "this scan" and "any other", and
P(z_t = this scan | state) is the pair of likelihoods that the package computes. Only their ratio matters.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.graphical import Factor, in_rows, sum_product
from semgrid_edu.occupancy import (
    Evidence,
    LogOddsParams,
    SensorModel,
    State,
    WorldModel,
    log_odds,
    probability,
    transition_matrix,
    update_log_odds,
)
from semgrid_edu.occupancy.sensor import likelihoods
from worlds.lecture_00_stage_graph import CutEdge, StageGraph, binary, directed

NEVER_SEEN = (0.0, 0.0, 0.0, 1.0)
"""The belief of a cell that no scan has seen: FREE, STATIC, DYNAMIC, UNKNOWN."""


def one_cell(
    scans: ArrayLike, dt: float = 0.1, world: WorldModel | None = None, start: Sequence[float] = NEVER_SEEN
) -> StageGraph:
    """Build the chain of one cell of CMCDOT, which repeats: predict the state, see the cell or not, read the scan.

    Between two scans the state changes by `transition_matrix`. v_t is 1 when scan t sees the cell. Then UNKNOWN, which
    means that no scan has seen the cell, becomes one of the other states with the probabilities of `first_sight`.
    STATIC and DYNAMIC share P(z | occupied), FREE and UNKNOWN share P(z | free).

    Parameters
    ----------
    scans : (T, 2) float
        P(z | occupied) and P(z | free) of each scan, as from `read_scans`; equal if a scan doesn't observe the cell.
    dt : float
        Time before each scan, seconds.
    world : WorldModel, optional
        The rates of change, and the probabilities of the states at first sight; the defaults when left out.
    start : (4,) float
        The belief at time 0: FREE, STATIC, DYNAMIC, UNKNOWN.

    Returns
    -------
    StageGraph
        Variables m0; then, for t = 1 ... T, prior t (after prediction), v t, m t (after looking), z t.
        `cell_given(scans)` holds what is observed.
    """
    world = world or WorldModel()
    steps = range(1, len(scans) + 1)
    M = transition_matrix(world, dt)
    look = looking(world)
    factors = [Factor("m0", start)]
    for t, (occupied, free) in zip(steps, scans, strict=True):
        prior = f"prior{t}"
        v = f"v{t}"
        m = f"m{t}"
        z = f"z{t}"
        this_scan = np.array([free, occupied, occupied, free]) / max(occupied, free)
        factors += [
            Factor((f"m{t - 1}", prior), M),
            binary(v, 0.5),
            Factor((v, prior, m), look),
            Factor((m, z), np.stack([1 - this_scan, this_scan], axis=1)),
        ]
    chain = [name for t in steps for name in (f"prior{t}", f"m{t}")]
    above = [name for t in steps for name in (None, f"v{t}")]
    below = [name for t in steps for name in (None, f"z{t}")]
    return StageGraph(
        "One cell, four states",
        directed(factors),
        positions=in_rows([None, *above], ["m0", *chain], [None, *below]),
        observed=tuple(name for t in steps for name in (f"v{t}", f"z{t}")),
        labels={f"prior{t}": f"$m_{{{t}}}^-$" for t in steps}
        | {f"m{t}": f"$m_{{{t}}}$" for t in (0, *steps)}
        | {f"v{t}": "seen?" for t in steps}
        | {"neighbour": "next cell", "front": "in front"},
        equations={f"m{len(scans)}": "state", f"z{len(scans)}": "scan"},
        plates={"cells": tuple(dict.fromkeys(name for factor in factors for name in factor.names))},
        cut=CUT_CELL,
        ghosts={"neighbour": (0.8, 1.1), "front": (3.0, 1.1)},
    )


def looking(world: WorldModel) -> NDArray[np.float64]:
    """Return P(m | v, prior), (2, 4, 4): UNKNOWN becomes another state when a scan sees the cell; the others stay."""
    seen = np.eye(4)
    seen[State.UNKNOWN] = [*world.first_sight, 0]
    return np.stack([np.eye(4), seen / seen.sum(axis=1, keepdims=True)])


def cell_given(scans: ArrayLike) -> dict[str, int]:
    """Return the observations of one cell: v1, v2, ... and z1, z2, .... Equal likelihoods mean that it isn't seen."""
    seen = {f"v{t}": int(occupied != free) for t, (occupied, free) in enumerate(scans, start=1)}
    return seen | {f"z{t}": 1 for t in range(1, len(seen) + 1)}


class CellBeliefs(NamedTuple):
    """Beliefs about one cell before and after each of T scans: FREE, STATIC, DYNAMIC, UNKNOWN, (T, 4) each."""

    predicted: NDArray
    updated: NDArray


def exact_cell(
    scans: ArrayLike, dt: float = 0.1, world: WorldModel | None = None, start: Sequence[float] = NEVER_SEEN
) -> CellBeliefs:
    """Filter one cell by the forward messages of sum-product on its chain. Parameters are those of `one_cell`."""
    beliefs = sum_product(one_cell(scans, dt, world, start).model, cell_given(scans))
    steps = range(1, len(scans) + 1)
    predicted = [beliefs.messages[f"P(prior{t} | m{t - 1})", f"prior{t}"] for t in steps]
    passed = [beliefs.messages[f"m{t}", f"P(prior{t + 1} | m{t})"] for t in steps[:-1]]
    return CellBeliefs(np.array(predicted), np.array([*passed, beliefs.marginals[f"m{steps[-1]}"]]))


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
    names = tuple(f"z{t}" for t in range(1, len(scans) + 1))
    ratios = (scans / np.max(scans, axis=1, keepdims=True))[:, ::-1]
    tables = np.stack([1 - ratios, ratios], axis=-1)
    factors = [Factor(("m", name), table) for name, table in zip(names, tables, strict=True)]
    return StageGraph(
        "One cell of the log-odds grid",
        directed([binary("m", prior), *factors]),
        positions=in_rows(["m"], names),
        observed=names,
        labels={"next": "later", "front": "in front"},
        equations={"m": "free or occupied", names[-1]: "scan"},
        plates={"cells": ("m", *names)},
        cut=CUT_LOG_ODDS,
        ghosts={"next": (len(names) / 2 - 0.5, 1.3), "front": (-1.4, 0.1)},
    )


def as_the_grid(fork: StageGraph) -> StageGraph:
    """Return the graph of `one_log_odds_cell` with nothing but the grid's own model: one cell and its scans."""
    return replace(fork, cut=(), labels={}, ghosts={})


def package_log_odds_cell(scans: ArrayLike, params: LogOddsParams | None = None) -> NDArray[np.float64]:
    """Return P(occupied) after each scan by the package's `update_log_odds`, (T,).

    It is exact until it reaches a bound of `params`, where it stays.
    """
    params = params or LogOddsParams()
    L = log_odds(np.array([[params.prior]]))
    history = []
    for occupied, free in scans:
        L = update_log_odds(L, Evidence(np.array([[occupied]]), np.array([[free]])), params)
        history.append(probability(L)[0, 0])
    return np.array(history)


def read_scans(letters: str, sensor: SensorModel | None = None) -> NDArray[np.float64]:
    """Translate the scans of a cell, one letter each, into the package's likelihoods.

    Parameters
    ----------
    letters : str
        One per scan: "." for a beam that passes the cell, "#" for an obstacle return, " " for nothing.
    sensor : SensorModel, optional
        The scanner's error model; the package's default when left out.

    Returns
    -------
    (T, 2) float64
        P(z | occupied) and P(z | free) of each scan.

    Examples
    --------
    >>> read_scans(".# ").round(2).tolist()
    [[0.3, 0.7], [0.8, 0.05], [1.0, 1.0]]
    """
    read = np.array(list(letters))
    evidence = likelihoods((read == "#").astype(int), read == ".", sensor or SensorModel())
    return np.stack([evidence.occupied, evidence.free], axis=1).astype(np.float64)


CUT_LOG_ODDS = (
    CutEdge(
        "m at one scan -> m at the next",
        "The log-odds grid gives a cell one state for ever, so what moves leaves a smear until enough scans have "
        "contradicted it.",
        ("m", "next"),
    ),
    CutEdge(
        "m of the cells in front -> z1",
        "Whether a beam reaches this cell depends on what is in front of it, but the grid takes that as given, so a "
        "shadow tells it nothing about what casts it.",
        ("front", "z1"),
    ),
    CutEdge(
        "z1 - z2",
        "Given the state, the grid takes scans as independent, so an error that lasts from scan to scan is counted "
        "again with each.",
        ("z1", "z2"),
    ),
)
"""The edges that the log-odds grid cuts."""

CUT_CELL = (
    CutEdge(
        "m1 - m1 of the next cell",
        "Each cell is updated by itself, and only particles carry anything from one cell to another, so a gap that no "
        "beam hits stays a gap, however sure the filter is of the wall on both sides.",
        ("m1", "neighbour"),
    ),
    CutEdge(
        "m2 of the cells in front -> seen2",
        "Whether a beam reaches this cell depends on what is in front of it, but the filter takes that as given, so a "
        "shadow tells it nothing about what casts it.",
        ("front", "v2"),
    ),
    CutEdge(
        "z1 - z2",
        "The filter takes the scans as independent given the state, so an error that lasts for several scans is "
        "counted again with each of them.",
        ("z1", "z2"),
    ),
)
"""The edges that CMCDOT cuts in one cell."""
