"""Evidence by walking along every ray, cell by cell: what the polar look-up of `semgrid_edu.occupancy` replaces."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Evidence, SensorModel
from semgrid_edu.occupancy.polar import fill_gaps, polar_profile, visible_range
from semgrid_edu.occupancy.sensor import likelihoods, prepare_scan


def walk_ray(
    spec: GridSpec, azimuth: float, length: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """List the cells along a ray from the origin: it enters a new cell where it crosses a grid line.

    Parameters
    ----------
    spec : GridSpec
        The cells.
    azimuth : float
        Direction of the ray, radians from the x axis to the left.
    length : float
        How far to walk, metres; the cell in which the ray ends is the last.

    Returns
    -------
    rows, cols : (K,) int64
        The cells, nearest first.
    leaves_at : (K,) float64
        Distance from the origin at which the ray leaves each of them, metres; beyond `length` for the last.
    """
    direction = np.array([np.cos(azimuth), np.sin(azimuth)])
    height, width = spec.shape
    lines_x = spec.x_max - np.arange(height + 1) * spec.cell
    lines_y = spec.y_max - np.arange(width + 1) * spec.cell
    crossings = [
        lines / along for lines, along in zip((lines_x, lines_y), direction, strict=True) if abs(along) > 1e-12
    ]
    distance = np.unique(np.concatenate([[0.0], *crossings]).round(9))  # a corner counts as one crossing
    distance = distance[distance >= 0]
    entered = distance[:-1][distance[:-1] < length]
    leaves_at = distance[1 : len(entered) + 1]
    rows, cols, inside = spec.cells((entered + leaves_at)[:, None] / 2 * direction)
    return rows[inside], cols[inside], leaves_at[inside]


def evidence_by_rays(points: NDArray, spec: GridSpec, sensor: SensorModel) -> Evidence:
    """Turn a scan into evidence by walking along the middle of each beam.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame of the vehicle, metres.
    spec : GridSpec
        The cells, (H, W), in the same frame.
    sensor : SensorModel
        The sensor.
    """
    points = prepare_scan(points, sensor)
    first_obstacle, last_ground = polar_profile(points, sensor.obstacle_min, sensor.obstacle_max, sensor.beams)
    free_to = fill_gaps(visible_range(first_obstacle, last_ground), sensor.gap)
    obstacles = np.zeros(spec.shape, np.int64)
    free = np.zeros(spec.shape, bool)
    for (x, y, z), row, col, inside in zip(points, *spec.cells(points[:, :2]), strict=True):
        beam = int((np.arctan2(y, x) + np.pi) / (2 * np.pi) * sensor.beams) % sensor.beams
        behind = np.hypot(x, y) - first_obstacle[beam]
        if sensor.obstacle_min <= z <= sensor.obstacle_max:
            obstacles[row, col] += inside
        elif z < sensor.obstacle_min and not 0 < behind < sensor.under:
            free[row, col] |= inside
    for beam in np.flatnonzero(free_to):
        azimuth = (beam + 0.5) / sensor.beams * 2 * np.pi - np.pi
        rows, cols, leaves_at = walk_ray(spec, azimuth, free_to[beam])
        free[rows, cols] |= leaves_at <= free_to[beam]
    return likelihoods(obstacles, free, sensor)
