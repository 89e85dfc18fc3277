"""Class beliefs over a drive, in a map that scrolls under the vehicle by whole cells (section 3.2, step 1)."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.memory.state import ClassMemory, MemoryParams, look_at
from semgrid_edu.memory.steps import carry_classes, learn_classes, recall_classes
from semgrid_edu.occupancy import N_STATES, Belief, State
from semgrid_edu.occupancy.cmcdot import motion_since
from semgrid_edu.occupancy.planar_motion import MAX_YAW, PlanarMotion, look_up, map_around, scroll


class View(NamedTuple):
    """What the earlier stages made of one frame, as `remember` takes it.

    Parameters
    ----------
    frame : Frame
        The frame, with its pose and its time.
    belief : Belief
        o, the occupancy grid, with velocities.
    grid : (C, H, W) float32
        g, the semantic grid of this frame alone: probabilities that sum to 1 in each cell.
    """

    frame: Frame
    belief: Belief
    grid: NDArray[np.float32]


class ClassMap:
    """Give it frame after frame, and it returns semantic grids that remember the earlier ones.

    As in `Cmcdot`, the map stays aligned with the world and scrolls by whole cells, so that nothing is blurred. What is
    handed out is the map, looked up once in the vehicle's cells, joined with the frame's own evidence there.

    Parameters
    ----------
    spec : GridSpec
        The grid around the vehicle, (H, W) cells.
    n_semantic : int
        S, the number of semantic classes. The four unknown ones follow them, in the order of `State`.
    params : MemoryParams, optional
        What the memory assumes; the defaults when left out.

    Attributes
    ----------
    memory : ClassMemory
        What is remembered after the last frame, over the cells of `map_spec`.
    pose : PlanarMotion
        Pose of the vehicle in the map, metres and radians.
    """

    def __init__(self, spec: GridSpec, n_semantic: int, params: MemoryParams | None = None) -> None:
        self.spec, self.params = spec, params or MemoryParams()
        self.map_spec = map_around(spec, MAX_YAW)
        self.memory, self.pose = ClassMemory.empty(n_semantic, self.map_spec), PlanarMotion()
        self._before, self._here = self.memory, _places(self.map_spec, spec, self.pose)

    def step(self, grid: NDArray, belief: Belief, motion: PlanarMotion, dt: float) -> NDArray[np.float32]:
        """Take in one frame: move, carry, recall, learn.

        Parameters
        ----------
        grid : (C, H, W) float32
            g, the semantic grid of this frame alone: S semantic classes, then the four unknown ones.
        belief : Belief
            o of the same frame, with velocities.
        motion : PlanarMotion
            Motion of the vehicle since the last step, metres and radians.
        dt : float
            Time since the last step, seconds.

        Returns
        -------
        (C, H, W) float32
            The semantic grid with memory, in the vehicle's cells: probabilities that sum to 1 in each cell.
        """
        n = self.memory.evidence.shape[1]
        if len(grid) != n + N_STATES:
            raise ArgumentError("grid", f"{n} semantic classes and {N_STATES} unknown ones", f"{len(grid)} classes")
        look = look_at(grid, belief.probability, self.spec, self.params)
        shift, pose = scroll(self.pose.then(motion), self.map_spec.cell, MAX_YAW)
        x, y = pose.to_now(np.zeros(2))
        back = PlanarMotion(float(x), float(y), -pose.dyaw)
        memory = carry_classes(self._moved(shift), *self._movers(belief, pose, back), self.spec.cell, dt, self.params)
        here = self._here = _places(self.map_spec, self.spec, pose)
        recalled = recall_classes(memory, here, belief.probability, look, self.params)
        self._before = memory
        self.memory = learn_classes(memory, _places(self.spec, self.map_spec, back), look, self.params)
        self.pose = pose
        return recalled

    def before(self) -> ClassMemory:
        """Return what was remembered of the vehicle's cells, (H, W), before the last frame was taken in."""
        return ClassMemory(self._before.planes.reshape(len(self._before.planes), -1)[:, self._here])

    def _moved(self, shift: PlanarMotion) -> ClassMemory:
        """Return the memory in the map's new frame; nothing is known of what enters."""
        if shift == PlanarMotion():
            return self.memory
        planes = self.memory.planes
        return ClassMemory(look_up(planes, np.zeros(len(planes), np.float32), self.map_spec, self.map_spec, shift))

    def _movers(self, belief: Belief, pose: PlanarMotion, back: PlanarMotion) -> tuple[NDArray, NDArray]:
        """Return P(DYNAMIC) of the map's cells, and the velocities there along the map's axes."""
        planes = np.concatenate([belief.probability[State.DYNAMIC][None], belief.velocity])
        found = look_up(planes, np.zeros(3, np.float32), self.spec, self.map_spec, back)
        return found[0], np.einsum("ij,jhw->ihw", pose.rotation.astype(np.float32), found[1:])


