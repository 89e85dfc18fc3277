"""What the filters assume of the world: how often cells change, how things move, what sees them (section 3.2)."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_fields, not_negative, positive_count, types_named
from semgrid_edu.occupancy.evidence import Sensor, check_sensor
from semgrid_edu.occupancy.resampling import Resampling, SystematicResampling
from semgrid_edu.occupancy.sensor import SensorModel
from semgrid_edu.occupancy.state import check_part

Rates = tuple[tuple[float, ...], ...]


HALT = 0.4
"""Besides `clearing_time` ago, a particle's place is also looked at this part of that time ago, at its halt: by default
two turns of a LIDAR ago, because what seems to move has been seen at least where it seemed to start, and once on the
way."""


class Pace(NamedTuple):
    """How fast the vehicle drives, and what that means for what may keep pace with it.

    Parameters
    ----------
    speed : float
        Speed of the vehicle along the x axis of the map, m/s, negative backwards.
    least : float
        The least speed at which something gets out of its place between the halt and now, m/s. Slower things can't
        keep pace.
    halt : float
        How long ago the halt is, seconds.
    """

    speed: float
    least: float
    halt: float

    @property
    def matters(self) -> bool:
        """Whether anything can keep pace: not with a vehicle that stands or creeps."""
        return 2 * abs(self.speed) >= self.least and self.speed != 0


@dataclass(frozen=True)
class WorldModel:
    """What CMCDOT and the BOF both assume of the world and of the sensor that looks at it.

    The world changes in continuous time: it is described by rates, in 1/s. The transition matrix of any time step
    follows from them, and a time step of zero changes nothing.

    Parameters
    ----------
    rates : 4 x 4 floats
        How often a cell changes from the state of the row to the state of the column, 1/s; the diagonal is ignored.
        By default a cell that no scan sees is forgotten: a moving thing after about 2 s, free space after 3 s, a
        standing thing after 10 s. In a free cell something appears without having arrived there about once in 30 s,
        mostly because of errors of the sensor. UNKNOWN stays UNKNOWN until a scan says something (`first_sight`).
    stop_rate, stop_speed : float
        How moving things stop. Something of speed v becomes STATIC at the rate stop_rate exp(-v^2 / (2 stop_speed^2)),
        in 1/s. So `stop_rate` (1/s) is the rate at zero speed, by default once in 0.2 s, and `stop_speed` (m/s) is the
        speed above which things rarely stop; the default lies far below a pedestrian's 1.4 m/s.
    max_acceleration : float
        Largest acceleration of moving things along each axis, m/s^2. The default is half of what tyres can do.
    first_sight : (float, float, float)
        What an UNKNOWN cell turns out to be when a scan first says something of it: the probabilities of FREE, STATIC
        and DYNAMIC, which sum to 1. Most of a street is free, and of the area covered by obstacles little moves: in the
        first scans of ten simulated drives, 95.4, 3.9 and 0.7 % of the cells that are seen. The default moves
        more than half of DYNAMIC's share to STATIC, so that a wall that comes into view isn't taken for a moving thing.
    clearing_time : float
        Time, seconds, in which a moving thing leaves the place that it takes up: a car of 4.5 m at 9 m/s, a pedestrian
        of 0.5 m at 1 m/s. So where it was that long ago, it can't be any more. With 0 the filters look neither back nor
        ahead.
    clearing_cells : float
        Number of cells by which a thing has to move before it counts as having left a place. One that is too slow for
        this in `clearing_time` is followed for longer, because a thing shows in more cells than it fills: a pedestrian
        doesn't get out of two cells of 0.5 m in half a second.
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
    clearing_time: float = 0.5
    clearing_cells: float = 3.0
    sensor: Sensor = field(default_factory=SensorModel)

    @types_named
    def __post_init__(self) -> None:
        """Refuse a world that is impossible."""
        rates = np.asarray(self.rates, dtype=float)
        if rates.shape != (4, 4) or not np.isfinite(rates).all() or (rates < 0).any():
            raise ArgumentError("rates", "4 x 4 finite rates, none negative", self.rates)
        rates_and_times = "stop_rate", "max_acceleration", "clearing_time", "clearing_cells"
        check_fields(self, "a finite number, not negative", not_negative, *rates_and_times)
        check_fields(self, "a positive speed in m/s", lambda v: np.isfinite(v) and v > 0, "stop_speed")
        if len(self.first_sight) != 3 or min(self.first_sight) < 0 or not np.isclose(sum(self.first_sight), 1):
            raise ArgumentError("first_sight", "three probabilities that sum to 1", self.first_sight)
        check_sensor(self.sensor)

    def pace(self, driven: float, dt: float, cell: float) -> Pace:
        """Return how fast the vehicle drives, and what that means for what may keep pace with it.

        Parameters
        ----------
        driven, dt : float
            How far the vehicle has driven, metres, in which time, seconds.
        cell : float
            Side of a cell, metres.
        """
        halt = HALT * self.clearing_time
        least = self.clearing_cells * cell / halt if halt > 0 else np.inf
        return Pace(float(driven) / dt if dt > 0 else 0.0, float(least), halt)


def transition_matrix(world: WorldModel, dt: float) -> NDArray[np.float64]:
    """Return the transition matrix of a time step, M = exp(R dt), by uniformisation.

    With r the largest rate at which a state is left, A = (R + r I) dt has no negative entry, and exp(R dt) is the sum
    of A^k / k! with its rows scaled to 1. The sum is taken over a small part of the time step, which is then doubled.
    `scipy.linalg.expm` gives the same, but wakes the threads of its BLAS, which go on spinning on the core that the
    scan is taken in on: a step of the filter took 28 ms with it instead of 18.

    Parameters
    ----------
    world : WorldModel
        Its rates are the off-diagonal of R, whose rows sum to zero.
    dt : float
        The time step, seconds, not negative.

    Returns
    -------
    (4, 4) float64
        M[i, j] is the probability that a cell in state i is in state j after `dt`; rows sum to 1.

    Examples
    --------
    After three seconds without a scan, this is what a free cell has become:

    >>> transition_matrix(WorldModel(), dt=3.0)[0].round(2)
    array([0.37, 0.03, 0.01, 0.59])
    """
    if not not_negative(dt):
        raise ArgumentError("dt", "seconds, not negative", dt)
    R = np.array(world.rates, dtype=np.float64)
    np.fill_diagonal(R, 0)
    leaving = R.sum(axis=1)
    np.fill_diagonal(R, leaving.max() - leaving)
    doublings = max(0, np.frexp(leaving.max())[1] + np.frexp(dt)[1] + 1)
    A = R * np.ldexp(dt, -doublings)
    M = np.eye(4)
    for k in range(14, 0, -1):
        M = np.eye(4) + A @ M / k
    M /= M.sum(axis=1, keepdims=True)
    for _ in range(doublings):
        M = M @ M
        M /= M.sum(axis=1, keepdims=True)
    return M


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
        """Refuse parameters that describe no filter."""
        super().__post_init__()
        check_fields(self, "a whole number of at least 1", positive_count, "n_particles")
        check_fields(self, "a finite speed in m/s, not negative", not_negative, "max_speed")
        check_fields(self, "a share between 0 and 1", lambda share: 0 < share < 1, "birth_share")
        example = ".draw(weight, count, rng), such as SystematicResampling()"
        check_part("resampling", self.resampling, Resampling, example)
