"""One cell by itself: of the log-odds grid (lecture 02), and of CMCDOT, a chain of four states (paper, section 3.2).

A scan enters as virtual evidence (Pearl 1988, section 2.2.2): z_t has two states, "this scan" and "any other", and
P(z_t = this scan | state) is the pair of likelihoods that the package computes. Only their ratio matters.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.layout import in_rows
from semgrid_edu.graphical.messages import sum_product
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    Evidence,
    FilterState,
    LogOddsParams,
    Particles,
    SensorModel,
    State,
    WorldModel,
    log_odds,
    predict,
    probability,
    transition_matrix,
    update,
    update_log_odds,
)
from semgrid_edu.occupancy.sensor import likelihoods
from semgrid_edu.stage_models.stage_graph import StageGraph, binary, cut_edges, directed

NEVER_SEEN = (0.0, 0.0, 0.0, 1.0)
"""The belief of a cell that no scan has seen: FREE, STATIC, DYNAMIC, UNKNOWN."""


def one_cell(
    scans: ArrayLike, dt: float = 0.1, world: WorldModel | None = None, start: Sequence[float] = NEVER_SEEN
) -> StageGraph:
    """Build the chain of one cell of CMCDOT, which repeats: predict the state, see the cell or not, read the scan.

    Between two scans the state changes by `transition_matrix`. v_t says whether scan t sees the cell. If it does,
    UNKNOWN turns into one of the other states as `first_sight` says, because UNKNOWN means that no scan has seen it.
    STATIC and DYNAMIC share P(z | occupied), FREE and UNKNOWN share P(z | free).

    Parameters
    ----------
    scans : (T, 2) float
        P(z | occupied) and P(z | free) of each scan, such as `read_scans` gives; equal where a scan says nothing.
    dt : float
        Time before each scan, seconds.
    world : WorldModel, optional
        The rates of change, and what UNKNOWN turns out to be at first sight; the defaults when left out.
    start : (4,) float
        The belief at time 0: FREE, STATIC, DYNAMIC, UNKNOWN.

    Returns
    -------
    StageGraph
        Variables m0; then, for t = 1 ... T, prior t (after prediction), v t, m t (after looking), z t.
        `cell_given(scans)` holds what is observed.

    Raises
    ------
    ArgumentError
        When a scan isn't a pair of likelihoods, or both are 0, so that nothing would be possible.
    """
    world, scans = world or WorldModel(), check_scans(scans)
    steps = range(1, len(scans) + 1)
    M, look = transition_matrix(world, dt), looking(world)
    factors = [Factor("m0", start)]
    for t, (occupied, free) in zip(steps, scans, strict=True):
        prior, v, m, z = f"prior{t}", f"v{t}", f"m{t}", f"z{t}"
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
        observed=tuple(name for t in steps for name in (f"v{t}", f"z{t}")),
        positions=in_rows([None, *above], ["m0", *chain], [None, *below]),
        labels={f"prior{t}": f"$m_{{{t}}}^-$" for t in steps}
        | {f"m{t}": f"$m_{{{t}}}$" for t in (0, *steps)}
        | {f"v{t}": "seen?" for t in steps}
        | {"neighbour": "next cell", "front": "in front"},
        equations={f"m{len(scans)}": "state", f"z{len(scans)}": "scan"},
        plates={"cells": tuple(dict.fromkeys(name for factor in factors for name in factor.names))},
        cut=cut_edges("cell"),
        ghosts={"neighbour": (0.8, 1.1), "front": (3.0, 1.1)},
    )


def looking(world: WorldModel) -> NDArray[np.float64]:
    """Return P(m | v, prior): the state stays as it is, but UNKNOWN becomes another state when a scan sees the cell.

    Parameters
    ----------
    world : WorldModel
        Its `first_sight` says what UNKNOWN becomes.

    Returns
    -------
    (2, 4, 4) float64
        Axes: whether the scan sees the cell, the state before, the state after.
    """
    seen = np.eye(4)
    seen[State.UNKNOWN] = [*world.first_sight, 0]
    return np.stack([np.eye(4), seen / seen.sum(axis=1, keepdims=True)])


def cell_given(scans: ArrayLike) -> dict[str, int]:
    """Return what is observed of one cell: whether each scan sees it, and that it was these scans.

    Parameters
    ----------
    scans : (T, 2) float
        P(z | occupied) and P(z | free) of each scan.

    Returns
    -------
    dict of str to int
        The states of v1, v2, ... and z1, z2, .... A scan whose two likelihoods are equal doesn't see the cell.
    """
    seen = {f"v{t}": int(occupied != free) for t, (occupied, free) in enumerate(check_scans(scans), start=1)}
    return seen | {f"z{t}": 1 for t in range(1, len(seen) + 1)}


class CellBeliefs(NamedTuple):
    """What is believed of one cell at each of T scans.

    Parameters
    ----------
    predicted, updated : (T, 4) float
        The belief before and after each scan: FREE, STATIC, DYNAMIC, UNKNOWN.
    """

    predicted: NDArray
    updated: NDArray


def exact_cell(
    scans: ArrayLike, dt: float = 0.1, world: WorldModel | None = None, start: Sequence[float] = NEVER_SEEN
) -> CellBeliefs:
    """Filter one cell by the forward messages of sum-product on its chain.

    Parameters and errors are those of `one_cell`.

    Returns
    -------
    CellBeliefs
        The messages from P(prior t | m t-1) to prior t, and from m t to what follows it.
    """
    beliefs = sum_product(one_cell(scans, dt, world, start).model, cell_given(scans))
    steps = range(1, len(check_scans(scans)) + 1)
    predicted = [beliefs.messages[f"P(prior{t} | m{t - 1})", f"prior{t}"] for t in steps]
    passed = [beliefs.messages[f"m{t}", f"P(prior{t + 1} | m{t})"] for t in steps[:-1]]
    return CellBeliefs(np.array(predicted), np.array([*passed, beliefs.marginals[f"m{steps[-1]}"]]))


def package_cell(
    scans: ArrayLike, dt: float = 0.1, world: WorldModel | None = None, start: Sequence[float] = NEVER_SEEN
) -> CellBeliefs:
    """Filter one cell by the package's `predict` and `update`, without particles.

    All of its dynamic mass is newborn, so none of it flies away, and none stops. Parameters and errors are those of
    `one_cell`.

    Returns
    -------
    CellBeliefs
        What the package believes, float32.
    """
    world, spec, rng = world or WorldModel(), GridSpec(0, 1, 0, 1, 1), np.random.default_rng(0)
    first = np.reshape(np.asarray(start, np.float32), (4, 1, 1))
    state = FilterState(first, Particles.none(), first[State.DYNAMIC])
    history = []
    for occupied, free in check_scans(scans):
        predicted = predict(state, spec, world, dt, rng)
        state = update(predicted, spec, Evidence(np.array([[occupied]]), np.array([[free]])), world)
        history.append((predicted.probability[:, 0, 0], state.probability[:, 0, 0]))
    return CellBeliefs(*map(np.array, zip(*history, strict=True)))


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
