"""Class beliefs in a map that scrolls under the vehicle: carry what moves, recall, learn from a frame."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import softmax

from semgrid_edu.errors import ArgumentError, check_fields, check_seconds, check_shape, not_negative, types_named
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import N_STATES, Belief, PlanarMotion, State, WorldModel
from semgrid_edu.occupancy.cmcdot import motion_since
from semgrid_edu.occupancy.planar_motion import map_around, scroll
from semgrid_edu.occupancy.state import OUTSIDE, cells_of

STAYS, MOVES = 0, 1
"""The two layers of the memory: what stays in a cell, such as road or house, and what moves through it."""

FAINT = 1e-3
"""Below this probability of being seen, a layer learns nothing from the frame."""


def _leaving_rate(state: State) -> float:
    """Return the rate at which a cell leaves a state for another known state, 1/s."""
    return float(sum(np.delete(WorldModel().rates[state], [state, State.UNKNOWN])))


@dataclass(frozen=True)
class MemoryParams:
    """What the memory of classes assumes.

    Parameters
    ----------
    near_exponent : float
        Exponent of the evidence of one more frame, for a cell next to the vehicle: 1 if frames were independent.
        Measured on simulated drives other than the shipped one (`worlds.lecture_14_gain`). For cells that the camera
        sees, a smaller exponent would lower the log loss by at most 0.02 nats per cell.
    decay_distance : float
        Distance from the vehicle, metres, over which the exponent falls by a factor e, because far views are less
        reliable. Measured on the same drives.
    max_weight : float
        Limit of the weight of all frames together, in frames, at least 1. Once this is reached, each new frame lowers
        the weight of the old ones. Measured on the same drives.
    change_rate : (float, float)
        Rates at which what stays and what moves becomes something else, 1/s: by default those at which a STATIC and a
        DYNAMIC cell change into another known state in the occupancy filter's `WorldModel`.
    movable : tuple of int
        Numbers of the classes that come and go: by default KITTI-14's car, pedestrian and bicycle. Earlier frames tell
        nothing about a car that has just come or left, so where the camera sees a cell, only this frame decides on
        them. Elsewhere a remembered one counts as far as the LIDAR finds something (`something_there`).
    least_moving : float
        Smallest probability of DYNAMIC for a cell to hold something that moves. The default is far below the 0.5 from
        which the cell is called DYNAMIC. So an obstacle at first sight, with 0.03 to 0.06, counts as moving, too.
    """

    near_exponent: float = 0.7
    decay_distance: float = 100.0
    max_weight: float = 1.0
    change_rate: tuple[float, float] = (_leaving_rate(State.STATIC), _leaving_rate(State.DYNAMIC))
    movable: tuple[int, ...] = tuple(map(KITTI_14.index, ("car", "pedestrian", "bicycle")))
    least_moving: float = 0.02

    @types_named
    def __post_init__(self) -> None:
        """Check that the numbers describe a memory."""
        check_fields(self, "an exponent from 0 to 1", lambda w: 0 <= w <= 1, "near_exponent")
        check_fields(self, "a positive distance in metres", lambda d: d > 0, "decay_distance")
        check_fields(self, "a number of frames, at least 1", lambda n: np.isfinite(n) and n >= 1, "max_weight")
        check_fields(self, "a probability above 0", lambda p: 0 < p <= 1, "least_moving")
        if len(self.change_rate) != 2 or not all(map(not_negative, self.change_rate)):
            raise ArgumentError("change_rate", "two rates in 1/s, not negative", self.change_rate)

    def exponent(self, distance: ArrayLike) -> NDArray[np.float64]:
        """Return the exponent of one more frame for cells at a distance from the vehicle.

        Parameters
        ----------
        distance : (...) float
            Metres.
        """
        return self.near_exponent * np.exp(-np.asarray(distance) / self.decay_distance)

    def kept(self, dt: float) -> NDArray[np.float64]:
        """Return the part of each layer's evidence that still holds after a time, (2,).

        Parameters
        ----------
        dt : float
            Seconds, not negative.
        """
        check_seconds(dt)
        return np.exp(-np.array(self.change_rate) * dt)


@dataclass(frozen=True, eq=False)
class MemoryState:
    """What earlier frames showed of the S semantic classes in each cell of the map, for what stays and what moves.

    Parameters
    ----------
    evidence : (2, S, H, W) float64
        The weighted mean of log P(class | frame) over frames.
    weight : (2, H, W) float64
        The sum of the frames' exponents, from 0 to `MemoryParams.max_weight`. `evidence` times `weight` is the log of
        the belief, up to a constant in each cell. A weight below 1 counts as 1, because `seen` already accounts for how
        little was seen.
    seen : (2, H, W) float64
        The probability that the camera ever saw it; 0 means that nothing is known.
    offset : (2, H, W) float64
        Where in its cell the moving thing is, metres from the centre along the axes of the map, at most half a cell.
        Without it, a thing that moves by less than that in a frame would never leave its cell.
    """

    evidence: NDArray[np.float64]
    weight: NDArray[np.float64]
    seen: NDArray[np.float64]
    offset: NDArray[np.float64]

    @classmethod
    def empty(cls, n_semantic: int, spec: GridSpec) -> "MemoryState":
        """Return the memory before the first frame.

        Parameters
        ----------
        n_semantic : int
            S, the number of semantic classes.
        spec : GridSpec
            The cells of the map, (H, W).
        """
        return cls(np.zeros((2, n_semantic, *spec.shape)), *np.zeros((3, 2, *spec.shape)))

    def copy(self) -> "MemoryState":
        """Return a memory with arrays of its own."""
        return MemoryState(self.evidence.copy(), self.weight.copy(), self.seen.copy(), self.offset.copy())

    def at(self, places: NDArray) -> "MemoryState":
        """Return the memory of the cells with these numbers; nothing is known `OUTSIDE`. See `values_at`.

        Parameters
        ----------
        places : (H', W') int
            Numbers of cells.
        """
        return MemoryState(*(values_at(part, places) for part in (self.evidence, self.weight, self.seen, self.offset)))


def values_at(planes: NDArray, places: NDArray) -> NDArray:
    """Return the values of the cells with these numbers, and zeros `OUTSIDE`, (..., H', W').

    Parameters
    ----------
    planes : (..., H, W) float
        Values of cells, which are counted row by row from 0.
    places : (H', W') int
        Numbers of cells, or `OUTSIDE`.
    """
    found = planes.reshape(*planes.shape[:-2], -1)[..., places]
    found[..., places == OUTSIDE] = 0
    return found


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


class Look(NamedTuple):
    """What one frame shows of the classes of each cell.

    Parameters
    ----------
    classes, log_class : (S, H, W) float
        P(class | image, the camera sees the cell), and its natural logarithm.
    sees : (H, W) float
        Probability that the camera sees what is in the cell, so that its class isn't one of the unknown ones.
    exponent : (H, W) float
        How much the frame counts beside others: e + (1 - e) P(movable), with e from `MemoryParams.exponent`.
    moving : (H, W) float
        P(DYNAMIC).
    """

    classes: NDArray
    log_class: NDArray
    sees: NDArray
    exponent: NDArray
    moving: NDArray


def look_at(grid: NDArray, occupancy: NDArray, spec: GridSpec, params: MemoryParams) -> Look:
    """Read one frame's semantic grid as evidence.

    Parameters
    ----------
    grid : (C, H, W) float
        g: probabilities of the semantic classes, then of the four unknown ones. They sum to 1 in each cell.
    occupancy : (4, H, W) float
        o, the occupancy grid of the same frame.
    spec : GridSpec
        Their cells, around the vehicle.
    params : MemoryParams
        How much a frame counts at which distance.

    Raises
    ------
    ArgumentError
        When the shapes don't fit the cells, or `params.movable` names a class that the grid lacks.
    """
    check_shape("occupancy", occupancy, (N_STATES, *spec.shape))
    if np.ndim(grid) != 3 or grid.shape[1:] != spec.shape or len(grid) <= N_STATES:
        wanted = f"shape (C, {spec.shape[0]}, {spec.shape[1]}), the last {N_STATES} classes unknown"
        raise ArgumentError("grid", wanted, f"shape {np.shape(grid)}")
    last = len(grid) - N_STATES - 1
    if params.movable and not 0 <= min(params.movable) <= max(params.movable) <= last:
        raise ArgumentError("movable", f"numbers of semantic classes, 0 to {last}", params.movable)
    semantic = np.asarray(grid[:-N_STATES], np.float64)
    total = semantic.sum(axis=0)
    seen = total >= FAINT
    classes = np.where(seen, semantic / np.maximum(total, FAINT), 0)
    log_class = np.where(seen, np.log(np.maximum(classes, 1e-6)), 0)
    sees = np.where(seen, np.minimum(total, 1), 0)

    e = params.exponent(spec.distances())
    movable = classes[list(params.movable)].sum(axis=0)
    return Look(classes, log_class, sees, e + (1 - e) * movable, np.clip(occupancy[State.DYNAMIC], 0, 1))


def something_there(occupancy: NDArray) -> NDArray:
    """Return the probability that a cell isn't empty; an UNKNOWN cell is empty or not with equal odds.

    Parameters
    ----------
    occupancy : (4, ...) float
        Probabilities of FREE, STATIC, DYNAMIC and UNKNOWN.

    Returns
    -------
    (...) float
        The probability, at least 0.001, so that its logarithm is finite.
    """
    o = np.asarray(occupancy)
    return np.maximum(o[State.STATIC] + o[State.DYNAMIC] + o[State.UNKNOWN] / 2, 1e-3)


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

    now = np.stack(np.nonzero(moving >= params.least_moving))  # rows and columns, (2, N)
    displacement = np.nan_to_num(velocity[:, *now]) * dt
    # Where in its cell a thing was is known only when that cell is found, so the search is done twice.
    guess = _cells_behind(now, displacement, cell, moving.shape)
    before = _cells_behind(now, displacement + memory.offset[:, *guess], cell, moving.shape)
    carried.evidence[MOVES][:, *now] = memory.evidence[MOVES][:, *before]
    carried.weight[MOVES][*now] = memory.weight[MOVES][*before]
    carried.seen[MOVES][*now] = memory.seen[MOVES][*before]
    # Whole cells have been moved; what remains is where in its new cell the thing is.
    rest = displacement + memory.offset[:, *before] - (before - now) * cell
    carried.offset[:, *now] = np.clip(rest, -cell / 2, cell / 2)

    kept = params.kept(dt)[:, None, None]
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
    known = memory.at(places)
    movable = np.isin(np.arange(len(look.classes)), params.movable)
    # A remembered car is believed only as far as the LIDAR, a second witness, finds something.
    known.evidence[:, movable] += np.log(something_there(occupancy))
    evidence, weight, seen = _joined(known, look, np.ones((2, 1, 1)), params)
    scores = np.maximum(weight, 1)[:, None] * evidence
    belief = np.where((known.weight > 0)[:, None], _come_and_gone(scores, look, movable), look.classes)

    moving = occupancy[State.DYNAMIC]
    classes = (1 - moving) * seen[STAYS] * belief[STAYS] + moving * seen[MOVES] * belief[MOVES]
    # What a layer has never seen stays unknown: one unknown class for each state of the cell.
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
        For each of the map's cells the number of the vehicle's cell that it is in, row by row from 0; `OUTSIDE` beyond
        the vehicle's grid.
    look : Look
        What the frame shows of the vehicle's cells.
    params : MemoryParams
        How much all frames together may count.
    """
    check_shape("places", places, memory.weight.shape[1:])
    on_map = Look(*(values_at(part, places) for part in look))
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
    # As long as the weight is below what is seen now, the frame fills it up; later frames add only their exponent.
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
    predicted, places : MemoryState, (H, W) int
        The memory just before the last frame was added, and the number of the map's cell for each of the vehicle's.
    """

    def __init__(self, spec: GridSpec, params: MemoryParams | None = None) -> None:
        self.spec = spec
        self.params = params or MemoryParams()
        self.map_spec = map_around(spec, yaw=0)
        self.state: MemoryState | None = None
        self.pose = PlanarMotion()
        self.predicted: MemoryState | None = None
        self.places: NDArray | None = None
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
        look = look_at(grid, belief.probability, self.spec, self.params)
        before = self._state_for(len(look.classes))
        # The map follows the vehicle by whole cells: `moved` is the old memory in the map's new cells.
        shift, self.pose = scroll(self.pose.then(motion), self.spec.cell)
        old_spec = self.map_spec
        self.map_spec = map_around(self.spec, self.pose.dyaw)
        moved = before.at(places_of(self.map_spec, old_spec, shift))

        # Belief and velocities are those of the vehicle's cells and axes; the map needs them in its own.
        on_grid = places_of(self.map_spec, self.spec, self.pose.inverse)
        moving = values_at(belief.probability[State.DYNAMIC], on_grid)
        velocity = np.einsum("ij,jhw->ihw", self.pose.rotation, values_at(belief.velocity, on_grid))
        self.predicted = carry_classes(moved, moving, velocity, self.spec.cell, dt, self.params)
        # Recall before learning: otherwise the frame would be counted twice.
        self.places = places_of(self.spec, self.map_spec, self.pose)
        recalled = recall_classes(self.predicted, self.places, belief.probability, look, self.params)
        self.state = learn_classes(self.predicted, on_grid, look, self.params)
        return recalled

    def _state_for(self, n_semantic: int) -> MemoryState:
        """Return the memory after the last frame, after checking its classes; before the first frame it is empty."""
        if self.state is None:
            return MemoryState.empty(n_semantic, self.map_spec)
        known = self.state.evidence.shape[1]
        if n_semantic != known:
            expected = f"{known} semantic classes and {N_STATES} unknown ones"
            raise ArgumentError("grid", expected, f"{n_semantic + N_STATES} classes")
        return self.state


def places_of(spec: GridSpec, source: GridSpec, pose: PlanarMotion) -> NDArray[np.int64]:
    """Return the number of the cell of `source` that contains the centre of each cell of `spec`, or `OUTSIDE`.

    Parameters
    ----------
    spec, source : GridSpec
        The two grids, (H, W) and (H', W') cells. Those of `source` are counted row by row from 0.
    pose : PlanarMotion
        Pose of the frame of `spec` in that of `source`, metres and radians.
    """
    centers = pose.parent_from_child(spec.centers().reshape(-1, 2))
    return cells_of(centers, source).reshape(spec.shape)
