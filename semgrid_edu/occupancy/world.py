"""What the filters assume about the world: how often cells change, how things move, what sees them (section 3.2)."""

from dataclasses import dataclass, field

import numpy as np

from semgrid_edu.errors import ArgumentError, check_fields, not_negative, positive_count, types_named
from semgrid_edu.occupancy.sensor import Sensor, SensorModel, check_sensor
from semgrid_edu.occupancy.state import Resampling, SystematicResampling, check_part
from semgrid_edu.occupancy.walls import Walls

Rates = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class WorldModel:
    """What CMCDOT and the BOF both assume about the world and its sensor.

    The world changes in continuous time, so it is described by rates, in 1/s. The transition matrix of any time step
    follows from them, and a time step of zero changes nothing.

    Parameters
    ----------
    rates : 4 x 4 floats
        How often a cell changes from the state of the row to the state of the column, 1/s; the diagonal is ignored.
        By default a cell that no scan sees is forgotten: a moving thing after about 2 s, free space after 3 s, a
        static thing after 10 s. In a free cell something appears without having arrived there about once in 30 s,
        mostly because of sensor errors. UNKNOWN stays UNKNOWN until a scan observes the cell (`first_sight`).
    stop_rate, stop_speed : float
        How moving things stop. Something of speed v becomes STATIC at the rate stop_rate exp(-v^2 / (2 stop_speed^2)),
        in 1/s. So `stop_rate` (1/s) is the rate at zero speed, by default once in 0.2 s, and `stop_speed` (m/s) is the
        speed above which things rarely stop; the default is far below a pedestrian's 1.4 m/s.
    max_acceleration : float
        Largest acceleration of moving things along each axis, m/s^2. The default is half of what tyres can do.
    first_sight : (float, float, float)
        What an UNKNOWN cell turns out to be when a scan first observes it: the probabilities of FREE, STATIC and
        DYNAMIC, which sum to 1. Most of a street is free, and of the area covered by obstacles little moves: in the
        first scans of ten simulated drives, 95.4, 3.9 and 0.7 % of the cells that are seen. The default moves
        more than half of DYNAMIC's share to STATIC, so that a wall that comes into view isn't taken for a moving thing.
    walls : Walls or None
        What the filters need beyond the paper in real streets, so that walls and hedges that come into view don't seem
        to move; None for the paper's filter, which is `Walls(clearing_time=0)`.
    sensor : Sensor
        Turns each scan into evidence. By default a `SensorModel`; any object will do whose `scan(points)` returns
        something with `evidence(spec, pose)`.
    """

    rates: Rates = (
        # to FREE, STATIC, DYNAMIC, UNKNOWN
        (0.0, 0.02, 0.01, 0.3),
        (0.02, 0.0, 0.01, 0.1),
        (0.1, 0.1, 0.0, 0.5),
        (0.0, 0.0, 0.0, 0.0),
    )
    stop_rate: float = 5.0
    stop_speed: float = 0.4
    max_acceleration: float = 4.0
    first_sight: tuple[float, float, float] = (0.952, 0.045, 0.003)
    walls: Walls | None = field(default_factory=Walls)
    sensor: Sensor = field(default_factory=SensorModel)

    @types_named
    def __post_init__(self) -> None:
        """Check that the world is possible."""
        rates = np.asarray(self.rates, dtype=float)
        if rates.shape != (4, 4) or not np.isfinite(rates).all() or (rates < 0).any():
            raise ArgumentError("rates", "4 x 4 finite rates, none negative", self.rates)
        check_fields(self, "a finite number, not negative", not_negative, "stop_rate", "max_acceleration")
        check_fields(self, "a positive speed in m/s", lambda v: np.isfinite(v) and v > 0, "stop_speed")
        if len(self.first_sight) != 3 or min(self.first_sight) < 0 or not np.isclose(sum(self.first_sight), 1):
            raise ArgumentError("first_sight", "three probabilities that sum to 1", self.first_sight)
        if not isinstance(self.walls, Walls | None):
            raise ArgumentError("walls", "Walls() or None", self.walls)
        check_sensor(self.sensor)
        if self.walls is None:
            object.__setattr__(self, "walls", Walls(clearing_time=0))


@dataclass(frozen=True)
class CmcdotParams(WorldModel):
    """The parameters of CMCDOT: a `WorldModel`, whose parameters come first, and how particles are spent.

    Parameters
    ----------
    rates, stop_rate, stop_speed, max_acceleration, first_sight, walls, sensor
        What the filter assumes about the world and its sensor: those of `WorldModel`.
    n_particles : int
        Number of particles that carry the dynamic mass of the whole map.
    max_speed : float
        Velocity prior of things that start to move: any heading, and a speed of up to this, m/s (25 m/s = 90 km/h).
    birth_share : float
        Share of the particles, between 0 and 1, that is kept for newborn dynamic mass. Without it, new moving things
        would compete for particles with all that are known already, and would be found late.
    resampling : Resampling
        How indices are drawn in proportion to weights. By default a `SystematicResampling`; any object will do whose
        `draw(weight, count, rng)` returns indices.

    Examples
    --------
    >>> params = CmcdotParams(n_particles=50_000, stop_speed=0.2)
    >>> params.n_particles, params.stop_speed, params.max_acceleration
    (50000, 0.2, 4.0)
    """

    n_particles: int = 200_000
    max_speed: float = 25.0
    birth_share: float = 0.3
    resampling: Resampling = field(default_factory=SystematicResampling)

    @types_named
    def __post_init__(self) -> None:
        """Check that the parameters describe a filter."""
        super().__post_init__()
        check_fields(self, "a whole number of at least 1", positive_count, "n_particles")
        check_fields(self, "a finite speed in m/s, not negative", not_negative, "max_speed")
        check_fields(self, "a share between 0 and 1", lambda share: 0 < share < 1, "birth_share")
        example = ".draw(weight, count, rng), such as SystematicResampling()"
        check_part("resampling", self.resampling, Resampling, example)
