"""What the filter believes of each cell: four states and a velocity (paper, section 3.2)."""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_shape, types_named
from semgrid_edu.grid import GridSpec


class State(IntEnum):
    """The four states of a cell, in the order of every array that holds them."""

    FREE = 0
    STATIC = 1
    DYNAMIC = 2
    UNKNOWN = 3


N_STATES = len(State)
"""Number of states, and of planes of an occupancy grid."""


@dataclass(frozen=True, eq=False)
class Belief:
    """What a filter believes of the cells in front of the vehicle, in the grid frame of the current instant.

    Parameters
    ----------
    probability : (4, H, W) float32
        P(FREE), P(STATIC), P(DYNAMIC), P(UNKNOWN) of each cell; they sum to 1.
    velocity : (2, H, W) float32
        Mean velocity over ground of what moves in the cell, along the grid's x and y axes, m/s. NaN in cells without
        dynamic mass, or with so little that no particle represents it.
    velocity_covariance : (2, 2, H, W) float32
        Covariance of that velocity along the same axes, m^2/s^2: how much it varies within the cell, and how uncertain
        it is. Symmetric and positive semi-definite; NaN where the velocity is NaN.
    steps : dict of str to (4, H, W) float32
        How the filter came to this belief: the four probabilities after "move", "predict", "update" and "resample", in
        this order, looked up at the centres of the same cells. Empty unless the filter was asked to keep them.
    """

    probability: NDArray[np.float32]
    velocity: NDArray[np.float32]
    velocity_covariance: NDArray[np.float32]
    steps: dict[str, NDArray[np.float32]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Particles:
    """Hypotheses of moving things: samples of the dynamic mass.

    Parameters
    ----------
    position : (N, 2) float32
        x, y in the frame of the map, metres. All three arrays are float64 in literal twins.
    velocity : (N, 2) float32
        Velocity over ground along the axes of the map, m/s.
    weight : (N,) float32
        Probability that each particle carries. The dynamic probability of a cell is the sum of the weights in it.
    """

    position: NDArray[np.float32]
    velocity: NDArray[np.float32]
    weight: NDArray[np.float32]

    @types_named
    def __post_init__(self) -> None:
        """Refuse arrays of different lengths: compiled loops would read beyond the end of the shorter ones."""
        for name in ("position", "velocity"):
            check_shape(name, getattr(self, name), (*np.shape(self.weight), 2))

    @classmethod
    def none(cls) -> "Particles":
        """Return an empty set of particles."""
        return cls(np.empty((0, 2), np.float32), np.empty((0, 2), np.float32), np.empty(0, np.float32))

    def __len__(self) -> int:
        """Return their number, N."""
        return len(self.weight)


@dataclass(frozen=True, eq=False)
class FilterState:
    """What the filter carries from one of its steps to the next.

    Its dynamic probability is carried twice, and the two agree: `probability[DYNAMIC]` is, in each cell,
    `newborn` plus the sum of the weights of the particles there.

    Parameters
    ----------
    probability : (4, H, W) float32
        P(FREE), P(STATIC), P(DYNAMIC), P(UNKNOWN) of each cell of the map; they sum to 1. Both arrays are float64 in
        literal twins.
    particles : Particles
        The dynamic mass whose velocity is estimated.
    newborn : (H, W) float32
        Dynamic mass that has just come into being and isn't carried by particles yet. `resample` draws them.
    """

    probability: NDArray[np.float32]
    particles: Particles
    newborn: NDArray[np.float32]

    @types_named
    def __post_init__(self) -> None:
        """Refuse planes of different sizes: compiled loops would read beyond the end of the smaller ones."""
        check_shape("probability", self.probability, (N_STATES, *np.shape(self.newborn)))

    @classmethod
    def unknown(cls, spec: GridSpec) -> "FilterState":
        """Return the state before the first scan: UNKNOWN everywhere, and no particles.

        Parameters
        ----------
        spec : GridSpec
            The cells of the map, (H, W).
        """
        probability = np.zeros((4, *spec.shape), np.float32)
        probability[State.UNKNOWN] = 1
        return cls(probability, Particles.none(), np.zeros(spec.shape, np.float32))


OUTSIDE = -1
"""The index of what lies in no cell of a grid."""


@njit(cache=True, inline="always", error_model="numpy")
def cell_of(x, y, shape, x_max, y_max, cell):
    """Return the cell that a place lies in, as an index into the flattened grid.

    Parameters
    ----------
    x, y : float
        The place, in the frame of the grid, metres.
    shape : (int, int)
        H, W of the grid.
    x_max, y_max, cell : float
        The grid's far and left border, and the side of a cell, metres.

    Returns
    -------
    int32
        row * W + column; `OUTSIDE` for a place outside the grid.
    """
    row, col = np.floor((x_max - x) / cell), np.floor((y_max - y) / cell)
    inside = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])  # `and` would branch, and be slower
    return np.int32(row * shape[1] + col if inside else OUTSIDE)


def check_part(name: str, part: object, protocol: type, example: str) -> None:
    """Refuse what can't take the place of an exchangeable part of a filter.

    Parameters
    ----------
    name : str
        Name of the argument, for the error.
    part : object
        What was handed over.
    protocol : type
        The protocol that it has to fulfil.
    example : str
        The method that it needs, and a class that has it.
    """
    expected = f"an object with a method {example}"
    if isinstance(part, type):
        raise ArgumentError(name, expected, f"the class {part.__name__} itself: write {part.__name__}()")
    if not isinstance(part, protocol):
        raise ArgumentError(name, expected, type(part).__name__)
