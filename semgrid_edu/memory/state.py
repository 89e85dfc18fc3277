"""What the memory assumes, what it holds of each cell, and what a single frame shows of it (section 3)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from semgrid_edu.errors import ArgumentError, check_fields, check_shape, not_negative, types_named
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import N_STATES, Belief, State, WorldModel

STAYS, MOVES = 0, 1
"""The two layers of the memory: what stays in a cell, such as road or house, and what moves through it."""

FAINT = 1e-3
"""The camera counts as not seeing what a layer holds below this probability: nothing is learnt there."""


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
        Measured on simulated drives other than the shipped one (`worth_by_distance`). In view a smaller exponent would
        be better, by 0.02 nats at most.
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
        Smallest probability of DYNAMIC for a cell to hold something that moves. The default is above the 0.003 that the
        filter gives anything at first sight, and far below the 0.5 from which the cell is called DYNAMIC.
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
        if not not_negative(dt):
            raise ArgumentError("dt", "seconds, not negative", dt)
        return np.exp(-np.array(self.change_rate) * dt)


@dataclass(frozen=True, eq=False)
class MemoryState:
    """What earlier frames showed of the S semantic classes in each cell of the map.

    Parameters
    ----------
    planes : (2 S + 6, H, W) float
        `evidence`, `weight`, `seen` and `offset` in one array, so that the map can be moved at once; the four are views
        of it.
    """

    planes: NDArray

    @classmethod
    def empty(cls, n_semantic: int, spec: GridSpec, dtype: DTypeLike = np.float64) -> "MemoryState":
        """Return the memory before the first frame.

        Parameters
        ----------
        n_semantic : int
            S, the number of semantic classes.
        spec : GridSpec
            The cells of the map, (H, W).
        dtype : dtype
            float64, or float32 for the functions of `semgrid_edu.fast`.
        """
        return cls(np.zeros((2 * n_semantic + 6, *spec.shape), dtype))

    def copy(self) -> "MemoryState":
        """Return a memory with arrays of its own."""
        return MemoryState(self.planes.copy())

    def at(self, places: NDArray) -> "MemoryState":
        """Return the memory of the cells with these numbers, which are counted row by row from 0.

        Parameters
        ----------
        places : (H', W') int
            Numbers of cells.
        """
        return MemoryState(self.planes.reshape(len(self.planes), -1)[:, places])

    @property
    def evidence(self) -> NDArray:
        """(2, S, H, W), for what stays and for what moves: the weighted mean of log P(class | frame) over frames."""
        return self.planes[:-6].reshape(2, -1, *self.planes.shape[1:])

    @property
    def weight(self) -> NDArray:
        """(2, H, W): the sum of the frames' exponents, from 0 to `MemoryParams.max_weight`.

        `evidence` times `weight` is the log of the belief, up to a constant in each cell. A weight below 1 counts as 1,
        because `seen` already accounts for how little was seen.
        """
        return self.planes[-6:-4]

    @property
    def seen(self) -> NDArray:
        """(2, H, W): the probability that the camera ever saw it; 0 means that nothing is known."""
        return self.planes[-4:-2]

    @property
    def offset(self) -> NDArray:
        """(2, H, W): where in its cell the moving thing is, metres from the centre along the axes of the map.

        It is at most half a cell. Without it, a thing that moves by less than that in a frame would never leave its
        cell.
        """
        return self.planes[-2:]


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
    check_look(grid, occupancy, spec, params)
    semantic = np.asarray(grid[:-N_STATES], np.float64)
    total = semantic.sum(axis=0)
    seen = total >= FAINT
    classes = np.where(seen, semantic / np.maximum(total, FAINT), 0)
    log_class = np.where(seen, np.log(np.maximum(classes, 1e-6)), 0)
    sees = np.where(seen, np.minimum(total, 1), 0)

    e = params.exponent(spec.distances())
    movable = classes[list(params.movable)].sum(axis=0)
    return Look(classes, log_class, sees, e + (1 - e) * movable, np.clip(occupancy[State.DYNAMIC], 0, 1))


def check_look(grid: NDArray, occupancy: NDArray, spec: GridSpec, params: MemoryParams) -> None:
    """Check what `look_at` takes. Parameters and errors are those of `look_at`."""
    check_shape("occupancy", occupancy, (N_STATES, *spec.shape))
    if np.ndim(grid) != 3 or grid.shape[1:] != spec.shape or len(grid) <= N_STATES:
        wanted = f"shape (C, {spec.shape[0]}, {spec.shape[1]}), the last {N_STATES} classes unknown"
        raise ArgumentError("grid", wanted, f"shape {np.shape(grid)}")
    last = len(grid) - N_STATES - 1
    if params.movable and not 0 <= min(params.movable) <= max(params.movable) <= last:
        raise ArgumentError("movable", f"numbers of semantic classes, 0 to {last}", params.movable)


def something_there(occupancy: NDArray) -> NDArray:
    """Return the probability that a cell isn't empty; an UNKNOWN cell is empty or not with equal odds.

    Parameters
    ----------
    occupancy : (4, ...) float
        Probabilities of FREE, STATIC, DYNAMIC and UNKNOWN.

    Returns
    -------
    (...) float
        The probability, at least 0.001, so that a mistaken FREE can be corrected later.
    """
    o = np.asarray(occupancy)
    return np.maximum(o[State.STATIC] + o[State.DYNAMIC] + o[State.UNKNOWN] / 2, 1e-3)
