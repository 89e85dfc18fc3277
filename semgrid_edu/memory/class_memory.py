"""Class beliefs in a map that scrolls under the vehicle: carry what moves, recall, learn from a frame (section 3.2)."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.memory.state import (
    FAINT,
    MOVES,
    STAYS,
    Look,
    MemoryParams,
    MemoryState,
    View,
    look_at,
    something_there,
)
from semgrid_edu.occupancy import N_STATES, Belief, PlanarMotion, State
from semgrid_edu.occupancy.cmcdot import motion_since
from semgrid_edu.occupancy.planar_motion import look_up, map_around, scroll


def carry_classes(
    memory: MemoryState, moving: NDArray, velocity: NDArray, cell: float, dt: float, params: MemoryParams
) -> MemoryState:
    """Predict: what moves takes its class along with the velocity field, and both layers forget.

    Each cell that holds something moving copies the class of the cell where this came from. Nothing is interpolated;
    the rest of the displacement stays in `MemoryState.offset`. Where nothing moves any more, the moving layer forgets
    at once.

    Parameters
    ----------
    memory : MemoryState
        The memory at the previous frame, over the map's cells, (H, W).
    moving : (H, W) float
        P(DYNAMIC) of these cells now.
    velocity : (2, H, W) float
        Velocity along the axes of the map, m/s; NaN, where it is unknown, counts as 0.
    cell : float
        Side of a cell, metres.
    dt : float
        Seconds since the previous frame.
    params : MemoryParams
        How fast classes are forgotten, and what counts as moving.
    """
    check_shape("moving", moving, memory.weight.shape[1:])
    check_shape("velocity", velocity, (2, *moving.shape))
    carried = memory.copy()
    for part in (carried.evidence[MOVES], carried.weight[MOVES], carried.seen[MOVES], carried.offset):
        part[:] = 0

    dtype = memory.planes.dtype
    cell = float(dtype.type(cell))  # rounded as the planes are: in `fast` to single precision
    now = np.stack(np.nonzero(moving >= params.least_moving))  # rows and columns, (2, N)
    displacement = np.nan_to_num(velocity[:, *now]) * dt
    # Where in its cell a thing was is known only when that cell is found, so the search is done twice.
    guess = _cells_behind(now, displacement, cell, moving.shape)
    before = _cells_behind(now, displacement + memory.offset[:, *guess], cell, moving.shape)
    carried.evidence[MOVES][:, *now] = memory.evidence[MOVES][:, *before]
    carried.weight[MOVES][*now] = memory.weight[MOVES][*before]
    carried.seen[MOVES][*now] = memory.seen[MOVES][*before]
    rest = displacement + memory.offset[:, *before] - (before - now) * cell
    carried.offset[:, *now] = np.clip(rest, -cell / 2, cell / 2)

    kept = params.kept(dt).astype(dtype)[:, None, None]
    carried.weight[:] *= kept
    carried.seen[:] *= kept
    return carried


def _cells_behind(cells: NDArray, displacement: NDArray, cell: float, shape: tuple[int, int]) -> NDArray[np.int64]:
    """Return the cells, (2, N), from which something moved to these. x points to row 0 and y to column 0."""
    behind = cells + np.rint(displacement / cell).astype(int)
    return np.clip(behind, 0, np.array(shape)[:, None] - 1)


def recall_classes(
    memory: MemoryState, places: NDArray, occupancy: NDArray, look: Look, params: MemoryParams
) -> NDArray[np.float64]:
    """Combine memory and frame into a semantic grid.

    The classes of what stays count with P(not DYNAMIC), those of what moves with P(DYNAMIC). Where a layer was never
    seen, its mass goes to the unknown classes of the occupancy states.

    Parameters
    ----------
    memory : MemoryState
        The memory before the frame, over the map's cells.
    places : (H, W) int
        For each of the vehicle's cells the number of the map's cell that it is in, row by row from 0.
    occupancy : (4, H, W) float
        o, the occupancy grid of the frame.
    look : Look
        What the frame shows of the vehicle's cells.
    params : MemoryParams
        How much all frames together may count, and which classes are movable.

    Returns
    -------
    (C, H, W) float
        Probabilities of the semantic and of the unknown classes, which sum to 1 in each cell.
    """
    check_shape("occupancy", occupancy, (N_STATES, *look.sees.shape))
    check_shape("places", places, look.sees.shape)
    here = memory.at(places)
    movable = np.isin(np.arange(len(look.classes)), params.movable)
    # A remembered car is believed only as far as the LIDAR, a second witness, finds something.
    here.evidence[:, movable] += np.log(something_there(occupancy))
    evidence, weight, seen = _joined(here, look, np.ones((2, 1, 1)), params)
    scores = np.maximum(weight, 1)[:, None] * evidence
    belief = np.where((here.weight > 0)[:, None], _come_and_gone(scores, look, movable), look.classes)

    moving = occupancy[State.DYNAMIC]
    classes = (1 - moving) * seen[STAYS] * belief[STAYS] + moving * seen[MOVES] * belief[MOVES]
    layers = [MOVES if state == State.DYNAMIC else STAYS for state in range(N_STATES)]
    unknown = occupancy * (1 - seen[layers])
    return np.concatenate([classes, unknown])


def _come_and_gone(scores: NDArray, look: Look, movable: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Let the frame alone decide, as far as it sees, on what comes and goes; the other classes share the rest."""
    movable = movable[:, None, None]
    decided = look.sees * look.classes + (1 - look.sees) * softmax(scores, axis=1)
    any_movable = np.where(movable, decided, 0).sum(axis=1, keepdims=True)
    others = softmax(np.where(movable, -np.inf, scores), axis=1)
    return np.where(movable, decided, (1 - any_movable) * others)


