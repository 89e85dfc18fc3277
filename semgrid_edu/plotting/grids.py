"""Bird's-eye maps in metres, forward up: occupancy, velocities, classes and numbers (sections 3.2, 3.4)."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LabelSet
from semgrid_edu.occupancy import State
from semgrid_edu.plotting.colours import STATE_COLOURS, STATE_NAMES, class_legend, colour_legend, occupancy_colours

ARROW_SECONDS = 0.5
"""An arrow shows the motion in this time, seconds."""

ARROW_SPACING = 2.0
"""Each square with this side length, metres, gets one arrow, so that arrows don't hide a car."""

ARROW_SPREAD = 2.5
"""Largest standard deviation of the velocity in a square that gets an arrow, m/s.

That of a thing which has been followed for half a second is 1 to 2.4 m/s, that of one which has just appeared 3 m/s and
more: nobody knows yet where it goes, or whether it moves at all.
"""


def occupancy(spec: GridSpec, probability: NDArray, ax: Axes | None = None, legend: bool = True) -> Axes:
    """Draw an occupancy grid; each cell mixes the state colours, weighted by probability.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    probability : (4, H, W) float
        Probabilities of FREE, STATIC, DYNAMIC and UNKNOWN, which sum to 1 in each cell.
    ax : Axes, optional
        Axes to draw into.
    legend : bool
        Whether to add a legend of the states.

    Raises
    ------
    ArgumentError
        When the array doesn't fit `spec`.
    """
    ax = draw_map(spec, occupancy_colours(probability), ax)
    return colour_legend(ax, STATE_NAMES, STATE_COLOURS) if legend else ax


def velocity(
    spec: GridSpec, probability: NDArray, velocity: NDArray, ax: Axes, covariance: NDArray | None = None
) -> Axes:
    """Add the arrows of `velocity_arrows` to an occupancy grid; their length is the distance covered in half a second.

    A note below the map explains this length.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    probability : (4, H, W) float
        Probabilities of FREE, STATIC, DYNAMIC and UNKNOWN.
    velocity : (2, H, W) float
        Velocity over ground, along x and y of the grid frame, m/s; NaN where nothing moves.
    ax : Axes
        Axes with the drawn grid.
    covariance : (2, 2, H, W) float, optional
        Covariance of the velocity, `Belief.velocity_covariance`, m^2/s^2.
    """
    start, speed = velocity_arrows(spec, probability, velocity, covariance)
    (x, y) = start.T
    (vx, vy) = speed.T * ARROW_SECONDS
    ax.quiver(y, x, vy, vx, angles="xy", scale_units="xy", scale=1.0, color="#6a1b9a", width=0.007, zorder=3)
    ax.set_xlabel(f"{ax.get_xlabel()}\narrows: distance covered in {ARROW_SECONDS} s")
    return ax


