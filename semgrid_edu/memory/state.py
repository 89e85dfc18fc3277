"""What is remembered of the classes of each cell, what one frame says of them, and what the memory assumes."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError, check_fields, check_shape, not_negative, types_named
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import N_STATES, State, WorldModel

STAYS, MOVES = 0, 1
"""The two layers of the memory: what lies and stands in a cell, and what moves through it."""

FAINT = 1e-3
"""Probability below which the camera doesn't see what a layer holds: nothing is learnt there."""


def _leaving(state: State) -> float:
    """Return the rate at which a cell leaves a state for another one that is known, 1/s."""
    return float(sum(np.delete(WorldModel().rates[state], [state, State.UNKNOWN])))


@dataclass(frozen=True)
class MemoryParams:
    """What the memory of classes assumes.

    Parameters
    ----------
    worth : float
        Exponent of the evidence of one more frame, seen from close by: 1 if frames were independent witnesses. Measured
        on simulated drives other than the shipped one (`worth_by_distance`), when `movable` classes were still
        remembered in view. Now that they aren't, a smaller exponent is better in view, by 0.02 nats at most.
    reach : float
        Distance from the vehicle, metres, over which the exponent falls by a factor e, because a near view is a better
        witness than a far one. Measured on the same drives.
    most : float
        What all frames together may be worth, in frames, at least 1. Beyond this an old frame counts for less with each
        new one. Measured on the same drives.
    change_rate : (float, float)
        Rates at which what stays and what moves becomes something else, 1/s: by default those at which, in the
        occupancy filter's `WorldModel`, a STATIC and a DYNAMIC cell change into another known state.
    movable : tuple of int
        Numbers of the classes that come and go: by default KITTI-14's car, pedestrian and bicycle. As far as the camera
        sees a cell now, this frame alone says whether one of them is there, because an earlier frame is no witness of
        what came or left since. Where it doesn't look, a remembered one counts with `standing`.
    least_moving : float
        Probability of DYNAMIC from which on a cell holds something that moves. The default lies above `first_sight`'s
        0.003 and far below the 0.5 at which the cell is called DYNAMIC.
    """

    worth: float = 0.7
    reach: float = 100.0
    most: float = 1.0
    change_rate: tuple[float, float] = (_leaving(State.STATIC), _leaving(State.DYNAMIC))
    movable: tuple[int, ...] = tuple(map(KITTI_14.index, ("car", "pedestrian", "bicycle")))
    least_moving: float = 0.02

    @types_named
    def __post_init__(self) -> None:
        """Refuse what describes no memory."""
        check_fields(self, "an exponent from 0 to 1", lambda w: 0 <= w <= 1, "worth")
        check_fields(self, "a positive distance in metres", lambda r: r > 0, "reach")
        check_fields(self, "a number of frames, at least 1", lambda n: np.isfinite(n) and n >= 1, "most")
        check_fields(self, "a probability above 0", lambda p: 0 < p <= 1, "least_moving")
        if len(self.change_rate) != 2 or not all(map(not_negative, self.change_rate)):
            raise ArgumentError("change_rate", "two rates in 1/s, not negative", self.change_rate)

    def exponent(self, distance: ArrayLike) -> NDArray[np.float64]:
        """Return what one more frame is worth for cells at a distance from the vehicle.

        Parameters
        ----------
        distance : (...) float
            Metres.
        """
        return self.worth * np.exp(-np.asarray(distance) / self.reach)

    def kept(self, dt: float) -> NDArray[np.float64]:
        """Return which part of each layer's evidence still holds after a time, (2,).

        Parameters
        ----------
        dt : float
            Seconds, not negative.
        """
        if not not_negative(dt):
            raise ArgumentError("dt", "seconds, not negative", dt)
        return np.exp(-np.array(self.change_rate) * dt)


@dataclass(frozen=True, eq=False)
class ClassMemory:
    """What earlier frames said of the S semantic classes in each cell of the map.

    Parameters
    ----------
    planes : (2 S + 6, H, W) float32
        All that is remembered, in one array, so that it can be moved at once: `evidence`, `weight`, `seen` and
        `offset`, which are views of it. float64 in literal twins.
    """

    planes: NDArray[np.float32]

    @classmethod
    def empty(cls, n_semantic: int, spec: GridSpec) -> "ClassMemory":
        """Return the memory before the first frame.

        Parameters
        ----------
        n_semantic : int
            S, the number of semantic classes.
        spec : GridSpec
            The cells of the map, (H, W).
        """
        return cls(np.zeros((2 * n_semantic + 6, *spec.shape), np.float32))

    @property
    def evidence(self) -> NDArray:
        """(2, S, H, W), for what stays and for what moves: the mean of log P(class | frame), by exponents."""
        return self.planes[:-6].reshape(2, -1, *self.planes.shape[1:])

    @property
    def weight(self) -> NDArray:
        """(2, H, W): the sum of these exponents, from 0 to `MemoryParams.most`.

        `evidence` times `weight` is the log of the belief, up to a constant in each cell. A weight below 1 counts as 1,
        because `seen` says already that little was seen.
        """
        return self.planes[-6:-4]

    @property
    def seen(self) -> NDArray:
        """(2, H, W): the probability that the camera ever saw it; 0 means that nothing is known."""
        return self.planes[-4:-2]

    @property
    def offset(self) -> NDArray:
        """(2, H, W): where in its cell the moving thing is, metres from the centre along the axes of the map.

        It is at most half a cell. Without it, what moves by less than that in a frame would never leave its cell.
        """
        return self.planes[-2:]


