"""Class beliefs over a drive, in a map that scrolls under the vehicle by whole cells (section 3.2, step 1)."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.memory.state import MemoryParams, MemoryState, look_at
from semgrid_edu.memory.steps import carry_classes, learn_classes, recall_classes
from semgrid_edu.occupancy import N_STATES, Belief, PlanarMotion, State
from semgrid_edu.occupancy.cmcdot import motion_since
from semgrid_edu.occupancy.planar_motion import MAX_YAW, look_up, map_around, scroll


class View(NamedTuple):
    """What the earlier stages made of one frame.

    Parameters
    ----------
    frame : Frame
        The frame, with its pose and its time.
    belief : Belief
        o, the occupancy grid, with velocities.
    grid : (C, H, W) float
        g, the semantic grid of this frame alone: probabilities of S semantic classes, then of the four unknown ones in
        the order of `State`. They sum to 1 in each cell.
    """

    frame: Frame
    belief: Belief
    grid: NDArray


class ClassMemory:
    """A memory of classes: its `step` returns a semantic grid that also remembers the earlier frames.

    As in `Cmcdot`, the map stays aligned with the world and scrolls by whole cells, so that nothing is blurred. The
    vehicle's cells look up the map once, and the result is combined with the frame.

    Parameters
    ----------
    spec : GridSpec
        The grid around the vehicle, (H, W) cells.
    params : MemoryParams, optional
        What the memory assumes; the defaults when left out.

    Attributes
    ----------
    state : MemoryState or None
        The memory after the last frame, over the cells of `map_spec`; None before the first.
    pose : PlanarMotion
        Pose of the vehicle in the map, metres and radians.
    predicted, here : MemoryState, (H, W) int
        The memory just before the last frame was added, and the number of the map's cell for each of the vehicle's.
    """

    look_at = staticmethod(look_at)
    look_up = staticmethod(look_up)
    carry = staticmethod(carry_classes)
    recall = staticmethod(recall_classes)
    learn = staticmethod(learn_classes)
    dtype = np.float64

    def __init__(self, spec: GridSpec, params: MemoryParams | None = None) -> None:
        self.spec = spec
        self.params = params or MemoryParams()
        self.map_spec = map_around(spec, MAX_YAW)
        self.state: MemoryState | None = None
        self.pose = PlanarMotion()
        self.predicted: MemoryState | None = None
        self.here: NDArray | None = None
        self._last: Frame | None = None

    def step(self, view: View) -> NDArray:
        """Take in the next frame of a drive.

        Parameters
        ----------
        view : View
            What the earlier stages made of the frame.

        Returns
        -------
        (C, H, W) float
            The semantic grid with memory, in the vehicle's cells: probabilities that sum to 1 in each cell.
        """
        motion, dt = motion_since(self._last, view.frame)
        self._last = view.frame
        return self.advance(view.grid, view.belief, motion, dt)

    def advance(self, grid: NDArray, belief: Belief, motion: PlanarMotion, dt: float) -> NDArray:
        """Move the map, carry what moves, recall, learn. The result is that of `step`.

        Parameters
        ----------
        grid : (C, H, W) float
            g, the semantic grid of this frame alone.
        belief : Belief
            o of the same frame, with velocities.
        motion : PlanarMotion
            Motion of the vehicle since the last step, metres and radians.
        dt : float
            Time since the last step, seconds.
        """
        look = self.look_at(grid, belief.probability, self.spec, self.params)
        n_semantic = len(look.classes)
        if self.state is None:
            self.state = MemoryState.empty(n_semantic, self.map_spec, self.dtype)
        if n_semantic != (known := self.state.evidence.shape[1]):
            raise ArgumentError("grid", f"{known} semantic classes and {N_STATES} unknown ones", f"{len(grid)} classes")

        shift, self.pose = scroll(self.pose.then(motion), self.map_spec.cell, MAX_YAW)
        x, y = self.pose.to_now(np.zeros(2))
        map_pose = PlanarMotion(float(x), float(y), -self.pose.dyaw)  # of the map in the vehicle's frame
        self.here = self._places(self.map_spec, self.spec, self.pose)
        on_grid = self._places(self.spec, self.map_spec, map_pose)

        moving, velocity = self._movers(belief, map_pose)
        self.predicted = self.carry(self._shifted(shift), moving, velocity, self.spec.cell, dt, self.params)
        recalled = self.recall(self.predicted, self.here, belief.probability, look, self.params)
        self.state = self.learn(self.predicted, on_grid, look, self.params)
        return recalled

    def _shifted(self, shift: PlanarMotion) -> MemoryState:
        """Return the memory in the map's new frame; nothing is known of the cells that come in."""
        if shift == PlanarMotion():
            return self.state
        planes = self.state.planes
        return MemoryState(self.look_up(planes, np.zeros(len(planes), self.dtype), self.map_spec, self.map_spec, shift))

    def _movers(self, belief: Belief, map_pose: PlanarMotion) -> tuple[NDArray, NDArray]:
        """Return P(DYNAMIC) of the map's cells, and the velocities there along the map's axes."""
        planes = np.concatenate([belief.probability[State.DYNAMIC][None], belief.velocity])
        found = self.look_up(planes, np.zeros(3, planes.dtype), self.spec, self.map_spec, map_pose)
        rotation = self.pose.rotation.astype(found.dtype)
        return found[0], np.einsum("ij,jhw->ihw", rotation, found[1:])

    def _places(self, source: GridSpec, target: GridSpec, pose: PlanarMotion) -> NDArray[np.int32]:
        """Return the number of the cell of `source` that each cell of `target` is in, row by row; -1 outside."""
        numbers = np.arange(np.prod(source.shape), dtype=np.float32).reshape(1, *source.shape)  # exact up to 2^24
        return self.look_up(numbers, np.array([-1], np.float32), source, target, pose)[0].astype(np.int32)


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
    combined with both memories. For the chain of a single cell `smoothed_classes` is the exact algorithm.

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
        after.append(backward.predicted.at(backward.here))

    forward = ClassMemory(spec, params)
    for view in views:
        forward.step(view)
        both = _weighted_mean(forward.predicted.at(forward.here), after.pop(), params)
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
    mean.weight[:] = np.minimum(weight, params.most)
    mean.seen[:] = 1 - (1 - past.seen) * (1 - future.seen)
    return mean
