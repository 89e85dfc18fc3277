"""A scan in polar coordinates: how far each beam sees, and how high the ground is under each return.

A return counts as an obstacle by its height above the ground, but no street is flat: a car's body pitches, roads rise,
verges slope. So the ground is found first, outward from the vehicle (after Himmelsbach et al., IV 2010).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_fields, not_negative, positive_count
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
    # A scanner's columns may lie on the borders between beams. In single precision, each processor rounds them its way.
    azimuth = np.arctan2(y, x, dtype=np.float64)
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


def visible_range(first_obstacle: NDArray, last_ground: NDArray) -> NDArray[np.floating]:
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
    # The nearest beams with returns on either side. Index -1 and the remainder close the circle behind the vehicle.
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
    x, y = np.moveaxis(pose.child_from_parent(spec.centers()), -1, 0)
    return np.hypot(x, y) - reach[beams_of(x, y, len(reach))]


@dataclass(frozen=True)
class GroundParams:
    """How ground can look to a LIDAR on a road vehicle.

    The ground is followed outward along each sector of azimuth. A return d metres beyond the last ground is ground as
    well when it is at most min(step + slope d, rise + grade d) higher or lower. So ground may be steep over a short
    distance but must be gentle over a long one. Where the ground was hidden for more than `gap` metres, d = gap.

    Parameters
    ----------
    sectors : int
        Number of sectors of azimuth in a turn, each of which is walked separately. The default sectors of 1 degree hold
        at least one column of returns of any scanner of this project.
    bin_length : float
        Length of a bin along a sector, metres. It has to be shorter than a car's bonnet, so that the front of a car
        still shows as something upright.
    farthest : float
        Where the walk ends, metres; farther out the ground is taken as level. KITTI's scanner has no ground returns
        beyond the default.
    step : float
        Largest sudden change of the ground's height, metres. The default allows for most of a kerb.
    slope : float
        The steepest slope over a short distance. The default 1:3 is that of the steepest embankments that a car can
        cross (AASHTO, Roadside Design Guide).
    rise : float
        Largest difference of height, metres, over any distance on level ground. Where the returns of one bin differ by
        more, something stands there, and the bin is skipped.
    grade : float
        Added to `rise` for each metre of distance, because roads in towns rise by up to about 5 in 100.
    gap : float
        The widest gap between two rings on level ground that counts, metres. The default is that of KITTI's scanner at
        50 m.
    neighbours : int
        The ground of a sector is the median of its own profile and of those of this many sectors on each side, because
        cars and houses hide the ground in some of them.
    """

    sectors: int = 360
    bin_length: float = 0.25
    farthest: float = 80.0
    step: float = 0.1
    slope: float = 1 / 3
    rise: float = 0.3
    grade: float = 0.05
    gap: float = 10.0
    neighbours: int = 3

    def __post_init__(self) -> None:
        """Check that ground can be found with these parameters."""
        check_fields(self, "a whole number, at least 1", positive_count, "sectors")
        if not isinstance(self.neighbours, int | np.integer) or not 0 <= 2 * self.neighbours < self.sectors:
            expected = f"a whole number, less than half of the {self.sectors} sectors"
            raise ArgumentError("neighbours", expected, self.neighbours)
        check_fields(self, "a finite number, not negative", not_negative, "step", "slope", "rise", "grade", "gap")
        if not (np.isfinite(self.farthest) and 0 < self.bin_length <= self.farthest):
            raise ArgumentError("bin_length", f"metres, above 0 and up to farthest, {self.farthest}", self.bin_length)

    @property
    def bins(self) -> int:
        """Number of bins along a sector."""
        return int(np.ceil(self.farthest / self.bin_length))


def height_above_ground(points: NDArray, params: GroundParams) -> NDArray[np.float64]:
    """Return how high each return of a scan is above the ground below it.

    1. Walk outward along each sector of azimuth to get the ground's profile in it (`walk_sector`).
    2. Replace each profile by the median over the sector and its neighbours, without sectors that hold no returns.
    3. Subtract the ground from the height of each return.

    Parameters
    ----------
    points : (N, 3+) float
        Returns: x forward, y left, z above the point of the ground on which the vehicle stands (m), in the grid frame
        of the vehicle; N may be 0.
    params : GroundParams
        How ground can look.

    Returns
    -------
    (N,) float64
        Heights in metres; z itself where no ground is found.
    """
    x, y, z = points[:, :3].T.astype(np.float64)
    distance = np.hypot(x, y)
    sector = beams_of(x, y, params.sectors)
    profile = np.full((params.sectors, params.bins), np.nan)
    # Sort the returns by sector, then cut the sorted list wherever a new sector begins.
    order = np.argsort(sector, kind="stable")
    seen, first = np.unique(sector[order], return_index=True)
    for s, returns in zip(seen, np.split(order, first[1:]), strict=False):
        profile[s] = walk_sector(distance[returns], z[returns], params)
    ground = _median_of_neighbours(profile, params.neighbours)
    return z - ground[sector, _bins_of(distance, params)]


def walk_sector(distance: NDArray, z: NDArray, params: GroundParams) -> NDArray[np.float64]:
    """Walk outward along one sector, and return the height of the ground in each bin.

    The walk starts on the ground on which the vehicle stands. In each bin, the lowest return is accepted as ground when
    it can be, given the last ground before it. Bins whose returns differ by more than `rise` are skipped, because
    something stands there. The profile is straight between two places of ground, and level beyond the last.

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
    >>> walk_sector(distance, z, GroundParams(bin_length=4, farthest=16)).round(2)
    array([0.06, 0.18, 0.27, 0.27])
    """
    bins = _bins_of(distance, params)
    order = np.lexsort((z, bins))  # outward bin by bin, in each the lowest return first
    first = np.flatnonzero(np.diff(bins[order], prepend=-1))
    last = np.append(first[1:], len(z)) - 1
    lowest = order[first]
    spread = z[order[last]] - z[lowest]
    # The walk starts at the vehicle, which stands on ground of height 0.
    ground_at = [0.0]
    ground = [0.0]
    for at, height, rise in zip(distance[lowest].tolist(), z[lowest].tolist(), spread.tolist(), strict=True):
        farther = min(at - ground_at[-1], params.gap)
        # Steep over a short way, gentle over a long one.
        allowed = min(params.step + params.slope * farther, params.rise + params.grade * farther)
        if rise <= params.rise and abs(height - ground[-1]) <= allowed:
            ground_at.append(at)
            ground.append(height)
    middles = (np.arange(params.bins) + 0.5) * params.bin_length
    return np.interp(middles, ground_at, ground)


def _bins_of(distance: NDArray, params: GroundParams) -> NDArray[np.int64]:
    """Return the bin of each return, (N,); returns beyond the last bin count to it."""
    return np.minimum(distance / params.bin_length, params.bins - 1).astype(np.int64)


def _median_of_neighbours(profile: NDArray, neighbours: int) -> NDArray[np.float64]:
    """Take the median over each sector and its neighbours, (S, B); NaN marks sectors without returns."""
    around = range(-neighbours, neighbours + 1)
    beside = np.sort([np.roll(profile, k, axis=0) for k in around], axis=0)  # NaN comes last
    # Of n known profiles the median is the middle one, or the mean of the middle two.
    known = np.isfinite(beside[:, :, 0]).sum(axis=0)
    each = np.arange(len(profile))
    return (beside[np.maximum(known - 1, 0) // 2, each] + beside[known // 2, each]) / 2
