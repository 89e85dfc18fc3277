"""Two stages of your own to begin with: copy this file, change it, and compare.

    semgrid-edu demo --stages my_stages.py

A file of stages holds as many of these functions as you like; the package's own do the rest:

    track(frames, spec)  l -> o         yields (4, H, W): probability of FREE, STATIC, DYNAMIC, UNKNOWN, for each frame
    segment(image)       i -> s         (3, h, w) RGB in 0..1 -> (C, h, w) scores
    sample(s)            s -> p         (C, h, w) -> (C, D, H, W): the scores on D planes above the ground
    fuse(p, o)           (p, o) -> g    -> (C, H, W) log-probabilities of the classes
    refine(log_g, o)     g -> g         -> (C, H, W) probabilities of the classes
    remember(views, spec)  g -> g       yields (C, H, W): what all frames so far say of each cell, for each frame
"""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import SensorModel, State, scan_evidence

CERTAINTY = 0.94
"""Probability of the state that a cell is given; the three others share the rest."""

WIDTH = 1.0
"""Standard deviation of the blur, in cells."""


def track(frames: Iterable[Frame], spec: GridSpec) -> Iterator[NDArray[np.float32]]:
    """Give each cell the state that this one scan suggests: a threshold in place of a filter, without any memory.

    What does it lose? Look for things that move, and for cells that were seen a moment ago and are hidden now.

    Parameters
    ----------
    frames : iterable of Frame
        The frames of the drive in the order of time, taken one by one.
    spec : GridSpec
        The grid, (H, W) cells.

    Yields
    ------
    (4, H, W) float32
        o, the probability of FREE, STATIC, DYNAMIC and UNKNOWN; they sum to 1 in each cell.
    """
    for frame in frames:
        evidence = scan_evidence(frame.points_grid, spec, SensorModel())
        state = np.full(spec.shape, State.UNKNOWN)
        state[evidence.occupied > evidence.free] = State.STATIC  # an obstacle sent a return from here
        state[evidence.free > evidence.occupied] = State.FREE  # the ground did, or a beam passed through
        o = np.full((len(State), *spec.shape), (1 - CERTAINTY) / 3, np.float32)
        np.put_along_axis(o, state[None], CERTAINTY, axis=0)
        yield o  # only now take the next frame: a filter must not look ahead


def refine(log_g: NDArray, o: NDArray) -> NDArray[np.float32]:
    """Blur the probability of each class over the neighbouring cells, whatever stands in them.

    What does it lose? Look at edges, and compare with the CRF, which asks whether two cells have similar occupancy.

    Parameters
    ----------
    log_g : (C, H, W) float
        Natural logarithms of the probabilities of the classes.
    o : (4, H, W) float
        The occupancy grid, which this stage doesn't use.

    Returns
    -------
    (C, H, W) float32
        The blurred probabilities; they sum to 1 in each cell.
    """
    g = np.exp(log_g)
    blurred = gaussian_filter(g, sigma=(0, WIDTH, WIDTH))  # not along the class axis
    return blurred / blurred.sum(axis=0)
