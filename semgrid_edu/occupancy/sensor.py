"""The LIDAR as the filter knows it: how it errs, and which of its returns count (paper, section 3.2)."""

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.occupancy.ground import GroundParams, height_above_ground
from semgrid_edu.occupancy.points import check_points


@dataclass(frozen=True)
class SensorModel:
    """How a LIDAR scan speaks of cells.

    Parameters
    ----------
    obstacle_min, obstacle_max : float
        Returns between these heights above the ground (m) are obstacles: above a kerb, below what a car
        drives under. Lower ones come from the ground, higher ones say nothing.
    azimuth_step : float
        Width of a beam, degrees: every beam of KITTI's scanner (a column of returns each 0.18 degrees) holds one
        column or two.
    column_spacing : float
        The widest gap between columns of returns that still is no hole, degrees. Our simulated scanner's is 0.9.
    p_hit_occupied, p_hit_free : float
        Probability of an obstacle return from a cell that is occupied, or free (a grazing ray, a mixed pixel).
    max_returns : int
        Returns beyond this number in one cell add nothing: they aren't independent.
    p_pass_occupied, p_pass_free : float
        Probability that a beam passes a cell that is occupied (foliage is porous, objects fill a cell in
        part), or free.
    under : float
        A ground return up to so far behind its beam's first obstacle may come from under it, from between a car's
        wheels, and says nothing: the length of a car, metres.
    vehicle : (float, float, float, float)
        Outline of the vehicle itself, x_min, x_max, y_min, y_max in the grid frame, metres: an obstacle in it is the
        vehicle's own bonnet or mirror. That of KITTI's estate car, whose LIDAR sees the end of its bonnet 2.5 m ahead.
    ground : GroundParams or None
        How the ground is found from which heights count; None for flat ground at z = 0.

    Raises
    ------
    ArgumentError
        When a parameter can't be one.
    """

    obstacle_min: float = 0.3
    obstacle_max: float = 2.5
    azimuth_step: float = 0.3
    column_spacing: float = 0.9
    p_hit_occupied: float = 0.8
    p_hit_free: float = 0.05
    max_returns: int = 2
    p_pass_occupied: float = 0.3
    p_pass_free: float = 0.7
    under: float = 5.0
    vehicle: tuple[float, float, float, float] = (-2.1, 2.7, -1.1, 1.1)
    ground: GroundParams | None = field(default_factory=GroundParams)

    def __post_init__(self) -> None:
        """Refuse a sensor that is impossible, or never errs: certainty can't be corrected."""
        if not (math.isfinite(self.under) and self.under >= 0):
            raise ArgumentError("under", "metres, not negative", self.under)
        if not 0 < self.azimuth_step <= 360:
            raise ArgumentError("azimuth_step", "degrees, above 0 and up to 360", self.azimuth_step)
        if not 0 <= self.column_spacing <= 360:
            raise ArgumentError("column_spacing", "degrees, from 0 to 360", self.column_spacing)
        if not isinstance(self.max_returns, int | np.integer) or self.max_returns < 1:
            raise ArgumentError("max_returns", "a whole number of at least 1", self.max_returns)
        if not self.obstacle_min < self.obstacle_max:
            raise ArgumentError("obstacle_min", f"less than obstacle_max, {self.obstacle_max}", self.obstacle_min)
        if len(self.vehicle) != 4 or not (self.vehicle[0] <= self.vehicle[1] and self.vehicle[2] <= self.vehicle[3]):
            raise ArgumentError("vehicle", "x_min, x_max, y_min, y_max in metres, the smaller first", self.vehicle)
        for name in ("p_hit_occupied", "p_hit_free", "p_pass_occupied", "p_pass_free"):
            if not 0 < getattr(self, name) < 1:
                raise ArgumentError(name, "a probability between 0 and 1", getattr(self, name))

    @property
    def beams(self) -> int:
        """Number of beams in a turn."""
        return round(360 / self.azimuth_step)

    @property
    def gap(self) -> int:
        """The most empty beams that neighbouring columns leave between them."""
        return math.ceil(self.column_spacing / self.azimuth_step - 1e-9)


def prepare_scan(points: NDArray, sensor: SensorModel) -> NDArray:
    """Make a scan fit for evidence: check it, leave out what the vehicle itself sends back, and find the ground.

    Parameters
    ----------
    points : (N, 3+) float
        Returns: x forward, y left, z above the ground on which the vehicle stands (m), in its grid frame; N may be 0.
    sensor : SensorModel
        For the vehicle's outline, and how the ground is found.

    Returns
    -------
    (M, 3) float
        The others, in their order: x, y, and the height above the ground at that place (m).

    Raises
    ------
    ArgumentError
        When `points` isn't a table of finite coordinates.
    """
    points = without_own_returns(check_points(points), sensor)
    if sensor.ground is not None:
        points[:, 2] = height_above_ground(points, sensor.ground)
    return points


def without_own_returns(points: NDArray, sensor: SensorModel) -> NDArray:
    """Leave out what the vehicle itself sends back: it would move along for ever, and hide what is behind it.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame of the vehicle, metres.
    sensor : SensorModel
        For the vehicle's outline, and the height from which a return is an obstacle.

    Returns
    -------
    (M, 3) float
        x, y and z of the others, in their order.
    """
    return _outside(points, *sensor.vehicle, sensor.obstacle_min)


@njit(cache=True)
def _outside(points, x_min, x_max, y_min, y_max, low):
    """Copy the points that don't lie in a box without a lid."""
    others, n = np.empty((len(points), 3), points.dtype), 0
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if not (x_min < x < x_max and y_min < y < y_max and z >= low):
            others[n, 0], others[n, 1], others[n, 2] = x, y, z
            n += 1
    return others[:n]
