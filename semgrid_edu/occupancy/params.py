"""The parameters of the occupancy filter and its transition matrix (paper, section 3.2, step 1)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.occupancy.sensor import SensorModel

Rates = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class CmcdotParams:
    """What the filter assumes of the world.

    The world changes in continuous time, so the transition matrix of any time step follows from rates (1/s),
    and no time means no change.

    Parameters
    ----------
    n_particles : int
        How many samples the dynamic mass has.
    rates : 4 x 4 floats
        How often a cell turns from the state of the row into that of the column, 1/s; the diagonal is
        ignored. What nobody sees is forgotten: moving things in 2 s, free space in 3 s, what stands in 10 s. In
        a free cell something appears, without having arrived there, once in 30 s, and mostly by the
        sensor's errors. UNKNOWN stays so until somebody looks (`first_sight`).
    stop_rate, stop_speed : float
        What moves slower than about `stop_speed` (m/s) stands: a particle of speed v turns STATIC at the rate
        stop_rate exp(-v^2 / (2 stop_speed^2)), 1/s: by default what doesn't move for 0.2 s stands, and
        a pedestrian's 1.4 m/s is far above the default speed.
    max_speed : float
        The velocity prior of what starts to move: any heading, speed up to this, m/s (25 m/s = 90 km/h).
    max_acceleration : float
        Largest acceleration of a particle along each axis, m/s^2: half of what tyres can do.
    birth_share : float
        Part of the particles that is spent on newborn mass, so that new things are found soon.
    first_sight : (float, float, float)
        What UNKNOWN cells turn out to be when they are first seen: FREE, STATIC, DYNAMIC; sums to 1. Most of a
        street is free, and of the obstacles on it, by area, few move. The static share also weighs against what
        flies in where nobody has looked. Who walks away from the sensor enters only such cells: with a large
        share that person seems to stand, with a small one the end of a wall that comes into view seems to move.
    sensor : SensorModel
        How the scanner errs.

    Raises
    ------
    ArgumentError
        When a parameter can't be one.
    """

    n_particles: int = 200_000
    rates: Rates = (
        # to FREE, STATIC, DYNAMIC, UNKNOWN
        (0.0, 0.02, 0.01, 0.3),
        (0.02, 0.0, 0.01, 0.1),
        (0.1, 0.1, 0.0, 0.5),
        (0.0, 0.0, 0.0, 0.0),
    )
    stop_rate: float = 5.0
    stop_speed: float = 0.4
    max_speed: float = 25.0
    max_acceleration: float = 4.0
    birth_share: float = 0.3
    first_sight: tuple[float, float, float] = (0.93, 0.067, 0.003)
    sensor: SensorModel = field(default_factory=SensorModel)

    def __post_init__(self) -> None:
        """Refuse parameters that describe no filter."""
        if not isinstance(self.n_particles, int | np.integer) or self.n_particles < 1:
            raise ArgumentError("n_particles", "a whole number of at least 1", self.n_particles)
        rates = np.asarray(self.rates, dtype=float)
        if rates.shape != (4, 4) or not np.isfinite(rates).all() or (rates < 0).any():
            raise ArgumentError("rates", "4 x 4 finite rates, none negative", self.rates)
        for name in ("stop_rate", "max_speed", "max_acceleration"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise ArgumentError(name, "a finite number, not negative", getattr(self, name))
        if not (np.isfinite(self.stop_speed) and self.stop_speed > 0):
            raise ArgumentError("stop_speed", "a positive speed in m/s", self.stop_speed)
        if len(self.first_sight) != 3 or min(self.first_sight) < 0 or not np.isclose(sum(self.first_sight), 1):
            raise ArgumentError("first_sight", "three probabilities that sum to 1", self.first_sight)
        if not 0 < self.birth_share < 1:
            raise ArgumentError("birth_share", "a share between 0 and 1", self.birth_share)


def transition_matrix(params: CmcdotParams, dt: float) -> NDArray[np.float64]:
    """Return the transition matrix of a time step, M = exp(R dt), by uniformisation.

    With r the largest rate at which a state is left, A = (R + r I) dt has no negative entry, and exp(R dt) is the sum
    of A^k / k!, its rows scaled to 1. The sum is taken over a small part of the time step, which is then doubled.
    `scipy.linalg.expm` gives the same, but takes eight milliseconds where its BLAS has two threads to wake.

    Parameters
    ----------
    params : CmcdotParams
        Its rates are the off-diagonal of R, whose rows sum to zero.
    dt : float
        Seconds, not negative.

    Returns
    -------
    (4, 4) float64
        M[i, j] is the probability that a cell in state i is in state j after `dt`; rows sum to 1.

    Raises
    ------
    ArgumentError
        When `dt` is negative or not finite.
    """
    if not (np.isfinite(dt) and dt >= 0):
        raise ArgumentError("dt", "seconds, not negative", dt)
    R = np.array(params.rates, dtype=np.float64)
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
