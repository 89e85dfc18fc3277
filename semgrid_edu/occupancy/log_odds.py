"""The log-odds grid, occupied or free: Bayes' rule as a sum (Moravec and Elfes, ICRA 1985; before section 3.2)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError, check_seconds, types_named
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion, look_up, map_around, scroll
from semgrid_edu.occupancy.sensor import Evidence, Sensor, SensorModel, check_sensor, evidence_of, take_scan

TINY = np.float32(1e-30)
"""Replaces a likelihood of 0, whose logarithm is infinite. The bounds on P(occupied) make the difference vanish."""


@dataclass(frozen=True)
class LogOddsParams:
    """The parameters of the log-odds grid.

    Parameters
    ----------
    prior : float
        P(occupied) of a cell that no scan has observed. One half favours neither state (Moravec and Elfes).
    lowest, highest : float
        Bounds that P(occupied) never leaves, so that a cell can change quickly: without bounds, a cell that was seen a
        hundred times would need about as many scans to the contrary. The defaults are OctoMap's (Hornung et
        al., Autonomous Robots 2013).
    sensor : Sensor
        Turns each scan into evidence; by default a `SensorModel`.
    """

    prior: float = 0.5
    lowest: float = 0.12
    highest: float = 0.97
    sensor: Sensor = field(default_factory=SensorModel)

    @types_named
    def __post_init__(self) -> None:
        """Check that the bounds exclude certainty and contain the prior."""
        if not 0 < self.lowest < self.highest < 1:
            raise ArgumentError("lowest, highest", "0 < lowest < highest < 1", (self.lowest, self.highest))
        if not self.lowest <= self.prior <= self.highest:
            raise ArgumentError("prior", f"a probability from {self.lowest} to {self.highest}", self.prior)
        check_sensor(self.sensor)


def log_odds(p: ArrayLike) -> NDArray[np.floating]:
    """Return L = log(p / (1 - p)) of a probability.

    Parameters
    ----------
    p : (...) float
        Probabilities between 0 and 1, but neither 0 nor 1, whose log-odds are infinite.

    Returns
    -------
    (...) float
        Their log-odds: 0 for one half, positive above.

    Examples
    --------
    >>> log_odds(np.array([0.5, 0.97])).round(2)
    array([0.  , 3.48])
    """
    p = np.asarray(p)
    if not ((p > 0) & (p < 1)).all():
        raise ArgumentError("p", "probabilities between 0 and 1, but neither", p)
    return np.log(p) - np.log1p(-p)


def probability(L: ArrayLike) -> NDArray[np.floating]:
    """Return p = 1 / (1 + exp(-L)), the inverse of `log_odds`.

    Parameters
    ----------
    L : (...) float
        Log-odds, any numbers.
    """
    return 1 / (1 + np.exp(-np.asarray(L)))


def update_log_odds(L: NDArray, evidence: Evidence, params: LogOddsParams) -> NDArray[np.floating]:
    """Update with one scan by Bayes' rule, which is a sum in log-odds.

        L(o | z) = L(o) + log( P(z | occupied) / P(z | free) )

    P(z) is the same for both states, so it has dropped out of the ratio. Nothing is subtracted, because the evidence is
    a likelihood. The log-odds of an inverse sensor model, P(o | z), already contain the prior. With such a model, the
    log-odds of the prior must be subtracted at each scan, or else every scan would count the prior again.

    Parameters
    ----------
    L : (H, W) float
        Log-odds of P(occupied) before the scan.
    evidence : Evidence
        The likelihoods of the scan, (H, W).
    params : LogOddsParams
        The bounds of P(occupied).
    """
    ratio = np.log(np.maximum(evidence.occupied, TINY)) - np.log(np.maximum(evidence.free, TINY))
    bounds = log_odds([params.lowest, params.highest]).astype(L.dtype)
    return np.clip(L + ratio.astype(L.dtype, copy=False), *bounds)


class LogOddsGrid:
    """The binary baseline: each cell is occupied or free, for ever.

    It knows nothing of motion, so moving things leave a smear: the cells that they have left stay occupied until enough
    scans have shown them free. Its map scrolls under the vehicle as that of `Cmcdot` does.

    Parameters
    ----------
    spec : GridSpec
        The grid in which the filter hands out its probabilities, (H, W) cells.
    params : LogOddsParams, optional
        The prior, the bounds and the sensor.

    Examples
    --------
    >>> grid = LogOddsGrid(GridSpec.compact())
    >>> wall = np.array([[20.25, y, 1.0] for y in np.arange(-3, 3, 0.1)])
    >>> p = grid.step(wall, PlanarMotion(), dt=0.1)
    >>> p[[101, 120, 80], 31].round(2)  # the wall, before it, behind it
    array([0.97, 0.3 , 0.5 ], dtype=float32)
    """

    def __init__(self, spec: GridSpec, params: LogOddsParams | None = None) -> None:
        self.spec = spec
        self.params = params or LogOddsParams()
        self.map_spec = map_around(spec, yaw=0)
        self._prior = np.array([log_odds(self.params.prior)], np.float32)
        self._pose = PlanarMotion()
        self._log_odds = np.full(self.map_spec.shape, self._prior, np.float32)

    def step(self, points_grid: NDArray, motion: PlanarMotion, dt: float) -> NDArray[np.float32]:
        """Process one scan, and return P(occupied) of each cell of `spec`, (H, W), in the vehicle's grid frame now.

        `dt` is only checked, because this grid assumes that nothing changes. Parameters and errors are those of
        `Cmcdot.step`.
        """
        check_seconds(dt)
        shift, pose = scroll(self._pose.then(motion), self.spec.cell)
        map_spec = map_around(self.spec, pose.dyaw)
        scan = take_scan(self.params.sensor, points_grid)
        on_map = evidence_of(scan, map_spec, pose)
        in_grid = evidence_of(scan, self.spec, PlanarMotion())
        moved = look_up(self._log_odds[None], self._prior, self.map_spec, map_spec, shift)[0]
        before = look_up(moved[None], self._prior, map_spec, self.spec, pose)[0]
        self._log_odds = update_log_odds(moved, on_map, self.params)
        self._pose = pose
        self.map_spec = map_spec
        return probability(update_log_odds(before, in_grid, self.params))


def smear_area(p_occupied: NDArray, left: NDArray[np.bool_], spec: GridSpec) -> float:
    """Measure the smear of something that has moved: the area, m^2, that it has left but still seems to occupy.

    Parameters
    ----------
    p_occupied : (H, W) float
        P(occupied) of a log-odds grid, or P(STATIC) + P(DYNAMIC) of a `Belief`.
    left : (H, W) bool
        The cells in which the thing was once, and isn't any more.
    spec : GridSpec
        The grid of these cells.
    """
    return float(np.count_nonzero((p_occupied > 0.5) & left) * spec.cell**2)
