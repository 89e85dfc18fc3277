"""Road geometry: road coordinates, and the distance of a place from the asphalt.

A road is straight, bends along an arc, and is straight again. `s` is the distance along its centre line, `d` the
distance to the left of the centre line, both in metres. One side road may cross it. Vertically, the road has one grade,
then a parabolic curve, as real roads do, then another grade. Across, it falls from a crown to both edges.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

SIDE_ROAD_LENGTH = 75.0
"""Length of a side road from the main road's centre line, metres."""


class Side(NamedTuple):
    """One side of the road, from the edge of the asphalt outwards.

    Parameters
    ----------
    edge : float
        Distance from the centre line to the edge of the asphalt, metres.
    strip : float
        Width of the strip of grass between kerb and sidewalk, metres; 0 for none.
    walk : float
        Width of the sidewalk, metres; 0 for none.
    bank_rise, bank_width : float
        Height and width of the grass bank behind the sidewalk, metres.
    """

    edge: float
    strip: float
    walk: float
    bank_rise: float
    bank_width: float

    @property
    def line(self) -> float:
        """Distance from the centre line to the outer edge of the sidewalk, metres."""
        return self.edge + self.strip + self.walk


class Road(NamedTuple):
    """The geometry of a street.

    Parameters
    ----------
    bend_start, bend_end : float
        Start and end of the arc: s, metres.
    curvature : float
        Curvature of the arc, 1/m, positive to the left; 0 for a straight road.
    lane : float
        Width of a lane, metres.
    lanes_left, lanes_right : int
        Number of oncoming lanes and of lanes in our direction; traffic keeps right.
    left, right : Side
        The two sides of the road.
    junction : float
        Position of the side road's centre line: s, metres.
    side_half : float
        Half the width of the side road, metres; 0 if there is none.
    side_left, side_right : bool
        Whether the side road leaves to the left and to the right.
    corner : float
        Radius of the corners of the junction, metres.
    zebra : bool
        Whether the junction has zebra crossings.
    dashed : bool
        Whether the centre line is dashed (solid otherwise).
    crown : float
        Cross fall from the centre line to either edge, metres per metre.
    grade_before, grade_after : float
        Grade before and after the vertical curve, metres per metre.
    crest_start, crest_end : float
        Start and end of the vertical curve (a crest or a sag): s, metres.
    """

    bend_start: float
    bend_end: float
    curvature: float
    lane: float
    lanes_left: int
    lanes_right: int
    left: Side
    right: Side
    junction: float
    side_half: float
    side_left: bool
    side_right: bool
    corner: float
    zebra: bool
    dashed: bool
    crown: float = 0.0
    grade_before: float = 0.0
    grade_after: float = 0.0
    crest_start: float = 0.0
    crest_end: float = 1.0

    def side(self, sign: int) -> Side:
        """Return one side of the road.

        Parameters
        ----------
        sign : int
            1 for the left side, -1 for the right one.
        """
        return self.left if sign > 0 else self.right

    def leaves(self, sign: int) -> bool:
        """Return whether the side road leaves to one side. Parameters are those of `Road.side`."""
        return self.side_half > 0 and (self.side_left if sign > 0 else self.side_right)


@njit(cache=True)
def to_world(road: Road, s: float, d: float) -> tuple[float, float, float]:
    """Convert road coordinates to world coordinates.

    Parameters
    ----------
    road : Road
        The street.
    s, d : float
        Distance along the centre line and to the left of it, metres.

    Returns
    -------
    x, y : float
        Metres.
    heading : float
        Direction of the road at this place, rad from the x axis, counter-clockwise.
    """
    k = road.curvature
    s1 = road.bend_start
    if s <= s1 or k == 0.0:
        return s, d, 0.0
    heading = k * (min(s, road.bend_end) - s1)
    x = s1 + np.sin(heading) / k
    y = (1.0 - np.cos(heading)) / k
    ahead = max(s - road.bend_end, 0.0)
    c = np.cos(heading)
    n = np.sin(heading)
    return x + ahead * c - d * n, y + ahead * n + d * c, heading


@njit(cache=True)
def to_road(road: Road, x: float, y: float) -> tuple[float, float]:
    """Convert world coordinates to road coordinates: the inverse of `to_world`.

    Parameters
    ----------
    road : Road
        The street.
    x, y : float
        The point in the world, metres.

    Returns
    -------
    s, d : float
        Distance along the centre line and to the left of it, metres.
    """
    k = road.curvature
    s1 = road.bend_start
    if x <= s1 or k == 0.0:
        return x, y
    sign, radius = (1.0, 1.0 / k) if k > 0 else (-1.0, -1.0 / k)
    x0 = x - s1
    y0 = sign * y
    angle = np.arctan2(x0, radius - y0)
    end = sign * k * (road.bend_end - s1)
    if angle <= end:
        return s1 + angle * radius, sign * (radius - np.hypot(x0, y0 - radius))
    c = np.cos(end)
    n = np.sin(end)
    x1 = x0 - radius * n
    y1 = y0 - radius * (1.0 - c)
    return road.bend_end + c * x1 + n * y1, sign * (c * y1 - n * x1)


@njit(cache=True)
def outside_asphalt(road: Road, s: float, d: float) -> float:
    """Return the distance of a place from the asphalt, metres; negative on the asphalt.

    The corners of a junction are rounded. Parameters are those of `to_world`.
    """
    e = d - road.left.edge if d > 0 else -d - road.right.edge
    crosses = (d > 0 and road.side_left) or (d <= 0 and road.side_right)
    if road.side_half == 0.0 or not crosses:
        return e
    f = max(abs(s - road.junction) - road.side_half, abs(d) - SIDE_ROAD_LENGTH)
    r = road.corner
    return max(r, min(e, f)) - np.hypot(max(r - e, 0.0), max(r - f, 0.0))
