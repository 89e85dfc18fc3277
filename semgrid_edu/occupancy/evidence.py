"""What one LIDAR scan says of each cell: P(z | occupied) and P(z | free) (paper, section 3.2, step 2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.polar import beyond_reach, count_returns, fill_gaps, polar_profile, reach
from semgrid_edu.occupancy.sensor import SensorModel, prepare_scan
from semgrid_edu.occupancy.state import check_shape


@dataclass(frozen=True, eq=False)
class Evidence:
    """The likelihood of a scan in each cell; the two are equal where it says nothing.

    Parameters
    ----------
    occupied, free : (H, W) float32
        P(z | occupied) and P(z | free), not negative.

    Raises
    ------
    ArgumentError
        When they don't fit each other, or hold what is no likelihood.
    """

    occupied: NDArray[np.float32]
    free: NDArray[np.float32]

    def __post_init__(self) -> None:
        """Refuse what would make nonsense of Bayes' rule in silence."""
        check_shape("free", self.free, np.shape(self.occupied))
        for name in ("occupied", "free"):
            if not (least := np.min(getattr(self, name), initial=0)) >= 0:  # NaN isn't either
                raise ArgumentError(name, "likelihoods, not negative", least)


def scan_evidence(points: NDArray, spec: GridSpec, sensor: SensorModel, pose: PlanarMotion | None = None) -> Evidence:
    """Turn a scan into evidence by way of a polar grid: no loop over rays.

    A beam is a narrow sector of azimuth. Along it nothing stands before its first obstacle or, when it has
    none, before its farthest ground return: so the whole polar grid is one range a beam, in which each
    cell is looked up. A cell with obstacle returns is occupied; one that its beam passes from end to end, or
    that holds a ground return, is free; of the others, behind obstacles or out of range, the scan says nothing.

    What it assumes:

    - *Heights.* Obstacles stand on the ground that `prepare_scan` finds; what hangs higher than `obstacle_max` (crowns,
      bridges) hides nothing below it.
    - *Occlusion.* A beam ends at its first obstacle, however low, though higher rings may look over it. What they hit
      behind it still counts: obstacle returns always, ground returns from `under` metres on; nearer ones may come
      through below it.
    - *Thin objects.* One return stops its whole beam, which is 16 cm wide at 30 m; a cell that beams share belongs to
      the one through its centre. What is thinner than the distance between two columns of returns may stand
      between them unseen, and is passed for free.
    - *Several rings.* What a beam passes over between two rings isn't there. Where rings differ by an angle a, they
      miss things lower than a times the distance: for KITTI's scanner 0.3 m at 50 m. Below its lowest ring, nearer
      than 4 m, nothing is checked; nor are rays that don't come back.
    - Returns are independent, up to `max_returns` a cell; an obstacle return overrules what else a cell holds.

    Parameters
    ----------
    points : (N, 3+) float
        Returns: x forward, y left, z above the ground (m), in the grid frame of the vehicle.
    spec : GridSpec
        The cells.
    sensor : SensorModel
        How the scanner errs.
    pose : PlanarMotion, optional
        Where the vehicle is in the frame of `spec`; at its origin when not given.

    Returns
    -------
    Evidence
        That of `scan_evidence_literal`, except for cells that several beams share, of which only some get through:
        thin lines where what is seen begins or ends, and far out, among foliage, whole patches.

    Raises
    ------
    ArgumentError
        When `points` isn't a table of finite coordinates.
    """
    points = prepare_scan(points, sensor)
    return evidence_in_cells(points, beam_reach(points, sensor), spec, sensor, pose or PlanarMotion())


def beam_reach(points: NDArray, sensor: SensorModel) -> NDArray[np.float32]:
    """Return how far each beam of a scan sees: the scan in polar coordinates.

    Parameters
    ----------
    points : (N, 3+) float
        Returns from `prepare_scan`, in the grid frame of the vehicle, metres.
    sensor : SensorModel
        Its beams, and the heights of obstacles.

    Returns
    -------
    (B,) float32
        Metres; zero for beams in which nothing came back.
    """
    profile = polar_profile(points, sensor.obstacle_min, sensor.obstacle_max, sensor.beams)
    return fill_gaps(reach(*profile), sensor.gap)


def evidence_in_cells(
    points: NDArray, free_to: NDArray, spec: GridSpec, sensor: SensorModel, pose: PlanarMotion
) -> Evidence:
    """Look each cell up in the polar scan: the second half of `scan_evidence`, for any grid and pose.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame of the vehicle.
    free_to : (B,) float
        How far each beam sees, metres, from `beam_reach`.
    spec, sensor, pose
        As for `scan_evidence`.

    Returns
    -------
    Evidence
    """
    grid = (spec.shape, spec.x_max, spec.y_max, spec.cell, pose.dx, pose.dy, pose.dyaw)
    obstacles, ground = count_returns(points, sensor.obstacle_min, sensor.obstacle_max, *grid)
    beyond = beyond_reach(free_to, *grid)
    passed, under = beyond <= -spec.cell / 2, (beyond > spec.cell / 2) & (beyond < sensor.under)
    return likelihoods(obstacles, passed | ((ground > 0) & ~under), sensor)


def scan_evidence_literal(
    points: NDArray, spec: GridSpec, sensor: SensorModel, pose: PlanarMotion | None = None
) -> Evidence:
    """Turn a scan into evidence by walking every ray cell by cell: the literal twin of `scan_evidence`.

    Parameters, result and errors are those of `scan_evidence`; one ray walks along the middle of each beam.
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
    """List the cells along a ray: it changes cell wherever it crosses a line of the grid.

    Parameters
    ----------
    spec : GridSpec
        The cells.
    start : (float, float)
        x, y where the ray begins, metres; it may lie outside the grid.
    azimuth : float
        Direction, radians from the x axis to the left.
    length : float
        How far to walk, metres; the cell where the ray ends is the last.

    Returns
    -------
    rows, cols : (K,) int64
        The cells, nearest first.
    leaves_at : (K,) float64
        Distance from the start at which the ray leaves each, metres; beyond `length` for the last.
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


def likelihoods(obstacles: NDArray, free: NDArray, sensor: SensorModel) -> Evidence:
    """Turn what fell into each cell into P(z | occupied) and P(z | free).

    Parameters
    ----------
    obstacles : (H, W) int
        Number of obstacle returns, n: P(z | .) = p_hit^min(n, max_returns).
    free : (H, W) bool
        Whether the cell was seen to be free; obstacle returns overrule it, for an object fills a cell in part.
    sensor : SensorModel
        How the scanner errs.

    Returns
    -------
    Evidence
        Both are 1 where neither holds.

    Examples
    --------
    >>> likelihoods(np.array([[1, 0, 0]]), np.array([[True, True, False]]), SensorModel()).free.round(2)
    array([[0.05, 0.7 , 1.  ]], dtype=float32)
    """
    hits = np.arange(sensor.max_returns + 1)
    outcome = np.where(free & (obstacles == 0), len(hits), np.minimum(obstacles, sensor.max_returns))
    occupied = np.append(sensor.p_hit_occupied**hits, sensor.p_pass_occupied).astype(np.float32)
    empty = np.append(sensor.p_hit_free**hits, sensor.p_pass_free).astype(np.float32)
    return Evidence(occupied[outcome], empty[outcome])