def learn_classes(memory: MemoryState, places: NDArray, look: Look, params: MemoryParams) -> MemoryState:
    """Add a frame to the memory, to each layer as far as the camera sees this layer.

    Parameters
    ----------
    memory : MemoryState
        The memory before the frame, over the map's cells, (H, W).
    places : (H, W) int
        For each of the map's cells the number of the vehicle's cell that it is in, row by row from 0; negative outside
        the vehicle's grid.
    look : Look
        What the frame shows of the vehicle's cells.
    params : MemoryParams
        How much all frames together may count.
    """
    check_shape("places", places, memory.weight.shape[1:])
    inside = places >= 0
    on_map = Look(*(part.reshape(*part.shape[:-2], -1)[..., places] * inside for part in look))
    share = np.stack([1 - on_map.moving, on_map.moving])  # of each layer in what the camera sees
    share = np.where(share * on_map.sees < FAINT, 0, share)
    learnt = memory.copy()
    learnt.evidence[:], learnt.weight[:], learnt.seen[:] = _joined(memory, on_map, share, params)
    return learnt


def _joined(memory: MemoryState, look: Look, share: NDArray, params: MemoryParams) -> tuple[NDArray, NDArray, NDArray]:
    """Return evidence, weight and seen with a frame added.

    The first view of a cell counts fully. Each further one adds its exponent, because frames make the same mistakes.
    All of them together count at most `params.max_weight`: beyond this the old ones lose weight.
    """
    sees = share * look.sees
    new = np.maximum(look.exponent * sees, sees - memory.weight)
    old = np.minimum(memory.weight, params.max_weight - new)
    total = np.maximum(old + new, 1e-12)[:, None]
    mean = (old[:, None] * memory.evidence + new[:, None] * look.log_class) / total
    evidence = np.where(new[:, None] > 0, mean, memory.evidence)
    weight = np.where(new > 0, old + new, memory.weight)
    return evidence, weight, 1 - (1 - memory.seen) * (1 - sees)


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
        self.map_spec = map_around(spec, yaw=0)
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
        before = self._state_for(len(look.classes))
        shift, self.pose = scroll(self.pose.then(motion), self.spec.cell)
        before = self._shifted(before, shift)
        moving, velocity = self._movers(belief)
        self.predicted = self.carry(before, moving, velocity, self.spec.cell, dt, self.params)
        self.here = self._places(self.map_spec, self.spec, self.pose)
        recalled = self.recall(self.predicted, self.here, belief.probability, look, self.params)
        on_grid = self._places(self.spec, self.map_spec, self.pose.inverse)
        self.state = self.learn(self.predicted, on_grid, look, self.params)
        return recalled

    def _state_for(self, n_semantic: int) -> MemoryState:
        """Return the memory after the last frame, after checking its classes; before the first frame it is empty."""
        if self.state is None:
            return MemoryState.empty(n_semantic, self.map_spec, self.dtype)
        known = self.state.evidence.shape[1]
        if n_semantic != known:
            expected = f"{known} semantic classes and {N_STATES} unknown ones"
            raise ArgumentError("grid", expected, f"{n_semantic + N_STATES} classes")
        return self.state

    def _shifted(self, state: MemoryState, shift: PlanarMotion) -> MemoryState:
        """Return the memory in the map's new frame; nothing is known of the cells that come in."""
        before, self.map_spec = self.map_spec, map_around(self.spec, self.pose.dyaw)
        planes = state.planes
        return MemoryState(self.look_up(planes, np.zeros(len(planes), self.dtype), before, self.map_spec, shift))

    def _movers(self, belief: Belief) -> tuple[NDArray, NDArray]:
        """Return P(DYNAMIC) of the map's cells, and the velocities there along the map's axes."""
        planes = np.concatenate([belief.probability[State.DYNAMIC][None], belief.velocity])
        found = self.look_up(planes, np.zeros(3, planes.dtype), self.spec, self.map_spec, self.pose.inverse)
        rotation = self.pose.rotation.astype(found.dtype)
        return found[0], np.einsum("ij,jhw->ihw", rotation, found[1:])

    def _places(self, source: GridSpec, target: GridSpec, pose: PlanarMotion) -> NDArray[np.int32]:
        """Return the number of the cell of `source` that each cell of `target` is in, row by row; -1 outside."""
        numbers = np.arange(np.prod(source.shape), dtype=np.float32).reshape(1, *source.shape)  # exact up to 2^24
        return self.look_up(numbers, np.array([-1], np.float32), source, target, pose)[0].astype(np.int32)
