"""A scan in polar coordinates: how far each beam sees, and which cells it passes (paper, section 3.2, step 2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion


def beams_of(x: NDArray, y: NDArray, beams: int) -> NDArray[np.int64]:
    """Return the beam that contains each point, from 0 to B - 1.

    Parameters
    ----------
    x, y : (...) float
        The points in the grid frame of the vehicle, metres.
    beams : int
        Number of beams in a turn, B. Beam 0 begins straight behind the vehicle, and the beams go counter-clockwise.
    """
    azimuth = np.arctan2(y, x).astype(np.float64)
    beam = (azimuth + np.pi) * (beams / (2 * np.pi))
    return np.minimum(beam.astype(np.int64), beams - 1)  # an azimuth of exactly pi closes the last beam


def polar_profile(
    points: NDArray, low: float, high: float, beams: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the nearest obstacle and the farthest ground in each beam.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame of the vehicle: x, y, and height above the ground, metres.
    low, high : float
        Heights between which a return is an obstacle, metres. Lower returns are ground, higher ones are ignored.
    beams : int
        Number of beams in a turn, B.

    Returns
    -------
    first_obstacle : (B,) float64
        Range of the nearest obstacle return, metres; infinite without one.
    last_ground : (B,) float64
        Range of the farthest ground return, metres; zero without one.
    """
    x, y, z = points[:, :3].T
    beam = beams_of(x, y, beams)
    distance = np.hypot(x, y)
    obstacle = (z >= low) & (z <= high)
    ground = z < low
    first_obstacle = np.full(beams, np.inf)
    last_ground = np.zeros(beams)
    np.minimum.at(first_obstacle, beam[obstacle], distance[obstacle])
    np.maximum.at(last_ground, beam[ground], distance[ground])
    return first_obstacle, last_ground


def reach(first_obstacle: NDArray, last_ground: NDArray) -> NDArray[np.floating]:
    """Return how far each beam sees, (B,) metres: to its first obstacle, else to its last ground return, else 0.

    Parameters
    ----------
    first_obstacle, last_ground : (B,) float
        Ranges from `polar_profile`, metres.
    """
    return np.where(np.isfinite(first_obstacle), first_obstacle, last_ground)


def fill_gaps(reach: NDArray, gap: int) -> NDArray:
    """Give empty beams between two columns of returns the shorter reach of the two.

    A scanner whose columns are wider apart than a beam leaves some beams empty. These beams are no holes in what it
    sees, but they don't see farther than their neighbours either. Wider gaps, in which nothing came back, stay blind.

    Parameters
    ----------
    reach : (B,) float
        How far each beam sees, metres; zero where nothing came back.
    gap : int
        Largest number of empty beams between two neighbouring columns of returns.

    Examples
    --------
    >>> fill_gaps(np.array([5.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0]), gap=2)
    array([5., 3., 3., 3., 0., 0., 0.])
    """
    seen = np.flatnonzero(reach)
    if len(seen) == 0:
        return reach.copy()
    empty = np.flatnonzero(reach == 0)
    following = np.searchsorted(seen, empty)
    left = seen[following - 1]
    right = seen[following % len(seen)]
    narrow = (right - left - 1) % len(reach) <= gap
    filled = reach.copy()
    filled[empty] = np.where(narrow, np.minimum(reach[left], reach[right]), 0)
    return filled


def beyond_reach(reach: NDArray, spec: GridSpec, pose: PlanarMotion) -> NDArray[np.float64]:
    """Return how far each cell's centre is beyond the reach of its beam: look up its azimuth and range.

    Parameters
    ----------
    reach : (B,) float
        How far each beam sees, metres.
    spec : GridSpec
        The cells, (H, W).
    pose : PlanarMotion
        Pose of the vehicle in the frame of `spec`, metres and radians.

    Returns
    -------
    (H, W) float64
        Metres; negative for cells whose centre the beam passes.
    """
    x, y = np.moveaxis(pose.to_now(spec.centers()), -1, 0)
    return np.hypot(x, y) - reach[beams_of(x, y, len(reach))]