def velocity_arrows(
    spec: GridSpec, probability: NDArray, velocity: NDArray, covariance: NDArray | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Average the velocities of cells that are probably DYNAMIC over squares of side `ARROW_SPACING`.

    A square gets an arrow where its velocity is known: the cells agree, and each has been followed for some scans. Both
    show in the standard deviation of the velocity over the whole square, which is at most `ARROW_SPREAD`.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    probability : (4, H, W) float
        Probabilities of FREE, STATIC, DYNAMIC and UNKNOWN.
    velocity : (2, H, W) float
        Velocity over ground, along x and y of the grid frame, m/s; NaN where nothing moves.
    covariance : (2, 2, H, W) float, optional
        Covariance of the velocity in each cell, m^2/s^2; when left out, the velocities are taken as exact.

    Returns
    -------
    start : (K, 2) float64
        Mean position of the moving cells in each of K squares: x and y in the grid frame, metres.
    speed : (K, 2) float64
        Their mean velocity, m/s.
    """
    moving = np.isfinite(velocity).all(axis=0) & (probability[State.DYNAMIC] > 0.5)
    xy = spec.centers()[moving]
    _, square = np.unique(np.floor(xy / ARROW_SPACING), axis=0, return_inverse=True)
    square = square.ravel()
    count = np.maximum(np.bincount(square), 1)

    def averages(values: NDArray) -> NDArray[np.float64]:
        return np.stack([np.bincount(square, weights=column) / count for column in values], axis=-1)

    start = averages(xy.T)
    speed = averages(velocity[:, moving])
    between = averages((velocity[:, moving] - speed[square].T) ** 2).sum(axis=-1)
    within = 0.0 if covariance is None else averages(covariance[[0, 1], [0, 1]][:, moving]).sum(axis=-1)
    known = between + within <= ARROW_SPREAD**2
    return start[known], speed[known]


def grid_labels(
    spec: GridSpec, labels: NDArray, label_set: LabelSet, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw a class map, with a legend of the classes that occur.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    labels : (H, W) int
        Class of each cell; 255 (unlabelled) is white.
    label_set : LabelSet
        The classes, for colours and names.
    ax : Axes, optional
        Axes to draw into.
    legend : bool
        Whether to add a legend of the classes.

    Raises
    ------
    ArgumentError
        When the array doesn't fit `spec`.
    """
    ax = draw_map(spec, label_set.colours(labels), ax)
    return class_legend(ax, label_set, labels) if legend else ax


def label_maps(spec: GridSpec, maps: Mapping[str, NDArray], label_set: LabelSet) -> Figure:
    """Draw class maps side by side, with one legend for all of them.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    maps : mapping of str to (H, W) int
        Class maps by title, from left to right; 255 (unlabelled) is white.
    label_set : LabelSet
        The classes, for colours and names.

    Raises
    ------
    ArgumentError
        When a map doesn't fit `spec`.
    """
    figure, axes = plt.subplots(1, len(maps), figsize=(2 + 3 * len(maps), 5.5), layout="compressed", squeeze=False)
    for ax, (title, labels) in zip(axes[0], maps.items(), strict=True):
        grid_labels(spec, labels, label_set, ax=ax, legend=False).set_title(title)
    class_legend(axes[0, -1], label_set, np.stack(list(maps.values())))
    return figure


def grid_values(spec: GridSpec, values: NDArray, name: str, ax: Axes | None = None, **style: object) -> Axes:
    """Draw one number per cell, with a colour bar.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    values : (H, W) float
        The number of each cell; NaN cells stay blank.
    name : str
        Label of the colour bar: quantity and unit.
    ax : Axes, optional
        Axes to draw into.
    **style
        Passed on to `Axes.imshow` (`vmin`, `vmax`, `cmap`).

    Raises
    ------
    ArgumentError
        When the array doesn't fit `spec`.
    """
    ax = draw_map(spec, values, ax, **style)
    ax.figure.colorbar(ax.images[-1], ax=ax, label=name, shrink=0.6)
    return ax


def draw_map(spec: GridSpec, raster: NDArray, ax: Axes | None = None, **style: object) -> Axes:
    """Draw an array as a map, with axes in metres.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    raster : (H, W) float or (H, W, 3) uint8
        The number or the colour of each cell.
    ax : Axes, optional
        Axes to draw into.
    **style
        Passed on to `Axes.imshow`.

    Raises
    ------
    ArgumentError
        When the array doesn't fit `spec`.
    """
    if np.shape(raster)[:2] != spec.shape:
        raise ArgumentError("raster", f"the grid's shape {spec.shape}", f"shape {np.shape(raster)}")
    height, width = spec.shape
    size = (4.2, np.clip(0.8 + 2.5 * height / width, 2.4, 6.4))
    ax = ax or plt.subplots(figsize=size, layout="compressed")[1]
    extent = (spec.y_max, spec.y_min, spec.x_min, spec.x_max)
    ax.imshow(raster, extent=extent, origin="upper", interpolation="nearest", **style)
    ax.set(xlabel="y, to the left [m]", ylabel="x, forward [m]")
    return ax
