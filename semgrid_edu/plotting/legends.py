"""Legends: a patch and a name for every class or state that a picture shows."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from numpy.typing import NDArray

from semgrid_edu.labels import LabelSet


def class_legend(ax: Axes, label_set: LabelSet, labels: NDArray, **style: object) -> Axes:
    """Name the classes that occur in a map of labels.

    Parameters
    ----------
    ax : Axes
    label_set : LabelSet
    labels : (...) int
        Classes as numbers; 255, unlabelled, isn't named.
    **style
        Passed on to `Axes.legend`.

    Returns
    -------
    Axes
    """
    occurring = [c for c in np.unique(labels) if c < len(label_set)]
    return colour_legend(ax, [label_set.names[c] for c in occurring], [label_set.rgb[c] for c in occurring], **style)


def colour_legend(ax: Axes, names: Sequence[str], rgb: Iterable[tuple[int, int, int]], **style: object) -> Axes:
    """Name colours, 8-bit RGB, to the right of a picture."""
    placing = {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0), "fontsize": "small", "frameon": False}
    ax.legend(handles=colour_patches(names, rgb), **(placing | style))
    return ax


def colour_patches(names: Sequence[str], rgb: Iterable[tuple[int, int, int]]) -> list[Patch]:
    """Return the entries of a legend: a patch of each colour, 8-bit RGB, with its name."""
    return [
        Patch(facecolor=np.divide(colour, 255), edgecolor="0.4", linewidth=0.5, label=name)
        for name, colour in zip(names, rgb, strict=True)
    ]
