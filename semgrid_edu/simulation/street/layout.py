"""Road geometry: along-road coordinates, and what the ground is and how high it lies at any (x, y).

A road runs straight, bends along an arc, and runs straight again. `s` is the way along its centre line, `d` the
distance to the left of it, both in metres. One side road may cross it. All of the ground follows from e, the distance
outside the asphalt's edge.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from semgrid_edu.simulation.things.materials import Kind

KERB_HEIGHT = 0.12
"""Metres, the usual step from carriageway to sidewalk in a town."""
KERB_WIDTH = 0.18
"""Metres of kerb stone."""

_ROAD, _LANE, _SIDEWALK, _GRASS = int(Kind.ROAD), int(Kind.LANE), int(Kind.SIDEWALK), int(Kind.GRASS)


class Side(NamedTuple):
    """One side of the road, from the asphalt's edge outwards.

    Parameters
    ----------
    edge : float
        Distance of the asphalt's edge from the centre line, metres.
    strip : float
        Width of a strip of grass between kerb and sidewalk, metres; 0 for none.
    walk : float
        Width of the sidewalk, metres; 0 for none.
    bank_rise, bank_width : float
        Grass bank behind the sidewalk: how high it rises within how many metres.
    """

    edge: float
    strip: float
    walk: float
    bank_rise: float
    bank_width: float


class Road(NamedTuple):
    """A street's geometry.

    Parameters
    ----------
    bend_start, bend_end : float
        s of the two ends of the arc, metres.
    curvature : float
        1/m, positive to the left; 0 for a straight road.
    lane : float
        Width of a lane, metres.
    lanes_left, lanes_right : int
        Lanes of the oncoming traffic and of ours; traffic keeps right.
    left, right : Side
    junction : float
        s of the side road's centre line.
    side_half : float
        Half the width of the side road, metres; 0 where there is no side road.
    side_left, side_right : bool
        On which sides it leaves.
    corner : float
        Radius of the corners of the junction, metres.
    zebra : bool
        Whether the junction has zebra crossings.
    dashed : bool
        Whether the centre line is dashed (solid otherwise).
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


SIDE_ROAD_LENGTH = 75.0
"""Metres that a side road reaches away from the main road's centre line."""


@njit(cache=True)
def to_world(road: Road, s: float, d: float) -> tuple[float, float, float]:
    """Return x, y (m) and the road's heading (rad) at (s, d)."""
    k, s1 = road.curvature, road.bend_start
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
    """Return s and d of a point: the inverse of `to_world`."""
    k, s1 = road.curvature, road.bend_start
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
    """Return e, the distance outside the asphalt's edge (m), negative on it; corners are rounded."""
    e = d - road.left.edge if d > 0 else -d - road.right.edge
    crosses = (d > 0 and road.side_left) or (d <= 0 and road.side_right)
    if road.side_half == 0.0 or not crosses:
        return e
    f = max(abs(s - road.junction) - road.side_half, abs(d) - SIDE_ROAD_LENGTH)
    r = road.corner
    return max(r, min(e, f)) - np.hypot(max(r - e, 0.0), max(r - f, 0.0))


@njit(cache=True)
def ground_kind(road: Road, s: float, d: float) -> int:
    """Return the `Kind` of the ground at (s, d): road, sidewalk or grass; lane marks are `lane_mark`'s."""
    e = outside_asphalt(road, s, d)
    if e < 0.0:
        return _ROAD
    side = road.left if d > 0 else road.right
    if e < KERB_WIDTH or side.strip <= e < side.strip + side.walk:
        return _SIDEWALK
    return _GRASS


@njit(cache=True)
def ground_height(road: Road, s: float, d: float) -> float:
    """Return the height of the ground at (s, d), metres; the asphalt lies at 0."""
    e = outside_asphalt(road, s, d)
    if e <= 0.0:
        return 0.0
    side = road.left if d > 0 else road.right
    height = KERB_HEIGHT * min(e / 0.03, 1.0)
    t = min(max((e - side.strip - side.walk - 0.2) / side.bank_width, 0.0), 1.0)
    height += side.bank_rise * t * t * (3.0 - 2.0 * t)
    far = max(e - 25.0, 0.0)
    return height + 0.06 * far * (0.5 + 0.5 * np.sin(0.03 * s + 0.02 * d)) * min(far / 40.0, 1.0)


@njit(cache=True)
def _stripe(distance: float, half: float, blur: float) -> float:
    """Return how much of a blurred point, `distance` from a stripe's middle, the stripe covers."""
    return min(max((half - abs(distance)) / blur + 0.5, 0.0), 1.0)


@njit(cache=True)
def _junction_mark(road: Road, s: float, d: float, blur: float) -> float:
    """Return the paint of zebra crossings and stop lines around the junction."""
    away = abs(s - road.junction) - road.side_half - road.corner
    if road.zebra and 0.5 <= away <= 3.7:
        return _stripe((d % 1.0) - 0.5, 0.25, blur)
    approach = road.junction - s
    ours = approach > 0 and -road.lanes_right * road.lane < d < -0.15
    theirs = approach < 0 and 0.15 < d < road.lanes_left * road.lane
    if ours or theirs:
        return _stripe(away - 4.7, 0.2, blur)
    return 0.0


@njit(cache=True)
def lane_mark(road: Road, s: float, d: float, blur: float) -> float:
    """Return how much of the asphalt at (s, d) is painted, 0..1, seen by something that blurs `blur` metres.

    Centre line, lane boundaries, edge lines along parking bays, zebra crossings and stop lines.
    """
    blur = max(blur, 0.01)
    if road.side_half > 0.0:
        away = abs(s - road.junction) - road.side_half - road.corner
        beyond = d > road.left.edge or d < -road.right.edge
        if away < 0.0 or beyond:
            middle = beyond and away < 0.0 and (abs(d) % 6.0) < 3.0 and abs(d) > 12.0
            return _stripe(s - road.junction, 0.06, blur) if middle else 0.0
        if away < 6.0:
            return _junction_mark(road, s, d, blur)
    if d > road.left.edge or d < -road.right.edge:
        return 0.0
    dash = (s % 9.0) < 3.0
    if abs(d) < 0.5:
        return _stripe(d, 0.07, blur) if dash or not road.dashed else 0.0
    lanes = road.lanes_left if d > 0 else road.lanes_right
    edge = road.left.edge if d > 0 else road.right.edge
    index = round(abs(d) / road.lane)
    offset = abs(d) - index * road.lane
    if index < lanes:
        return _stripe(offset, 0.06, blur) if dash else 0.0
    if index == lanes and edge - lanes * road.lane > 1.0:
        return _stripe(offset, 0.05, blur) if (s % 2.0) < 1.0 else 0.0
    return _stripe(edge - 0.22 - abs(d), 0.06, blur) if not road.dashed else 0.0


@njit(cache=True)
def ground_kinds(road: Road, xy: np.ndarray) -> np.ndarray:
    """Return the `Kind` of the ground, lane marks included, at every point; (N, 2) m -> (N,) uint8."""
    kinds = np.empty(len(xy), np.uint8)
    for i in range(len(xy)):
        s, d = to_road(road, xy[i, 0], xy[i, 1])
        kinds[i] = ground_kind(road, s, d)
        if kinds[i] == _ROAD and lane_mark(road, s, d, 0.0) > 0.5:
            kinds[i] = _LANE
    return kinds
