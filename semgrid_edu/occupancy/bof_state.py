"""What the BOF believes of each cell, and its parameters (Coue et al., IJRR 2006; paper, section 3.2)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.velocity_lattice import VelocityLattice
from semgrid_edu.occupancy.world import WorldModel

MOST_BYTES = 2e9
"""Memory that the mass of all velocities may take, in bytes; a step needs three times as much."""


@dataclass(frozen=True)
class BofParams:
    """The parameters of the BOF: the same model of the world as CMCDOT's, and a lattice of velocities.

    Parameters
    ----------
    lattice : VelocityLattice
        The velocities that the filter tells apart.
    world : WorldModel
        What the filter assumes of the world and of its sensor.
    """

    lattice: VelocityLattice = field(default_factory=VelocityLattice)
    world: WorldModel = field(default_factory=WorldModel)


@dataclass(frozen=True, eq=False)
class BofState:
    """What the BOF carries from step to step: a distribution over free, unknown and V velocities in each cell.

    Each velocity shifts its mass by whole cells, and remembers the rest of its displacement. So no mass is ever spread
    by interpolation, and slow things move too, by a cell every few steps. When the map turns, the lattice doesn't turn
    with it: its velocities are expressed in the new axes of the map.

    Parameters
    ----------
    free, unknown : (H, W) float32
        P(FREE) and P(UNKNOWN).
    occupied : (V, H, W) float32
        P(occupied, velocity). The first velocity is zero: its mass is STATIC, that of all other velocities DYNAMIC.
    velocity : (V, 2) float64
        The velocities of the lattice over ground, along the axes of the map, m/s.
    remainder : (V, 2) float64
        How far each velocity has displaced its mass beyond the whole cells by which it was shifted, along the axes of
        the map, metres.
    """

    free: NDArray[np.float32]
    unknown: NDArray[np.float32]
    occupied: NDArray[np.float32]
    velocity: NDArray[np.float64]
    remainder: NDArray[np.float64]

    @classmethod
    def nothing_known(cls, spec: GridSpec, lattice: VelocityLattice) -> "BofState":
        """Return the state before the first scan: UNKNOWN everywhere.

        Parameters
        ----------
        spec : GridSpec
            The cells, (H, W).
        lattice : VelocityLattice
            The V velocities that are told apart.

        Returns
        -------
        BofState
            P(UNKNOWN) = 1 in each cell.

        Raises
        ------
        ArgumentError
            When V x H x W numbers don't fit into memory.
        """
        shape = (len(lattice), *spec.shape)
        if (size := 4 * float(np.prod(shape, dtype=float))) > MOST_BYTES:
            expected = f"velocities x cells that take at most {MOST_BYTES / 1e9:g} GB"
            raise ArgumentError("lattice", expected, "{} x {} x {}, ".format(*shape) + f"{size / 1e9:.1f} GB")
        free, unknown = np.zeros(spec.shape, np.float32), np.ones(spec.shape, np.float32)
        return cls(free, unknown, np.zeros(shape, np.float32), lattice.velocities, np.zeros((len(lattice), 2)))

    @property
    def probability(self) -> NDArray[np.floating]:
        """(4, H, W): P(FREE), P(STATIC), P(DYNAMIC), P(UNKNOWN)."""
        return np.stack([self.free, self.occupied[0], self.occupied[1:].sum(axis=0), self.unknown])
