"""What CMCDOT assumes of the world, and how it spends its particles (paper, section 3.2)."""

from dataclasses import dataclass

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.occupancy.world import WorldModel


@dataclass(frozen=True)
class CmcdotParams(WorldModel):
    """The parameters of CMCDOT: a `WorldModel`, whose parameters come first, and how particles are spent.

    Parameters
    ----------
    rates, stop_rate, stop_speed, max_acceleration, first_sight, clearing_time, clearing_cells, sensor
        What the filter assumes of the world and of its sensor: those of `WorldModel`.
    n_particles : int
        Number of particles that carry the dynamic mass of the whole map.
    max_speed : float
        Velocity prior of things that start to move: any heading, and a speed of up to this, m/s (25 m/s = 90 km/h).
    birth_share : float
        Share of the particles, between 0 and 1, that is kept for newborn dynamic mass. Without it, new moving things
        would compete for particles with all that are known already, and would be found late.

    Raises
    ------
    ArgumentError
        When a parameter has a value that is impossible.

    Examples
    --------
    >>> params = CmcdotParams(n_particles=50_000, stop_speed=0.2)
    >>> params.n_particles, params.stop_speed, params.max_acceleration
    (50000, 0.2, 4.0)
    """

    n_particles: int = 200_000
    max_speed: float = 25.0
    birth_share: float = 0.3

    def __post_init__(self) -> None:
        """Refuse parameters that describe no filter."""
        super().__post_init__()
        if not isinstance(self.n_particles, int | np.integer) or self.n_particles < 1:
            raise ArgumentError("n_particles", "a whole number of at least 1", self.n_particles)
        if not (np.isfinite(self.max_speed) and self.max_speed >= 0):
            raise ArgumentError("max_speed", "a finite speed in m/s, not negative", self.max_speed)
        if not 0 < self.birth_share < 1:
            raise ArgumentError("birth_share", "a share between 0 and 1", self.birth_share)
