"""The LIDAR's model in compiled loops."""

from dataclasses import dataclass, fields

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.fast.occupancy.evidence import check_points
from semgrid_edu.fast.occupancy.ground import height_above_ground
from semgrid_edu.fast.occupancy.polar import beyond_reach, count_returns, fill_gaps, polar_profile
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import evidence, sensor
from semgrid_edu.occupancy.evidence import Evidence, Sensor
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.polar import reach
from semgrid_edu.occupancy.sensor import likelihoods


@dataclass(frozen=True)
class SensorModel(sensor.SensorModel):
    """The book's sensor, compiled. Parameters are those of `SensorModel`."""

    def scan(self, points: NDArray) -> "Scan":
        """Process one scan. Parameters are those of `Sensor.scan`."""
        prepared = prepare_scan(points, self)
        profile = polar_profile(prepared, self.obstacle_min, self.obstacle_max, self.beams)
        return Scan(prepared, fill_gaps(reach(*profile), self.gap), self)


@dataclass(frozen=True, eq=False)
class Scan(sensor.Scan):
    """The book's scan, compiled. Parameters are those of `Scan`."""

    def evidence(self, spec: GridSpec, pose: PlanarMotion) -> Evidence:
        """Look each cell up in its beam. Parameters and result are those of `Measurement.evidence`."""
        grid = (spec.shape, *spec.corner, float(pose.dx), float(pose.dy), float(pose.dyaw))
        obstacles, ground = count_returns(self.points, self.sensor.obstacle_min, self.sensor.obstacle_max, *grid)
        beyond = beyond_reach(self.reach, *grid)
        passed, under = beyond <= -spec.cell / 2, (beyond > spec.cell / 2) & (beyond < self.sensor.under)
        return likelihoods(obstacles, passed | ((ground > 0) & ~under), self.sensor)


def compiled_twin(model: Sensor) -> Sensor:
    """Return the compiled twin of the book's sensor; any other sensor as it is.

    Parameters
    ----------
    model : Sensor
        The sensor. A subclass of the book's that overrides how scans are processed counts as another sensor.
    """
    if type(model) is not sensor.SensorModel:
        return model
    return SensorModel(**{field.name: getattr(model, field.name) for field in fields(model)})


def scan_evidence(points: NDArray, spec: GridSpec, sensor: Sensor, pose: PlanarMotion | None = None) -> Evidence:
    """Turn a scan into evidence by the compiled twin of the sensor, if it has one.

    Parameters, result and errors are those of `scan_evidence`.
    """
    return evidence.scan_evidence(points, spec, compiled_twin(sensor), pose)


def prepare_scan(points: NDArray, sensor: sensor.SensorModel) -> NDArray:
    """Prepare a scan for evidence. Parameters and result are those of `prepare_scan`; the type is that of `points`."""
    points = without_own_returns(check_points(points), sensor.vehicle, sensor.edge, sensor.obstacle_min)
    if sensor.ground is not None:
        points[:, 2] = height_above_ground(points, sensor.ground)
    return points


@njit(cache=True, nogil=True)
def without_own_returns(
    points: NDArray, vehicle: tuple[float, float, float, float], edge: float, low: float
) -> NDArray:
    """Remove the returns that come from the vehicle itself. Parameters are those of `without_own_returns`."""
    x_min, x_max, y_min, y_max = vehicle
    others, n, columns = np.empty((len(points), 3), points.dtype), 0, points.shape[1]
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        around = edge if columns > 3 and points[i, 3] == 0 else 0.0
        beside = x_min - around < x < x_max + around and y_min - around < y < y_max + around
        if not (points[i, 4] if columns > 4 else beside and z >= low):
            others[n, 0], others[n, 1], others[n, 2] = x, y, z
            n += 1
    return others[:n]
