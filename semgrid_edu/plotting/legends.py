"""Legends: a patch of colour and a name for every class or state that a picture shows."""

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
        Axes that get the legend, to the right of the picture.
    label_set : LabelSet
        The classes, for colours and names.
    labels : (...) int
        Class numbers; 255 (unlabelled) gets no entry.
    **style
        Passed on to `Axes.legend`.

    Returns
    -------
    Axes
    """
    occurring = [c for c in np.unique(labels) if c < len(label_set)]
    return colour_legend(ax, [label_set.names[c] for c in occurring], [label_set.rgb[c] for c in occurring], **style)


def colour_legend(ax: Axes, names: Sequence[str], rgb: Iterable[tuple[int, int, int]], **style: object) -> Axes:
    """Name colours, to the right of a picture.

    Parameters
    ----------
    ax : Axes
        Axes that get the legend.
    names : sequence of str
        What each colour means.
    rgb : iterable of (int, int, int)
        The colours, 8-bit RGB, as many as names.
    **style
        Passed on to `Axes.legend`.

    Returns
    -------
    Axes
    """
    placing = {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0), "fontsize": "small", "frameon": False}
    ax.legend(handles=colour_patches(names, rgb), **(placing | style))
    return ax


def colour_patches(names: Sequence[str], rgb: Iterable[tuple[int, int, int]]) -> list[Patch]:
    """Return the entries of a legend.

    Parameters
    ----------
    names : sequence of str
        What each colour means.
    rgb : iterable of (int, int, int)
        The colours, 8-bit RGB, as many as names.

    Returns
    -------
    list of Patch
        One patch per colour, labelled with its name.
    """
    return [
        Patch(facecolor=np.divide(colour, 255), edgecolor="0.4", linewidth=0.5, label=name)
        for name, colour in zip(names, rgb, strict=True)
    ]
