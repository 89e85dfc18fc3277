"""Colours and legends for occupancy states, velocities and depths (section 3.2); class colours are in `labels`."""

from collections.abc import Iterable, Sequence
from functools import cache

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import LabelSet
from semgrid_edu.occupancy import State

STATE_NAMES = tuple(state.name.lower() for state in State)
"""Names of the occupancy states, in order."""

STATE_COLOURS = ((243, 243, 240), (38, 42, 52), (252, 114, 0), (160, 163, 168))
"""8-bit RGB of each state: free is light, static dark, dynamic a strong warm colour, unknown mid-grey."""

HEADING_COLOURS = ((30, 110, 230), (90, 200, 120), (255, 200, 0), (190, 0, 120))
"""8-bit RGB of motion forward, left, backward and right; other headings are interpolated.

Forward and backward are blue and yellow, which colour-blind readers can distinguish; left is lighter than right.
"""

WHEEL_SPEED = 16.0
"""Speed, m/s, at which a heading's colour is fully saturated (16 m/s are 58 km/h)."""

DEPTH_RANGE = (4.0, 50.0)
"""Depth range of the colour map, metres; depths outside are clipped."""


def occupancy_colours(probability: NDArray) -> NDArray[np.uint8]:
    """Colour an occupancy grid: each cell mixes the state colours, weighted by probability.

    Parameters
    ----------
    probability : (4, H, W) float
        Probabilities of FREE, STATIC, DYNAMIC and UNKNOWN, which sum to 1 in each cell.

    Returns
    -------
    (H, W, 3) uint8
        RGB.

    Raises
    ------
    ArgumentError
        When there aren't four states, or a probability isn't finite.

    Examples
    --------
    >>> occupancy_colours(np.array([0.0, 1.0, 0.0, 0.0]).reshape(4, 1, 1))
    array([[[38, 42, 52]]], dtype=uint8)
    """
    if np.ndim(probability) != 3 or len(probability) != len(STATE_COLOURS):
        raise ArgumentError("probability", "shape (4, H, W)", f"shape {np.shape(probability)}")
    if not np.isfinite(probability).all():
        raise ArgumentError("probability", "finite numbers", "NaN or infinity")
    mixed = np.einsum("shw,sk->hwk", probability, np.array(STATE_COLOURS, dtype=np.float64))
    return np.clip(np.rint(mixed), 0, 255).astype(np.uint8)


def binary_states(p_occupied: NDArray) -> NDArray:
    """Convert P(occupied) to the four states, so that a binary grid has the same colours as other grids.

    UNKNOWN decreases from 1 at P = 0.5 to 0 at 0.25 and 0.75. The rest is FREE below 0.5 and STATIC above.

    Parameters
    ----------
    p_occupied : (H, W) float
        P(occupied) of each cell.

    Returns
    -------
    (4, H, W) float
        Probabilities for `occupancy_colours`.

    Examples
    --------
    >>> binary_states(np.array([[0.1, 0.5, 0.7]]))[:, 0].round(1)
    array([[1. , 0. , 0. ],
           [0. , 0. , 0.8],
           [0. , 0. , 0. ],
           [0. , 1. , 0.2]])
    """
    free = np.clip(2 - 4 * p_occupied, 0, 1)
    occupied = np.clip(4 * p_occupied - 2, 0, 1)
    return np.stack([free, occupied, np.zeros_like(free), 1 - free - occupied])


