"""The memory of classes over a whole drive, forward in time or in both directions (section 3)."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.memory.class_memory import ClassMemory, MemoryParams, MemoryState, View, look_at, recall_classes


def remember_drive(views: Iterable[View], spec: GridSpec, params: MemoryParams | None = None) -> Iterator[NDArray]:
    """Remember the classes of a drive, frame after frame: g -> g.

    Parameters
    ----------
    views : iterable of View
        What the earlier stages made of each frame, in the order of time.
    spec, params
        Those of `ClassMemory`.

    Yields
    ------
    (C, H, W) float
        The semantic grid with memory, after each frame.
    """
    memory = ClassMemory(spec, params)
    for view in views:
        yield memory.step(view)


def smooth_drive(views: Sequence[View], spec: GridSpec, params: MemoryParams | None = None) -> Iterator[NDArray]:
    """Return what each cell is, given the frames before and after: forward-backward.

    A second memory runs through the drive from its end, where everything moves the other way, and each frame is
    combined with both memories.

    Parameters
    ----------
    views : sequence of View
        What the earlier stages made of each frame, in the order of time.
    spec, params
        Those of `ClassMemory`.

    Yields
    ------
    (C, H, W) float
        The semantic grid of each frame: probabilities that sum to 1 in each cell.
    """
    params = params or MemoryParams()
    same_cells = np.arange(np.prod(spec.shape)).reshape(spec.shape)
    backward = ClassMemory(spec, params)
    after = []
    for view in reversed(views):
        backward.step(_reversed_in_time(view))
        # What the later frames say, without this one. The list ends with the first frame, so `pop` gives them in order.
        after.append(backward.predicted.at(backward.places))

    forward = ClassMemory(spec, params)
    for view in views:
        forward.step(view)
        both = _weighted_mean(forward.predicted.at(forward.places), after.pop(), params)
        occupancy = view.belief.probability
        yield recall_classes(both, same_cells, occupancy, look_at(view.grid, occupancy, spec, params), params)


def _reversed_in_time(view: View) -> View:
    """Return a view as it would be if time ran backwards."""
    frame = replace(view.frame, time=-view.frame.time)
    return view._replace(frame=frame, belief=replace(view.belief, velocity=-view.belief.velocity))


def _weighted_mean(past: MemoryState, future: MemoryState, params: MemoryParams) -> MemoryState:
    """Return the mean of two memories of the same cells by their weights."""
    mean = past.copy()
    weight = past.weight + future.weight
    share = (future.weight / np.maximum(weight, 1e-12))[:, None]
    mean.evidence[:] += share * (future.evidence - past.evidence)
    mean.weight[:] = np.minimum(weight, params.max_weight)
    mean.seen[:] = 1 - (1 - past.seen) * (1 - future.seen)
    return mean
