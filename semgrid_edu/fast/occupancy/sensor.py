"""The LIDAR's model in compiled loops, which read each return once and need no intermediate arrays."""

import math
from dataclasses import dataclass, fields

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.fast.occupancy.cells import cell_of
from semgrid_edu.fast.occupancy.ground import beams_of, heights_of
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import sensor as book
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.polar import fill_gaps, visible_range
from semgrid_edu.occupancy.sensor import Evidence, Sensor, edge_of_splits, likelihoods
from semgrid_edu.occupancy.state import OUTSIDE


@dataclass(frozen=True)
class SensorModel(book.SensorModel):
    """The book's sensor, compiled. Parameters are those of `SensorModel`."""

    def scan(self, points: NDArray) -> "Scan":
        """Process one scan. Parameters are those of `Sensor.scan`."""
        prepared = prepare_scan(points, self)
        profile = polar_profile(prepared, self.obstacle_min, self.obstacle_max, self.beams)
        return Scan(prepared, fill_gaps(visible_range(*profile), self.gap), self)


@dataclass(frozen=True, eq=False)
class Scan(book.Scan):
    """The book's scan, compiled. Parameters are those of `Scan`."""

    def evidence(self, spec: GridSpec, pose: PlanarMotion) -> Evidence:
        """Look each cell up in its beam. Parameters and result are those of `Measurement.evidence`."""
        grid = (spec.shape, *spec.corner, float(pose.dx), float(pose.dy), float(pose.dyaw))
        obstacles, ground = count_returns(self.points, self.sensor.obstacle_min, self.sensor.obstacle_max, *grid)
        beyond = beyond_reach(self.reach, *grid)
        passed = beyond <= -spec.cell / 2
        under = (beyond > spec.cell / 2) & (beyond < self.sensor.under)
        return likelihoods(obstacles, passed | ((ground > 0) & ~under), self.sensor)


def compiled_twin(model: Sensor) -> Sensor:
    """Return the compiled twin of the book's sensor; any other sensor as it is.

    Parameters
    ----------
    model : Sensor
        The sensor. A subclass of the book's that overrides how scans are processed counts as another sensor.
    """
    if type(model) is not book.SensorModel:
        return model
    return SensorModel(**{field.name: getattr(model, field.name) for field in fields(model)})


def scan_evidence(points: NDArray, spec: GridSpec, sensor: Sensor, pose: PlanarMotion | None = None) -> Evidence:
    """Turn a scan into evidence by the compiled twin of the sensor, if it has one.

    Parameters, result and errors are those of `scan_evidence`.
    """
    return book.scan_evidence(points, spec, compiled_twin(sensor), pose)


def prepare_scan(points: NDArray, sensor: book.SensorModel) -> NDArray:
    """Prepare a scan for evidence. Parameters and result are those of `prepare_scan`; the type is that of `points`."""
    edge = edge_of_splits(points, sensor.edge)
    points = _without_own_returns(points, sensor.vehicle, edge, sensor.obstacle_min)
    if sensor.ground is not None:
        points[:, 2] = heights_of(points, sensor.ground)
    return points


@njit(cache=True, nogil=True)
def _without_own_returns(points, vehicle, edge, low):
    x_min, x_max, y_min, y_max = vehicle
    others = np.empty((len(points), 3), points.dtype)
    n = 0
    columns = points.shape[1]
    for i in range(len(points)):
        x = points[i, 0]
        y = points[i, 1]
        z = points[i, 2]
        around = edge if columns > 3 and points[i, 3] == 0 else 0.0
        beside = x_min - around < x < x_max + around and y_min - around < y < y_max + around
        if not (points[i, 4] if columns > 4 else beside and z >= low):
            others[n, 0] = x
            others[n, 1] = y
            others[n, 2] = z
            n += 1
    return others[:n]


@njit(cache=True, nogil=True)
def polar_profile(points, low, high, beams):
    """Find the nearest obstacle and the farthest ground in each beam.

    Parameters and result are those of `polar_profile`; the result is float32.
    """
    beam_of_point = beams_of(points[:, 0], points[:, 1], beams)
    first_obstacle = np.full(beams, np.inf, np.float32)
    last_ground = np.zeros(beams, np.float32)
    for i in range(len(points)):
        x = points[i, 0]
        y = points[i, 1]
        z = points[i, 2]
        beam = beam_of_point[i]
        if z <= high:
            distance = np.sqrt(x * x + y * y)
            if z >= low:
                first_obstacle[beam] = min(first_obstacle[beam], distance)
            else:
                last_ground[beam] = max(last_ground[beam], distance)
    return first_obstacle, last_ground


@njit(cache=True, nogil=True)
def count_returns(points, low, high, shape, x_max, y_max, cell, dx, dy, dyaw):
    """Count the returns in each cell.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame of the vehicle, metres.
    low, high : float
        Heights between which a return is an obstacle, metres; a lower return is ground.
    shape, x_max, y_max, cell : (int, int), float, float, float
        The grid: H and W, its far and left border, and the side of a cell, metres.
    dx, dy, dyaw : float
        Pose of the vehicle in the frame of the grid, metres and radians.

    Returns
    -------
    obstacles, ground : (H, W) int32
        Number of obstacle and of ground returns in each cell.
    """
    obstacles = np.zeros(shape, np.int32)
    ground = np.zeros(shape, np.int32)
    cos = np.cos(dyaw)
    sin = np.sin(dyaw)
    for i in range(len(points)):
        x = points[i, 0]
        y = points[i, 1]
        z = points[i, 2]
        place = cell_of(cos * x - sin * y + dx, sin * x + cos * y + dy, shape, x_max, y_max, cell)
        if z <= high and place != OUTSIDE:
            counted = obstacles if z >= low else ground
            counted.flat[place] += 1
    return obstacles, ground


def beyond_reach(reach, shape, x_max, y_max, cell, dx, dy, dyaw):
    """Return how far each cell's centre is beyond the reach of its beam, (H, W) metres.

    Parameters
    ----------
    reach : (B,) float32
        How far each beam sees, metres.
    shape, x_max, y_max, cell, dx, dy, dyaw
        The grid and the vehicle's pose in it, as for `count_returns`.
    """
    cos = math.cos(dyaw)
    sin = math.sin(dyaw)
    from_x = x_max - (np.arange(shape[0])[:, None] + 0.5) * cell - dx
    from_y = y_max - (np.arange(shape[1]) + 0.5) * cell - dy
    x = cos * from_x + sin * from_y
    y = cos * from_y - sin * from_x
    beam = beams_of(x.ravel(), y.ravel(), len(reach)).reshape(shape)
    return (np.sqrt(x * x + y * y) - reach[beam]).astype(np.float32)
