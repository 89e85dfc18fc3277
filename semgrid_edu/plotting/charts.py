"""Charts of numbers: the confusion matrix (paper, Table 3)."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError


def confusion(matrix: NDArray, names: Sequence[str], ax: Axes | None = None) -> Axes:
    """Draw a confusion matrix as the paper's Table 3: row truth, column prediction, per cent of the row.

    Parameters
    ----------
    matrix : (n, n) int
        Counts; a class without truth keeps an empty row.
    names : sequence of str
        Of the n classes.
    ax : Axes, optional
        Where to draw; a new figure when left out.

    Returns
    -------
    Axes

    Raises
    ------
    ArgumentError
        When names and matrix differ in number.
    """
    if np.shape(matrix) != (len(names), len(names)):
        raise ArgumentError("matrix", f"shape {(len(names),) * 2}, one row a name", f"shape {np.shape(matrix)}")
    if ax is None:
        side = 2.2 + 0.42 * len(names)
        _, ax = plt.subplots(figsize=(side, side), layout="constrained")
    totals = np.sum(matrix, axis=1, keepdims=True)
    percent = np.divide(100.0 * np.asarray(matrix), totals, where=totals > 0, out=np.full(np.shape(matrix), np.nan))
    ax.imshow(percent, cmap="Blues", vmin=0, vmax=100)
    for (row, column), value in np.ndenumerate(percent):
        if value >= 0.5:
            colour = "white" if value > 55 else "black"
            ax.text(column, row, f"{value:.0f}", ha="center", va="center", color=colour, fontsize="small")
    ax.set_xticks(range(len(names)), names, rotation=50, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(names)), names)
    ax.set(xlabel="predicted", ylabel="truth [% of its row]")
    return ax
