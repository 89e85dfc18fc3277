"""Colours of occupancy states and of depth; those of classes stand in `labels` (paper, section 3.2)."""

from functools import cache

import matplotlib
import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.occupancy import State

STATE_NAMES = tuple(state.name.lower() for state in State)
"""The occupancy states in their order."""

STATE_COLOURS = ((243, 243, 240), (38, 42, 52), (252, 114, 0), (160, 163, 168))
"""8-bit RGB of each state: free is light, static dark, dynamic a strong warm colour, unknown mid-grey."""

DEPTH_RANGE = (4.0, 50.0)
"""Metres: nearer points take the first colour, farther ones the last."""


def occupancy_colours(probability: NDArray) -> NDArray[np.uint8]:
    """Paint an occupancy grid: each cell mixes the states' colours by their probabilities.

    Parameters
    ----------
    probability : (4, H, W) float
        FREE, STATIC, DYNAMIC, UNKNOWN; sums to 1 in each cell.

    Returns
    -------
    (H, W, 3) uint8

    Raises
    ------
    ArgumentError
        When there aren't four states.

    Examples
    --------
    >>> occupancy_colours(np.array([0.0, 1.0, 0.0, 0.0]).reshape(4, 1, 1))
    array([[[38, 42, 52]]], dtype=uint8)
    """
    if np.ndim(probability) != 3 or len(probability) != len(STATE_COLOURS):
        raise ArgumentError("probability", "shape (4, H, W)", f"shape {np.shape(probability)}")
    mixed = np.einsum("shw,sk->hwk", probability, np.array(STATE_COLOURS, dtype=np.float64))
    return np.clip(np.rint(mixed), 0, 255).astype(np.uint8)


@cache
def _depth_palette() -> NDArray[np.uint8]:
    return (matplotlib.colormaps["plasma_r"](np.arange(256))[:, :3] * 255).round().astype(np.uint8)


def depth_colours(depth: NDArray) -> NDArray[np.uint8]:
    """Colour points by depth, near to far from yellow over red to blue, evenly in log(depth).

    Near things move most from one metre to the next in the image; the logarithm gives them more colours.

    Parameters
    ----------
    depth : (...) float
        Metres.

    Returns
    -------
    (..., 3) uint8
    """
    near, far = np.log(DEPTH_RANGE)
    share = (np.log(np.clip(depth, *DEPTH_RANGE)) - near) / (far - near)
    return _depth_palette()[np.rint(share * 255).astype(np.uint8)]
