"""The ground under each return, in compiled loops over returns, sectors and bins."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.fast.occupancy.evidence import check_points
from semgrid_edu.fast.occupancy.polar import beams_of
from semgrid_edu.occupancy.polar import GroundParams


def height_above_ground(points: NDArray, params: GroundParams) -> NDArray:
    """Return how high each return of a scan is above the ground below it.

    Parameters and result are those of `height_above_ground`; the result has the type of `points`.
    """
    points = check_points(points)
    x, y = points[:, 0].astype(np.float64), points[:, 1].astype(np.float64)
    sector = beams_of(x, y, params.sectors)
    place, *lowest = _lowest_returns(x, y, points[:, 2], sector, params.sectors, params.bin, params.bins)
    limits = (params.step, params.slope, params.rise, params.grade, params.gap)
    profile, seen = _walk_all(*lowest, params.sectors, params.bin, *limits)
    return _heights(points[:, 2], place, _median_of_neighbours(profile, seen, params.neighbours))


@njit(cache=True, nogil=True)
def _lowest_returns(x, y, z, sector, sectors, bin_, bins):
    """Find the place of each return, sector * bins + bin, and the lowest and highest return of each place.

    Returns beyond the last bin count as in it. Where there is no return, the heights are infinite.
    """
    place, distance = np.empty(len(x), np.int32), np.empty(sectors * bins)
    low, high = np.full(sectors * bins, np.inf, z.dtype), np.full(sectors * bins, -np.inf, z.dtype)
    for i in range(len(x)):
        far = np.sqrt(x[i] * x[i] + y[i] * y[i])
        k = place[i] = sector[i] * bins + int(min(far / bin_, bins - 1))
        high[k] = max(high[k], z[i])
        if z[i] < low[k]:
            distance[k], low[k] = far, z[i]
    return place, distance, low, high


@njit(cache=True, nogil=True)
def _walk_all(distances, low, high, sectors, bin_, step, slope, rise, grade, gap):
    """Walk all sectors: the height of the ground in each bin, and whether the sector holds returns.

    Each sector is walked as in `walk_sector`. The profile is filled on the way, up to the last bin with ground.
    """
    bins = len(low) // sectors
    profile, seen = np.empty((sectors, bins), np.float32), np.zeros(sectors, np.bool_)
    for s in range(sectors):
        ground_at, ground, filled = 0.0, 0.0, 0
        for k in range(s * bins, (s + 1) * bins):
            if high[k] < low[k]:
                continue
            seen[s] = True
            distance, z = distances[k], np.float64(low[k])
            farther = min(distance - ground_at, gap)
            if high[k] - low[k] > rise or abs(z - ground) > min(step + slope * farther, rise + grade * farther):
                continue
            while filled < bins and (filled + 0.5) * bin_ <= distance:
                part = ((filled + 0.5) * bin_ - ground_at) / (distance - ground_at)
                profile[s, filled] = ground + part * (z - ground)
                filled += 1
            ground_at, ground = distance, z
        profile[s, filled:] = ground
    return profile, seen


@njit(cache=True, nogil=True)
def _median_of_neighbours(profile, seen, neighbours):
    """Take the median over each sector and its neighbours, leaving out sectors without returns."""
    sectors, bins = profile.shape
    ground, beside = np.zeros_like(profile), np.empty((2 * neighbours + 1, bins), np.float32)
    for s in range(sectors):
        n = 0
        for k in range(s - neighbours, s + neighbours + 1):
            if seen[k % sectors]:
                for b in range(bins):  # loops over bins take less than half the time of row operations
                    beside[n, b] = profile[k % sectors, b]
                n += 1
        if n > 0:
            _sort_each_bin(beside[:n])
            for b in range(bins):
                ground[s, b] = (beside[(n - 1) // 2, b] + beside[n // 2, b]) / 2
    return ground


@njit(cache=True, inline="always")
def _sort_each_bin(rows):
    """Sort (n, B) along the first axis: bubble sort of a few rows, all bins at once."""
    for last in range(len(rows) - 1, 0, -1):
        for k in range(last):
            for b in range(rows.shape[1]):
                low, high = rows[k, b], rows[k + 1, b]
                rows[k, b], rows[k + 1, b] = min(low, high), max(low, high)


@njit(cache=True, nogil=True)
def _heights(z, place, ground):
    """Subtract from each return's height the ground at its place (1.7 ms faster than numpy's indexing)."""
    height, ground = np.empty(len(z), z.dtype), ground.ravel()
    for i in range(len(z)):
        height[i] = z[i] - ground[place[i]]
    return height