def _places(source: GridSpec, target: GridSpec, pose: PlanarMotion) -> NDArray[np.int32]:
    """Return which cell of `source` each cell of `target` lies in, row by row from 0; -1 where it lies outside."""
    numbers = np.arange(np.prod(source.shape), dtype=np.float32).reshape(1, *source.shape)  # exact up to 2^24 cells
    return look_up(numbers, np.array([-1], np.float32), source, target, pose)[0].astype(np.int32)


def remember_drive(
    views: Iterable[View], spec: GridSpec, params: MemoryParams | None = None
) -> Iterator[NDArray[np.float32]]:
    """Remember the classes of a drive, frame after frame: g -> g.

    Parameters
    ----------
    views : iterable of View
        What the earlier stages made of each frame, in the order of time.
    spec : GridSpec
        The grid, (H, W) cells.
    params : MemoryParams, optional
        What the memory assumes; the defaults when left out.

    Yields
    ------
    (C, H, W) float32
        The semantic grid with memory, after each frame.
    """
    for _, grid in _steps(views, spec, params):
        yield grid


def smooth_drive(
    views: Sequence[View], spec: GridSpec, params: MemoryParams | None = None
) -> Iterator[NDArray[np.float32]]:
    """Say what each cell is with the whole drive at hand: a memory of what came before, and one of what comes after.

    This is forward-backward: a second memory runs through the drive from its end, where everything moves the other way,
    and each frame is joined with both. `smoothed_classes` is the exact algorithm on the chain of one cell.

    Parameters
    ----------
    views : sequence of View
        What the earlier stages made of each frame, in the order of time.
    spec : GridSpec
        The grid, (H, W) cells.
    params : MemoryParams, optional
        What the memories assume; the defaults when left out.

    Yields
    ------
    (C, H, W) float32
        The semantic grid of each frame: probabilities that sum to 1 in each cell.
    """
    params, same = params or MemoryParams(), np.arange(np.prod(spec.shape), dtype=np.int32).reshape(spec.shape)
    back = [one._replace(belief=replace(one.belief, velocity=-one.belief.velocity)) for one in reversed(views)]
    later = [class_map.before() for class_map, _ in _steps(back, spec, params)]
    for view, (class_map, _) in zip(views, _steps(views, spec, params), strict=True):
        both, o = _joined(class_map.before(), later.pop(), params), view.belief.probability
        yield recall_classes(both, same, o, look_at(view.grid, o, spec, params), params)


def _steps(views: Iterable[View], spec: GridSpec, params: MemoryParams | None) -> Iterator[tuple[ClassMap, NDArray]]:
    """Yield the map after each frame, and what it returned."""
    class_map, before = None, None
    for view in views:
        class_map = class_map or ClassMap(spec, len(view.grid) - N_STATES, params)
        motion, dt = motion_since(before, view.frame)
        yield class_map, class_map.step(view.grid, view.belief, motion, abs(dt))  # below 0 from the end of a drive
        before = view.frame


def _joined(past: ClassMemory, future: ClassMemory, params: MemoryParams) -> ClassMemory:
    """Weigh two memories of the same cells by what each is worth."""
    joined, weight = ClassMemory(past.planes.copy()), past.weight + future.weight
    part = (future.weight / np.maximum(weight, 1e-12))[:, None]
    joined.evidence[:] += part * (future.evidence - past.evidence)
    joined.weight[:] = np.minimum(weight, params.most)
    joined.seen[:] = 1 - (1 - past.seen) * (1 - future.seen)
    return joined
