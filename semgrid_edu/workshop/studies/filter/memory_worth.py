"""What one more frame is worth to the memory of classes, by distance: measured on drives with known truth."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE
from semgrid_edu.memory import MemoryParams, View, remember_drive

WORTHS = (0.1, 0.2, 0.35, 0.5, 0.7, 1.0)
"""Exponents to try."""

EDGES = (0.0, 10.0, 20.0, 30.0, 45.0, 75.0)
"""Distances between the bands, metres."""


class WorthByDistance(NamedTuple):
    """How well classes are known with each exponent.

    Parameters
    ----------
    log_loss : (K, B) float64
        Mean of -log P(true class) in cells that the camera sees, nats, by exponent and band of distance.
    cells : (B,) int64
        Number of cells in each band.
    best : (B,) float64
        The exponent with the smallest loss.
    """

    log_loss: NDArray[np.float64]
    cells: NDArray[np.int64]
    best: NDArray[np.float64]


def worth_by_distance(
    drives: Sequence[Sequence[View]], spec: GridSpec, worths: Sequence[float] = WORTHS, edges: Sequence[float] = EDGES
) -> WorthByDistance:
    """Remember drives with one exponent after the other, everywhere the same, and score what the camera sees.

    Parameters
    ----------
    drives : sequence of sequences of View
        What the earlier stages made of the frames of each drive; the frames are labelled.
    spec : GridSpec
        The grid, (H, W) cells.
    worths : (K,) float
        The exponents.
    edges : (B + 1,) float
        Distances between the bands, metres.
    """
    distance = np.hypot(*np.moveaxis(spec.centers(), -1, 0))
    loss, cells = np.zeros((len(worths), len(edges) - 1)), np.zeros(len(edges) - 1, np.int64)
    for k, worth in enumerate(worths):
        params = MemoryParams(worth=worth, reach=1e9)
        for views in drives:
            for view, remembered in zip(views, remember_drive(views, spec, params), strict=True):
                truth = view.frame.labels.birdseye_on(spec)
                seen = view.frame.labels.visible_on(spec) & (truth != IGNORE)
                surprise = -np.log(np.maximum(remembered[truth[seen], *np.nonzero(seen)], 1e-4))
                loss[k] += np.histogram(distance[seen], edges, weights=surprise)[0]
                cells += np.histogram(distance[seen], edges)[0] if k == 0 else 0
    loss /= np.maximum(cells, 1)
    return WorthByDistance(loss, cells, np.array(worths)[loss.argmin(axis=0)])
