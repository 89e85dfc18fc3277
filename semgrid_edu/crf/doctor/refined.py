"""Faults that the refined map shows: one label, an ignore label, the opposite of the network, or nothing new."""

from collections.abc import Iterator
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from semgrid_edu.crf.doctor.finding import Finding, finding

FEW = 100
"""Cells. A grid smaller than this, such as one computed by hand, may well get a single label."""


def refined_fault(refined: NDArray, phi: NDArray) -> Finding | None:
    """Find out what is wrong with a refined map.

    Parameters
    ----------
    refined : (C, H, W) float or (H, W) int
        Q, or a label for each cell.
    phi : (C, H, W) float64
        The costs of the classes.

    Returns
    -------
    Finding or None
        The first fault, if there is any.
    """
    if refined.shape not in (phi.shape, phi.shape[1:]):
        return finding("refined has another shape", shape=refined.shape, right=phi.shape, grid=phi.shape[1:])
    if refined.ndim == 2:
        return next(_labels(refined, phi), None)
    return next(chain(_distributions(refined, phi), _labels(refined.argmax(axis=0), phi)), None)


def _distributions(Q: NDArray, phi: NDArray) -> Iterator[Finding]:
    if not (np.isfinite(Q).all() and Q.min() >= 0 and np.abs(Q.sum(axis=0, dtype=np.float64) - 1).max() < 0.02):
        low, high = np.fmin.reduce(Q, axis=None), np.fmax.reduce(Q, axis=None)
        yield finding("refined holds no probabilities", low=low, high=high, nan=np.isnan(Q).sum(), size=Q.size)
    if phi[0].size > 1 and not np.abs(Q - softmax(-phi, axis=0)).max() > 1e-6:
        yield finding("refinement without effect")


def _labels(labels: NDArray, phi: NDArray) -> Iterator[Finding]:
    last = len(phi) - 1
    outside = (labels < 0) | (labels > last) | (labels != np.rint(labels))
    if outside.any():
        few = ", ".join(f"{label:g}" for label in np.unique(labels[outside])[:5])
        yield finding("ignore label/refined", outside=outside.sum(), size=labels.size, last=last, labels=few)
    if labels.size < FEW:
        return
    if np.ptp(labels) == 0:
        before = len(np.unique(phi.argmin(axis=0)))
        yield finding("one label/before too" if before == 1 else "one label", label=labels.flat[0], before=before)
    best, worst = np.mean(labels == phi.argmin(axis=0)), np.mean(labels == phi.argmax(axis=0))
    if worst > best:
        yield finding("refined prefers what costs most", best=best, worst=worst)
