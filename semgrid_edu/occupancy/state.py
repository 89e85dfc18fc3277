"""What is believed of each cell: four states and a velocity (paper, section 3.2)."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec


class State(IntEnum):
    """The four states of a cell, in the order of every array that holds them."""

    FREE = 0
    STATIC = 1
    DYNAMIC = 2
    UNKNOWN = 3


N_STATES = len(State)
"""Planes of an occupancy grid."""


def check_shape(name: str, values: NDArray, shape: tuple[int, ...]) -> None:
    """Refuse an array of another shape, by its name."""
    if np.shape(values) != shape:
        raise ArgumentError(name, f"shape {shape}", f"shape {np.shape(values)}")


@dataclass(frozen=True, eq=False)
class Belief:
    """What is believed of the cells in front of the vehicle, in the grid frame of the current instant.

    Parameters
    ----------
    probability : (4, H, W) float32
        P(FREE), P(STATIC), P(DYNAMIC), P(UNKNOWN) of each cell; they sum to 1.
    velocity : (2, H, W) float32
        Mean velocity over ground of what moves in the cell, along the grid's x and y axes, m/s; NaN
        without dynamic mass, or where it is too small to have got a particle.
    velocity_covariance : (2, 2, H, W) float32
        How much that velocity varies, and is in doubt, m^2/s^2: symmetric, positive semi-definite, in the same
        axes; NaN where the velocity is.
    """

    probability: NDArray[np.float32]
    velocity: NDArray[np.float32]
    velocity_covariance: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Particles:
    """Hypotheses of moving things: samples of the dynamic mass.

    Parameters
    ----------
    position : (N, 2) float32
        x, y in the frame of the map, metres.
    velocity : (N, 2) float32
        Velocity over ground in the axes of the map, m/s.
    weight : (N,) float32
        Probability that each carries; the dynamic probability of a cell is the sum of the weights in it.

    Raises
    ------
    ArgumentError
        When the three don't fit each other.
    """

    position: NDArray[np.float32]
    velocity: NDArray[np.float32]
    weight: NDArray[np.float32]

    def __post_init__(self) -> None:
        """Refuse particles of which something is missing: compiled loops would read what isn't there."""
        for name in ("position", "velocity"):
            check_shape(name, getattr(self, name), (*np.shape(self.weight), 2))

    @classmethod
    def none(cls) -> "Particles":
        """Return no particles at all."""
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
        The four states of each cell of the map; they sum to 1.
    particles : Particles
        The dynamic mass whose velocity is known, more or less.
    newborn : (H, W) float32
        Dynamic mass that has just come into being and has no particles yet: they are drawn at resampling.

    Raises
    ------
    ArgumentError
        When the two arrays don't fit each other.
    """

    probability: NDArray[np.float32]
    particles: Particles
    newborn: NDArray[np.float32]

    def __post_init__(self) -> None:
        """Refuse planes of different sizes: compiled loops would read what isn't there."""
        check_shape("probability", self.probability, (N_STATES, *np.shape(self.newborn)))

    @classmethod
    def unknown(cls, spec: GridSpec) -> "FilterState":
        """Return the state of one who has seen nothing: UNKNOWN everywhere, no particles."""
        probability = np.zeros((4, *spec.shape), np.float32)
        probability[State.UNKNOWN] = 1
        return cls(probability, Particles.none(), np.zeros(spec.shape, np.float32))
