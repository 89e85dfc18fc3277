"""What one scan says of one cell: its returns, and the beam that crosses its centre (paper, section 3.2).

One place on the ground in the beliefs of earlier frames, while the vehicle drives on (paper, section 3.2).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import PlanarMotion, SensorModel
from semgrid_edu.occupancy.sensor import likelihoods
from semgrid_edu.occupancy.steps import NOTHING_KNOWN
from semgrid_edu.pipeline import FrameResult


def place_history(
    results: Sequence[FrameResult], spec: GridSpec, cell: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Look up what was believed, frame after frame, of the place in which a cell of the last frame lies.

    The vehicle moves, so the place lies in another cell at each frame. It is the cell that holds the centre of the last
    frame's cell, found through the poses.

    Parameters
    ----------
    results : sequence of FrameResult
        The results of T frames in the order of time.
    spec : GridSpec
        The grid of all of them.
    cell : (int, int)
        Row and column of the cell in the last frame.

    Returns
    -------
    times : (T,) float64
        The times of the frames, seconds.
    probability : (4, T) float32
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN; they sum to 1. Where the place lay outside the grid, UNKNOWN.
    """
    now, states = results[-1].frame, []
    for result in results:
        motion = PlanarMotion.from_poses(result.frame.T_world_from_lidar, now.T_world_from_lidar)
        (row,), (col,), (inside,) = spec.cells(motion.to_previous(spec.centers()[cell])[None])
        states.append(result.belief.probability[:, row, col] if inside else NOTHING_KNOWN)
    return np.array([result.frame.time for result in results]), np.stack(states, axis=1)


@dataclass(frozen=True, eq=False)
class CellScan:
    """What one scan says of one cell, and why.

    Parameters
    ----------
    obstacles, ground : (N, 3), (M, 3) float64
        Its returns from obstacles and from the ground: x and y in the grid frame, height above the ground, metres.
        Returns from above `obstacle_max` say nothing, and are in neither.
    distance : float
        Distance of the cell's centre from the LIDAR, metres.
    reach : float
        How far the beam through the centre sees, metres: to its first obstacle, else to its last ground return; 0 where
        nothing came back.
    passed : bool
        Whether the beam passes the cell from end to end.
    under : bool
        Whether the cell lies so shortly behind the beam's first obstacle that ground returns in it don't count.
    occupied, free : float
        P(z | occupied) and P(z | free); equal when the scan says nothing of the cell.
    """

    obstacles: NDArray[np.float64]
    ground: NDArray[np.float64]
    distance: float
    reach: float
    passed: bool
    under: bool
    occupied: float
    free: float

    @property
    def verdict(self) -> str:
        """What the scan says: "hit", "passed", "ground" or "silent". A hit overrules all else."""
        if len(self.obstacles):
            return "hit"
        if self.passed:
            return "passed"
        return "ground" if len(self.ground) and not self.under else "silent"


def cell_scan(points: NDArray, spec: GridSpec, cell: tuple[int, int], sensor: SensorModel) -> CellScan:
    """Ask a scan about one cell: the rule of `Scan.evidence`, for this cell alone and in plain numpy.

    Parameters
    ----------
    points : (N, 3+) float
        The scan: x forward, y left, z above the ground (m), in the grid frame of the vehicle.
    spec : GridSpec
        The grid.
    cell : (int, int)
        Row and column of the cell.
    sensor : SensorModel
        The sensor that took the scan.

    Returns
    -------
    CellScan
        The returns in the cell, the beam through its centre, and the two likelihoods.

    Raises
    ------
    ArgumentError
        When `points` isn't a table of finite coordinates.
    """
    scan = sensor.scan(points)
    rows, cols, inside = spec.cells(scan.points)
    here = scan.points[inside & (rows == cell[0]) & (cols == cell[1]), :3].astype(np.float64)
    obstacles = here[(here[:, 2] >= sensor.obstacle_min) & (here[:, 2] <= sensor.obstacle_max)]
    ground = here[here[:, 2] < sensor.obstacle_min]
    x, y = spec.centers()[cell]
    beam = min(int((np.arctan2(y, x) + np.pi) * (sensor.beams / (2 * np.pi))), sensor.beams - 1)
    beyond = np.float32(np.hypot(x, y) - scan.reach[beam])
    passed, under = bool(beyond <= -spec.cell / 2), bool(spec.cell / 2 < beyond < sensor.under)
    free = passed or (len(ground) > 0 and not under)
    evidence = likelihoods(np.array([len(obstacles)]), np.array([free]), sensor)
    likely = (float(evidence.occupied[0]), float(evidence.free[0]))
    return CellScan(obstacles, ground, float(np.hypot(x, y)), float(scan.reach[beam]), passed, under, *likely)
