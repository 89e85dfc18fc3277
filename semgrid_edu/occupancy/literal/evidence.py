"""Evidence by walking along rays, the ground by walking along sectors: twins of `Scan` and `ground` (section 3.2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.evidence import Evidence, check_points
from semgrid_edu.occupancy.ground import GroundParams
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.polar import fill_gaps, reach
from semgrid_edu.occupancy.sensor import SensorModel, likelihoods, prepare_scan


def height_above_ground_literal(points: NDArray, params: GroundParams) -> NDArray[np.float64]:
    """Return how high each return is above the ground: the literal twin of `height_above_ground`.

    1. Walk outward along each sector of azimuth, and note where the ground lies (`walk_sector`).
    2. Take as the ground of a sector the median of its own profile and those of its neighbours that hold returns.
    3. Subtract it from the height of each return.

    Parameters, result and errors are those of `height_above_ground`.
    """
    points = check_points(points).astype(np.float64)
    x, y = points[:, 0], points[:, 1]
    distance = np.hypot(x, y)
    sector = ((np.arctan2(y, x) + np.pi) * (params.sectors / (2 * np.pi))).astype(int).clip(max=params.sectors - 1)
    bin_ = np.minimum(distance / params.bin, params.bins - 1).astype(int)  # points beyond the last bin count to it
    own = [walk_sector(distance[sector == s], points[sector == s, 2], params) for s in range(params.sectors)]
    seen = set(sector)
    around = range(-params.neighbours, params.neighbours + 1)
    height = points[:, 2].copy()
    for s in seen:
        beside = [own[(s + k) % params.sectors] for k in around if (s + k) % params.sectors in seen]
        height[sector == s] -= np.median(beside, axis=0)[bin_[sector == s]]
    return height


def walk_sector(distance: NDArray, z: NDArray, params: GroundParams) -> NDArray[np.float64]:
    """Walk outward along one sector, and return the height of the ground in each bin.

    The walk starts on the ground on which the vehicle stands. In each bin, the lowest return is taken as ground when it
    can be, given the last ground before it. Bins whose returns differ by more than `rise` are passed over, because
    something stands there. Between two places of ground the profile is straight, beyond the last it is level.

    Parameters
    ----------
    distance, z : (N,) float
        The returns of the sector: distance from the vehicle as seen from above, and height, metres.
    params : GroundParams
        How ground can look.

    Returns
    -------
    (B,) float64
        Height of the ground in the middle of each bin, metres.

    Examples
    --------
    A road that rises by 3 in 100, and a wall 12 m ahead:

    >>> distance = np.array([4.0, 6.0, 9.0, 12.0, 12.0, 12.0])
    >>> z = np.array([0.12, 0.18, 0.27, 0.5, 1.0, 1.5])
    >>> walk_sector(distance, z, GroundParams(bin=4, farthest=16)).round(2)
    array([0.06, 0.18, 0.27, 0.27])
    """
    bin_of = np.minimum(distance // params.bin, params.bins - 1)
    ground_at, ground = [0.0], [0.0]
    for b in range(params.bins):
        here = np.flatnonzero(bin_of == b)
        if len(here) == 0 or np.ptp(z[here]) > params.rise:
            continue
        lowest = here[z[here].argmin()]
        farther = min(distance[lowest] - ground_at[-1], params.gap)
        allowed = min(params.step + params.slope * farther, params.rise + params.grade * farther)
        if abs(z[lowest] - ground[-1]) <= allowed:
            ground_at.append(distance[lowest])
            ground.append(z[lowest])
    return np.interp((np.arange(params.bins) + 0.5) * params.bin, ground_at, ground)


def scan_evidence_literal(
    points: NDArray, spec: GridSpec, sensor: SensorModel, pose: PlanarMotion | None = None
) -> Evidence:
    """Turn a scan into evidence by walking every ray cell by cell: the literal twin of `scan_evidence`.

    Parameters, result and errors are those of `scan_evidence` with a `SensorModel`. One ray walks along the middle of
    each beam.
    """
    points, pose = prepare_scan(points, sensor).astype(np.float64), pose or PlanarMotion()
    obstacles, free = np.zeros(spec.shape, np.int64), np.zeros(spec.shape, bool)
    first_obstacle, last_ground = np.full(sensor.beams, np.inf), np.zeros(sensor.beams)
    ground_returns = []
    cells = zip(*spec.cells(pose.to_previous(points[:, :2])), strict=True)
    for (x, y, z), (row, col, inside) in zip(points, cells, strict=True):
        beam = int((np.arctan2(y, x) + np.pi) / (2 * np.pi) * sensor.beams) % sensor.beams
        if sensor.obstacle_min <= z <= sensor.obstacle_max:
            obstacles[row, col] += inside
            first_obstacle[beam] = min(first_obstacle[beam], np.hypot(x, y))
        elif z < sensor.obstacle_min:
            last_ground[beam] = max(last_ground[beam], np.hypot(x, y))
            ground_returns.append((row, col, inside, beam, np.hypot(x, y)))
    for row, col, inside, beam, distance in ground_returns:
        under = first_obstacle[beam] < distance < first_obstacle[beam] + sensor.under
        free[row, col] |= inside and not under
    free_to = fill_gaps(reach(first_obstacle, last_ground), sensor.gap)
    for beam in np.flatnonzero(free_to):
        azimuth = (beam + 0.5) / sensor.beams * 2 * np.pi - np.pi + pose.dyaw
        rows, cols, leaves_at = walk_ray(spec, (pose.dx, pose.dy), azimuth, free_to[beam])
        free[rows, cols] |= leaves_at <= free_to[beam]
    return likelihoods(obstacles, free, sensor)


def walk_ray(
    spec: GridSpec, start: tuple[float, float], azimuth: float, length: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """List the cells along a ray: it enters a new cell wherever it crosses a line of the grid.

    Parameters
    ----------
    spec : GridSpec
        The cells.
    start : (float, float)
        x, y where the ray begins, in the frame of `spec`, metres; it may lie outside the grid.
    azimuth : float
        Direction of the ray, radians from the x axis to the left.
    length : float
        How far to walk, metres; the cell in which the ray ends is the last.

    Returns
    -------
    rows, cols : (K,) int64
        The cells, nearest first.
    leaves_at : (K,) float64
        Distance from the start at which the ray leaves each of them, metres; beyond `length` for the last.
    """
    direction = np.array([np.cos(azimuth), np.sin(azimuth)])
    height, width = spec.shape
    lines = (spec.x_max - np.arange(height + 1) * spec.cell, spec.y_max - np.arange(width + 1) * spec.cell)
    crossings = [
        (line - at) / along for line, at, along in zip(lines, start, direction, strict=True) if abs(along) > 1e-12
    ]
    distance = np.unique(np.concatenate([[0.0], *crossings]).round(9))  # a corner is crossed once
    distance = distance[distance >= 0]
    entered = distance[:-1][distance[:-1] < length]
    leaves_at = distance[1 : len(entered) + 1]
    rows, cols, inside = spec.cells(start + (entered + leaves_at)[:, None] / 2 * direction)
    return rows[inside], cols[inside], leaves_at[inside]
