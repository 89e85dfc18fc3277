"""Where the ground lies under each return, sector by sector: the literal twin of `ground` (for section 3.2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.occupancy.ground import GroundParams
from semgrid_edu.occupancy.points import check_points


def height_above_ground_literal(points: NDArray, params: GroundParams) -> NDArray[np.float64]:
    """Return how high each return is above the ground: the literal twin of `height_above_ground`.

    1. Walk outward along each sector of azimuth, and note where the ground lies (`walk_sector`).
    2. Take as the ground of a sector the median of its own profile and those of its neighbours that hold returns.
    3. Subtract it from the height of each return.

    Parameters, result and errors are those of `height_above_ground`.
    """
    points = check_points(points).astype(np.float64)
    sector, bin_ = _polar_cells(points, params)
    distance = np.hypot(points[:, 0], points[:, 1])
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


def _polar_cells(points: NDArray, params: GroundParams) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return sector and bin of each point; points beyond the last bin count to it."""
    x, y = points[:, 0], points[:, 1]
    sector = ((np.arctan2(y, x) + np.pi) * (params.sectors / (2 * np.pi))).astype(int)
    bin_ = np.minimum(np.hypot(x, y) / params.bin, params.bins - 1).astype(int)
    return np.minimum(sector, params.sectors - 1), bin_
