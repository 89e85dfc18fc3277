"""Memories of classes that one would try first: the last few maps, averaged or multiplied cell by cell (section 3)."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from semgrid_edu.grid import GridSpec
from semgrid_edu.memory import View
from semgrid_edu.occupancy import PlanarMotion
from semgrid_edu.occupancy.planar_motion import look_up

LAST = 5
"""Number of maps that are joined: half a second."""

FAINTEST = 1e-4
"""Probability that a product takes in place of a smaller one, so that one frame alone can't forbid a class for ever."""


def mean_in_place(views: Iterable[View], spec: GridSpec) -> Iterator[NDArray]:
    """Average the last maps, cell number by cell number, as if the vehicle stood still.

    Parameters
    ----------
    views : iterable of View
        As `Stages.remember` takes them.
    spec : GridSpec
        The grid, (H, W) cells.
    """
    return _joined(views, spec, _mean, moved=False)


def mean_moved(views: Iterable[View], spec: GridSpec) -> Iterator[NDArray]:
    """Average the last maps, each looked up where the vehicle was then. Parameters are those of `mean_in_place`."""
    return _joined(views, spec, _mean)


def product_moved(views: Iterable[View], spec: GridSpec) -> Iterator[NDArray]:
    """Multiply the last maps, each looked up where the vehicle was then. Parameters are those of `mean_in_place`."""
    return _joined(views, spec, _product)


def _joined(
    views: Iterable[View], spec: GridSpec, join: Callable[[NDArray], NDArray], moved: bool = True
) -> Iterator[NDArray]:
    """Yield what `join` makes of the last maps, (K, C, H, W), in the cells of now; NaN where a map didn't reach."""
    last: deque[View] = deque(maxlen=LAST)
    for view in views:
        last.append(view)
        yield join(np.stack([_seen_from(view, earlier, spec) if moved else earlier.grid for earlier in last]))


def _seen_from(now: View, earlier: View, spec: GridSpec) -> NDArray:
    motion = PlanarMotion.from_poses(earlier.frame.T_world_from_lidar, now.frame.T_world_from_lidar)
    return look_up(earlier.grid, np.full(len(earlier.grid), np.nan, np.float32), spec, spec, motion)


def _mean(maps: NDArray) -> NDArray:
    return np.nanmean(maps, axis=0)


def _product(maps: NDArray) -> NDArray:
    return softmax(np.nansum(np.log(np.maximum(maps, FAINTEST)), axis=0), axis=0)
