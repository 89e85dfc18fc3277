"""One cell of the log-odds grid as a graphical model: two states, and no change (lecture 02)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.layout import in_rows
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.stages.cell import CUT
from semgrid_edu.graphical.stages.cell_scans import check_scans
from semgrid_edu.graphical.stages.stage_graph import CutEdge, StageGraph
from semgrid_edu.occupancy import Evidence, LogOddsParams, log_odds, probability, update_log_odds

LOG_ODDS_CUT = (
    CutEdge(
        "m at one scan -> m at the next",
        "The log-odds grid gives a cell one state for ever, so what moves leaves a smear until enough scans have "
        "contradicted it.",
    ),
    *CUT[1:],
)
"""What the log-odds grid leaves out when it treats a cell by itself."""


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
    factors = [Factor((name, "m"), [1 - ratio, ratio]) for name, ratio in zip(names, ratios, strict=True)]
    return StageGraph(
        "One cell of the log-odds grid",
        GraphicalModel([Factor("m", [1 - prior, prior]), *factors], dict.fromkeys(names, ("m",))),
        observed=names,
        positions=in_rows(["m"], names),
        equations={"m": "free or occupied", names[-1]: "scan"},
        cut=LOG_ODDS_CUT,
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