class Look(NamedTuple):
    """What one frame says of the classes of each cell.

    Parameters
    ----------
    classes, log_class : (S, H, W) float32
        P(class | image, the camera sees the cell), and its natural logarithm.
    sees : (H, W) float32
        Probability that the camera sees what is in the cell: that its class isn't one of the unknown ones.
    exponent : (H, W) float32
        What the frame is worth there beside others: e + (1 - e) P(movable), with e from `MemoryParams.exponent`.
    moving : (H, W) float32
        P(DYNAMIC).
    """

    classes: NDArray[np.float32]
    log_class: NDArray[np.float32]
    sees: NDArray[np.float32]
    exponent: NDArray[np.float32]
    moving: NDArray[np.float32]


def look_at(grid: NDArray, occupancy: NDArray, spec: GridSpec, params: MemoryParams) -> Look:
    """Read one frame's semantic grid as evidence.

    Parameters
    ----------
    grid : (C, H, W) float32
        g: probabilities of the semantic classes, then of the four unknown ones. They sum to 1 in each cell.
    occupancy : (4, H, W) float32
        o, the occupancy grid of the same frame.
    spec : GridSpec
        Their cells, around the vehicle.
    params : MemoryParams
        How much the frame is worth at which distance.

    Returns
    -------
    Look
        What the frame says of each cell, in the vehicle's grid.

    Raises
    ------
    ArgumentError
        When the shapes don't belong to the cells, or `params.movable` names a class that the grid lacks.
    """
    check_shape("occupancy", occupancy, (N_STATES, *spec.shape))
    if np.ndim(grid) != 3 or grid.shape[1:] != spec.shape or len(grid) <= N_STATES:
        wanted = f"shape (C, {spec.shape[0]}, {spec.shape[1]}), the last {N_STATES} classes unknown"
        raise ArgumentError("grid", wanted, f"shape {np.shape(grid)}")
    classes, log_class, sees = _seen_classes(np.ascontiguousarray(grid, np.float32), len(grid) - N_STATES)
    e, movable = _exponents(spec, params), list(params.movable)
    if movable and not 0 <= min(movable) <= max(movable) < len(classes):
        raise ArgumentError("movable", f"numbers of semantic classes, 0 to {len(classes) - 1}", params.movable)
    exponent = e + (1 - e) * classes[movable].sum(axis=0)
    return Look(classes, log_class, sees, exponent, np.clip(occupancy[State.DYNAMIC], 0, 1))


@lru_cache(maxsize=8)
def _exponents(spec: GridSpec, params: MemoryParams) -> NDArray[np.float32]:
    """Return what one more frame is worth in each cell, (H, W)."""
    return params.exponent(spec.distances()).astype(np.float32)


@njit(cache=True, nogil=True, error_model="numpy")
def _seen_classes(grid, n):
    """Divide the semantic classes by their sum; numpy would need five passes over the grid."""
    height, width = grid.shape[1:]
    classes, sees = np.zeros((n, height, width), np.float32), np.zeros((height, width), np.float32)
    log_class = np.zeros((n, height, width), np.float32)
    for r in range(height):
        for k in range(n):
            for c in range(width):
                sees[r, c] += grid[k, r, c]
        for k in range(n):
            for c in range(width):
                if sees[r, c] >= np.float32(FAINT):
                    classes[k, r, c] = grid[k, r, c] / sees[r, c]
                    log_class[k, r, c] = np.log(max(classes[k, r, c], np.float32(1e-6)))
        for c in range(width):
            sees[r, c] = min(sees[r, c], np.float32(1)) if sees[r, c] >= np.float32(FAINT) else np.float32(0)
    return classes, log_class, sees


def standing(occupancy: NDArray) -> NDArray:
    """Return the probability that something stands or moves in each cell: in an UNKNOWN one it is as likely as not.

    Parameters
    ----------
    occupancy : (4, ...) float
        Probabilities of FREE, STATIC, DYNAMIC and UNKNOWN.

    Returns
    -------
    (...) float
        The probability, at least 0.001, so that a mistaken FREE can be put right later.
    """
    o = np.asarray(occupancy)
    return np.maximum(o[State.STATIC] + o[State.DYNAMIC] + o[State.UNKNOWN] / 2, 1e-3)
