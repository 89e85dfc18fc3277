"""Road geometry: coordinates along the road, and how far a place lies outside the asphalt.

A road runs straight, bends along an arc, and runs straight again. `s` is the distance along its centre line, `d` the
distance to the left of the centre line, both in metres. One side road may cross it. In height it climbs at one grade,
turns along a parabola, as roads are built, and goes on at another; rain runs off its crown.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

SIDE_ROAD_LENGTH = 75.0
"""How far a side road reaches from the main road's centre line, metres."""


class Side(NamedTuple):
    """One side of the road, from the asphalt's edge outwards.

    Parameters
    ----------
    edge : float
        Distance of the asphalt's edge from the centre line, metres.
    strip : float
        Width of the strip of grass between kerb and sidewalk, metres; 0 for none.
    walk : float
        Width of the sidewalk, metres; 0 for none.
    bank_rise, bank_width : float
        Grass bank behind the sidewalk: by how much it rises, and over which distance, metres.
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
    """A street's geometry.

    Parameters
    ----------
    bend_start, bend_end : float
        Where the arc begins and ends: s, metres.
    curvature : float
        Curvature of the arc, 1/m, positive to the left; 0 for a straight road.
    lane : float
        Width of a lane, metres.
    lanes_left, lanes_right : int
        Lanes of the oncoming traffic and of ours; traffic keeps right.
    left, right : Side
        What lies beside the asphalt on either side.
    junction : float
        Where the side road's centre line crosses: s, metres.
    side_half : float
        Half the width of the side road, metres; 0 where there is no side road.
    side_left, side_right : bool
        On which sides the side road leaves.
    corner : float
        Radius of the corners of the junction, metres.
    zebra : bool
        Whether the junction has zebra crossings.
    dashed : bool
        Whether the centre line is dashed (solid otherwise).
    crown : float
        Fall of the carriageway from its centre line to either edge, metres per metre.
    grade_before, grade_after : float
        Rise along the road before and after the vertical curve, metres per metre.
    crest_start, crest_end : float
        Where the vertical curve, a crest or a sag, begins and ends: s, metres.
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
        """Return whether the side road leaves on one side. Parameters are those of `Road.side`."""
        return self.side_half > 0 and (self.side_left if sign > 0 else self.side_right)


@njit(cache=True)
def to_world(road: Road, s: float, d: float) -> tuple[float, float, float]:
    """Return where in the world a place beside the road is.

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
        Direction of the road there, rad from the x axis, counter-clockwise.
    """
    k = road.curvature
    s1 = road.bend_start
    if s <= s1 or k == 0.0:
        return s, d, 0.0
    heading = k * (min(s, road.bend_end) - s1)
    x = s1 + np.sin(heading) / k
    y = (1.0 - np.cos(heading)) / k
    ahead = max(s - road.bend_end, 0.0)
    c, n = np.cos(heading), np.sin(heading)
    return x + ahead * c - d * n, y + ahead * n + d * c, heading


@njit(cache=True)
def to_road(road: Road, x: float, y: float) -> tuple[float, float]:
    """Return where beside the road a point of the world is: the inverse of `to_world`.

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
    x0, y0 = x - s1, sign * y
    angle = np.arctan2(x0, radius - y0)
    end = sign * k * (road.bend_end - s1)
    if angle <= end:
        return s1 + angle * radius, sign * (radius - np.hypot(x0, y0 - radius))
    c, n = np.cos(end), np.sin(end)
    x1, y1 = x0 - radius * n, y0 - radius * (1.0 - c)
    return road.bend_end + c * x1 + n * y1, sign * (c * y1 - n * x1)


@njit(cache=True)
def outside_asphalt(road: Road, s: float, d: float) -> float:
    """Return how far a place lies outside the asphalt, whose corners at a junction are rounded.

    The distance is negative on the asphalt, metres. Parameters are those of `to_world`.
    """
    e = d - road.left.edge if d > 0 else -d - road.right.edge
    crosses = (d > 0 and road.side_left) or (d <= 0 and road.side_right)
    if road.side_half == 0.0 or not crosses:
        return e
    f = max(abs(s - road.junction) - road.side_half, abs(d) - SIDE_ROAD_LENGTH)
    r = road.corner
    return max(r, min(e, f)) - np.hypot(max(r - e, 0.0), max(r - f, 0.0))