def velocity_colours(velocity: NDArray) -> NDArray[np.uint8]:
    """Colour velocities with a colour wheel: the heading gives the hue, and slow motion is darker, like STATIC.

    The weight of the heading colour is sqrt(speed / `WHEEL_SPEED`), so that even a pedestrian has a visible colour.

    Parameters
    ----------
    velocity : (2, ...) float
        Velocity along x, forward, and along y, left, m/s. NaN gets the colour of DYNAMIC.

    Returns
    -------
    (..., 3) uint8
        RGB.

    Raises
    ------
    ArgumentError
        When there aren't two components.

    Examples
    --------
    >>> velocity_colours(np.array([[20.0, 0.0], [0.0, 0.0]]))
    array([[ 30, 110, 230],
           [ 38,  42,  52]], dtype=uint8)
    """
    if np.ndim(velocity) < 1 or len(velocity) != 2:
        raise ArgumentError("velocity", "two components, shape (2, ...)", f"shape {np.shape(velocity)}")
    vx, vy = np.asarray(velocity, dtype=np.float64)
    known = np.isfinite(vx) & np.isfinite(vy)
    vx = np.where(known, vx, 0)
    vy = np.where(known, vy, 0)
    headings = np.array([*HEADING_COLOURS, HEADING_COLOURS[0]], float)
    static = np.array(STATE_COLOURS[State.STATIC])
    quarter = np.arctan2(vy, vx) % (2 * np.pi) / (np.pi / 2)
    full = np.stack([np.interp(quarter, range(5), channel) for channel in headings.T], axis=-1)
    share = np.sqrt(np.minimum(np.hypot(vx, vy) / WHEEL_SPEED, 1))[..., None]
    mixed = np.where(known[..., None], (1 - share) * static + share * full, STATE_COLOURS[State.DYNAMIC])
    return np.rint(mixed).astype(np.uint8)


@cache
def _depth_palette() -> NDArray[np.uint8]:
    return (matplotlib.colormaps["plasma_r"](np.arange(256))[:, :3] * 255).round().astype(np.uint8)


def depth_colours(depth: NDArray) -> NDArray[np.uint8]:
    """Colour points by depth, from yellow (near) to red to blue (far), linear in log(depth).

    One metre of depth moves a near point farther in the image than a distant one, so the logarithm gives near points
    more colours.

    Parameters
    ----------
    depth : (...) float
        Depth along the camera's optical axis, metres.

    Returns
    -------
    (..., 3) uint8
        RGB.
    """
    near, far = np.log(DEPTH_RANGE)
    share = (np.log(np.clip(depth, *DEPTH_RANGE)) - near) / (far - near)
    return _depth_palette()[np.rint(share * 255).astype(np.uint8)]


def class_legend(ax: Axes, label_set: LabelSet, labels: NDArray, **style: object) -> Axes:
    """Add a legend of the classes that occur in a label map, to the right of it.

    Parameters
    ----------
    ax : Axes
        Axes for the legend.
    label_set : LabelSet
        The classes, for colours and names.
    labels : (...) int
        Class numbers; 255 (unlabelled) gets no entry.
    **style
        Passed on to `Axes.legend`.
    """
    occurring = [c for c in np.unique(labels) if c < len(label_set)]
    return colour_legend(ax, [label_set.names[c] for c in occurring], [label_set.rgb[c] for c in occurring], **style)


def colour_legend(ax: Axes, names: Sequence[str], rgb: Iterable[tuple[int, int, int]], **style: object) -> Axes:
    """Add a legend of colours to the right of a picture.

    Parameters
    ----------
    ax : Axes
        Axes for the legend.
    names : sequence of str
        Meaning of each colour.
    rgb : iterable of (int, int, int)
        One 8-bit RGB colour per name.
    **style
        Passed on to `Axes.legend`.
    """
    placing = {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0), "fontsize": "small", "frameon": False}
    ax.legend(handles=colour_patches(names, rgb), **(placing | style))
    return ax


def colour_patches(names: Sequence[str], rgb: Iterable[tuple[int, int, int]]) -> list[Patch]:
    """Return legend entries, one patch per colour. Parameters are those of `colour_legend`."""
    return [
        Patch(facecolor=np.divide(colour, 255), edgecolor="0.4", linewidth=0.5, label=name)
        for name, colour in zip(names, rgb, strict=True)
    ]
