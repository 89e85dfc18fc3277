"""The ground on and beside a road: its kind, its height, lane marks, and its mesh."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.workshop.simulation.street.layout import Road, outside_asphalt, to_road, to_world
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, shape

KERB_HEIGHT = 0.12
"""The usual height of a kerb in a town, metres."""
KERB_WIDTH = 0.18
"""Width of the kerb stone, metres."""


@njit(cache=True)
def ground_kind(road: Road, s: float, d: float) -> int:
    """Return `Kind.ROAD`, `Kind.SIDEWALK` or `Kind.GRASS`, without lane marks. Parameters are those of `to_world`."""
    e = outside_asphalt(road, s, d)
    if e < 0.0:
        return Kind.ROAD
    side = road.left if d > 0 else road.right
    if e < KERB_WIDTH or side.strip <= e < side.strip + side.walk:
        return Kind.SIDEWALK
    return Kind.GRASS


@njit(cache=True)
def _road_height(road: Road, s: float, d: float) -> float:
    """Return the height of the carriageway at a place, or of its edge if the place is outside, metres in the world.

    Along the road the height starts at 0 and follows the grade; across the road it falls from the crown.
    Parameters are those of `to_world`.
    """
    length = road.crest_end - road.crest_start
    along = min(max(s - road.crest_start, 0.0), length)
    beyond = max(s - road.crest_end, 0.0)
    turned = (road.grade_after - road.grade_before) * (along * along / (2.0 * length) + beyond)
    edge = road.left.edge if d > 0 else road.right.edge
    return road.grade_before * s + turned - road.crown * min(abs(d), edge)


@njit(cache=True)
def ground_height(road: Road, s: float, d: float) -> float:
    """Return the height of the ground at a place, metres in the world. Parameters are those of `to_world`.

    All objects and road users use this height, and so do the mesh and the ground truth.
    """
    e = outside_asphalt(road, s, d)
    height = _road_height(road, s, d)
    if e <= 0.0:
        return height
    side = road.left if d > 0 else road.right
    height += KERB_HEIGHT * min(e / 0.03, 1.0)
    t = min(max((e - side.strip - side.walk - 0.2) / side.bank_width, 0.0), 1.0)
    height += side.bank_rise * t * t * (3.0 - 2.0 * t)
    far = max(e - 25.0, 0.0)
    return height + 0.06 * far * (0.5 + 0.5 * np.sin(0.03 * s + 0.02 * d)) * min(far / 40.0, 1.0)


def on_ground(road: Road, s: float, d: float) -> tuple[NDArray[np.float64], float]:
    """Return the ground point at a place, (3,), metres in the world, and the direction of the road, rad.

    Parameters are those of `to_world`.
    """
    x, y, heading = to_world(road, s, d)
    return np.array([x, y, ground_height(road, s, d)]), heading


@njit(cache=True)
def on_wheels(road: Road, s: float, d: float, yaw: float, length: float, width: float) -> tuple[float, float, float]:
    """Return height and tilt of a four-wheeled vehicle on the ground.

    Parameters not named here are those of `to_world`.

    Parameters
    ----------
    yaw : float
        Direction of the vehicle in the world, rad from the x axis.
    length, width : float
        Wheelbase and track width, metres.

    Returns
    -------
    height : float
        Mean height of the wheels, metres in the world.
    roll, pitch : float
        Tilt, rad: positive when the left wheels, or the rear wheels, are higher.
    """
    x, y, _ = to_world(road, s, d)
    along = 0.0
    across = 0.0
    total = 0.0
    c = np.cos(yaw)
    n = np.sin(yaw)
    for ahead in (-1, 1):
        for left in (-1, 1):
            u = ahead * length / 2
            v = left * width / 2
            wheel = to_road(road, x + c * u - n * v, y + n * u + c * v)
            height = ground_height(road, wheel[0], wheel[1])
            total += height
            along += ahead * height
            across += left * height
    return total / 4, np.arctan(across / (2 * width)), -np.arctan(along / (2 * length))


@njit(cache=True)
def _stripe(distance: float, half: float, blur: float) -> float:
    """Return the share of a patch that a stripe covers; the patch is `blur` wide, `distance` from its middle."""
    return min(max((half - abs(distance)) / blur + 0.5, 0.0), 1.0)


@njit(cache=True)
def _junction_mark(road: Road, s: float, d: float, away: float, blur: float) -> float:
    """Return the painted share for zebra crossings and stop lines around the junction."""
    if road.zebra and 0.5 <= away <= 3.7:
        return _stripe((d % 1.0) - 0.5, 0.25, blur)
    ours = s < road.junction and -road.lanes_right * road.lane < d < -0.15
    theirs = s > road.junction and 0.15 < d < road.lanes_left * road.lane
    return _stripe(away - 4.7, 0.2, blur) if ours or theirs else 0.0


@njit(cache=True)
def lane_mark(road: Road, s: float, d: float, blur: float) -> float:
    """Return the painted share of the asphalt in a patch around a place.

    The marks are the centre line, lane boundaries, edge lines along parking bays, zebra crossings and stop lines.
    Parameters not named here are those of `to_world`.

    Parameters
    ----------
    blur : float
        Width of the patch, metres; smaller values are set to 1 cm.
    """
    blur = max(blur, 0.01)
    away = abs(s - road.junction) - road.side_half - road.corner
    lanes, edge = (road.lanes_left, road.left.edge) if d > 0 else (road.lanes_right, road.right.edge)
    beyond = abs(d) > edge
    dash = (s % 9.0) < 3.0
    if road.side_half > 0.0 and (away < 0.0 or beyond):
        middle = beyond and away < 0.0 and (abs(d) % 6.0) < 3.0 and abs(d) > 12.0
        return _stripe(s - road.junction, 0.06, blur) if middle else 0.0
    if road.side_half > 0.0 and away < 6.0:
        return _junction_mark(road, s, d, away, blur)
    if beyond:
        return 0.0
    if abs(d) < 0.5:
        return _stripe(d, 0.07, blur) if dash or not road.dashed else 0.0
    index = round(abs(d) / road.lane)
    offset = abs(d) - index * road.lane
    if index < lanes:
        return _stripe(offset, 0.06, blur) if dash else 0.0
    if index == lanes and edge - lanes * road.lane > 1.0:
        return _stripe(offset, 0.05, blur) if (s % 2.0) < 1.0 else 0.0
    return _stripe(edge - 0.22 - abs(d), 0.06, blur) if not road.dashed else 0.0


@njit(cache=True)
def ground_kinds(road: Road, xy: NDArray) -> NDArray[np.uint8]:
    """Return the kind of the ground at every point, including lane marks.

    Parameters
    ----------
    road : Road
        The street.
    xy : (N, 2) float
        Points in the world, metres.

    Returns
    -------
    (N,) uint8
        Members of `Kind`.
    """
    kinds = np.empty(len(xy), np.uint8)
    # a compiled loop, because the functions that it calls take one place at a time
    for i in range(len(xy)):
        s, d = to_road(road, xy[i, 0], xy[i, 1])
        kinds[i] = ground_kind(road, s, d)
        if kinds[i] == Kind.ROAD and lane_mark(road, s, d, 0.0) > 0.5:
            kinds[i] = Kind.LANE
    return kinds


_OUTWARD = np.array(
    [0.0, 0.03, 0.18, 0.6, 1.2, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 13.0, 17.0, 24.0, 35.0, 50.0, 80.0, 130.0, 250.0]
)
"""Distances of the mesh vertices from the edge of the asphalt, metres."""


def _across(road: Road) -> NDArray[np.float64]:
    """Return the d coordinates of the mesh, dense at kerbs and at the rounded corners of a junction."""
    rim = np.arange(0, road.corner + 0.3, 0.3) if road.side_half else []
    edges = road.left.edge, road.right.edge
    left, right = (np.concatenate([[edge / 2], edge + _OUTWARD, edge + np.asarray(rim)]) for edge in edges)
    return np.unique(np.round(np.concatenate([-right, [0.0], left]), 3))


def _along(road: Road, start: float, end: float) -> NDArray[np.float64]:
    """Return the s coordinates of the mesh."""
    lines = [np.arange(start, end + 4, 4.0)]
    if road.side_half:
        beyond = road.corner + np.array([1, 2, 3, 4, 6, 8, 11])
        out = np.concatenate([np.arange(0, road.corner + 0.3, 0.3), [0.03, 0.18], beyond])
        lines += [road.junction + side * (road.side_half + out) for side in (-1, 1)]
    return np.unique(np.round(np.concatenate(lines), 3))


@njit(cache=True)
def _vertices(road: Road, s: NDArray, d: NDArray) -> NDArray:
    """Return the mesh's vertices, (len(s), len(d), 3)."""
    out = np.empty((len(s), len(d), 3))
    # a compiled loop, because the functions that it calls take one place at a time
    for i in range(len(s)):
        for j in range(len(d)):
            x, y, _ = to_world(road, s[i], d[j])
            out[i, j] = x, y, ground_height(road, s[i], d[j])
    return out


def ground_mesh(road: Road, start: float, end: float) -> Shape:
    """Build the mesh of the ground, in world coordinates.

    The whole mesh has one colour and one kind. `shade` looks up the kind where a ray hits the ground, so lane marks
    need no triangles.

    Parameters
    ----------
    road : Road
        The street.
    start, end : float
        Smallest and largest s of the mesh, metres.
    """
    s = _along(road, start, end)
    d = _across(road)
    if road.curvature:
        inner = 0.8 / abs(road.curvature)
        d = d[np.sign(road.curvature) * d < inner]
    vertices = _vertices(road, s, d)
    index = np.arange(len(s) * len(d)).reshape(len(s), len(d))
    a = index[:-1, :-1]
    b = index[1:, :-1]
    c = index[1:, 1:]
    e = index[:-1, 1:]
    faces = np.stack([a, b, c, a, c, e], axis=-1).reshape(-1, 3)
    return shape(vertices.reshape(-1, 3), faces, (0.2, 0.2, 0.2), Material.GROUND, Kind.ROAD)
