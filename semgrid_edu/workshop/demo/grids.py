"""Bird's-eye panels of the page: one SVG in metres around each raster, forward up."""

import math

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import Camera, invert_rigid
from semgrid_edu.grid import GridSpec
from semgrid_edu.plotting import velocity_arrows
from semgrid_edu.plotting.grids import ARROW_SECONDS

TICK = 10
"""Distance between the marks of an axis, metres."""


def grid_svg(name: str, spec: GridSpec, camera: Camera, raster: str, text: str, arrows: bool = False) -> str:
    """Draw axes in metres, the vehicle and the borders of what the camera sees around a raster.

    SVG has x to the right and y down. The grid has y to the left and x up, so both coordinates change their signs.

    Parameters
    ----------
    name : str
        Name by which the page's script finds the raster and its text.
    spec : GridSpec
        The grid that the raster shows.
    camera : Camera
        The camera, whose position and left and right borders are drawn.
    raster : str
        Data URI of the raster; empty when there is nothing to show.
    text : str
        Alternative text, for a reader who can't see the picture.
    arrows : bool
        Whether the script draws velocities over the raster.

    Returns
    -------
    str
        An svg element.
    """
    width, height = spec.y_max - spec.y_min, spec.x_max - spec.x_min
    left, top = -spec.y_max, -spec.x_max
    box = f'x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}"'
    href = f'href="{raster}"' if raster else ""
    errors = (
        f'<image data-errors="{name}" {box} preserveAspectRatio="none"/>' if name.endswith(("grid", "refined")) else ""
    )
    paths = f'<path class="arrows" data-arrows="{name}" d=""/>' if arrows else ""
    return (
        f'<svg viewBox="{left - 6.8:g} {top - 1:g} {width + 7.8:g} {height + 7:g}" role="img" '
        f'data-text="{name}" data-grid="{name}" aria-label="{text}">{_axes(spec)}'
        f'<svg {box} viewBox="{left:g} {top:g} {width:g} {height:g}">'
        f'<image data-image="{name}" {href} {box} preserveAspectRatio="none"/>{errors}'
        f'<path class="sight" d="{_sight(camera, spec)}"/>{paths}<g data-marks="{name}"></g></svg>'
        f'<rect class="frame" {box}/><path class="vehicle" d="M0-1.6.9.7-.9.7z"/></svg>'
    )


def arrows_path(spec: GridSpec, probability: NDArray, velocity: NDArray) -> str:
    """Return the velocities of a belief as an SVG path of arrows, in the panel's metres.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    probability : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    velocity : (2, H, W) float
        Velocity over ground along the grid's x and y axes, m/s; NaN where nothing moves.

    Returns
    -------
    str
        The attribute `d` of a path.
    """
    start, speed = velocity_arrows(spec, probability, velocity)
    way = speed * ARROW_SECONDS
    end = start + way
    length = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    back, side = -way / length, way[:, ::-1] * (1, -1) / length
    barbs = [end + 0.9 * back + sign * 0.5 * side for sign in (1, -1)]
    return "".join(
        f"M{_svg(a)}L{_svg(b)}M{_svg(c)}L{_svg(b)}L{_svg(d)}" for a, b, c, d in zip(start, end, *barbs, strict=True)
    )


def _svg(xy: NDArray) -> str:
    return f"{-xy[1]:.2f} {-xy[0]:.2f}"


def _axes(spec: GridSpec) -> str:
    """Draw marks, numbers and names of the axes, at the left side and at the bottom."""
    left, bottom = -spec.y_max, -spec.x_min
    marks = [
        f'<path class="tick" d="M{left:g} {-x}h-.7"/><text class="x" x="{left - 1.1:g}" y="{-x + 0.7:g}">{x}</text>'
        for x in _ticks(spec.x_min, spec.x_max)
    ]
    marks += [
        f'<path class="tick" d="M{-y} {bottom:g}v.7"/><text x="{-y}" y="{bottom + 2.8:g}">{y}</text>'
        for y in _ticks(spec.y_min, spec.y_max)
    ]
    middle_x, middle_y = -(spec.x_min + spec.x_max) / 2, -(spec.y_min + spec.y_max) / 2
    marks += [
        f'<text transform="translate({left - 4.8:g} {middle_x:g})rotate(-90)">x, forward [m]</text>',
        f'<text x="{middle_y:g}" y="{bottom + 5.3:g}">y, to the left [m]</text>',
    ]
    return "".join(marks)


def _ticks(low: float, high: float) -> range:
    return range(math.ceil(low / TICK) * TICK, math.floor(high) + 1, TICK)


def _sight(camera: Camera, spec: GridSpec) -> str:
    """Draw the rays of the image's left and right border, seen from above."""
    T_grid_from_camera = invert_rigid(camera.T_camera_from_grid)
    eye = T_grid_from_camera[:2, 3]
    borders = np.array([[-0.5, 0, 1], [camera.size[1] - 0.5, 0, 1]])
    rays = (borders @ np.linalg.inv(camera.K).T @ T_grid_from_camera[:3, :3].T)[:, :2]
    reach = np.hypot(spec.x_max - spec.x_min, spec.y_max - spec.y_min)
    ends = eye + reach * rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return "".join(f"M{_svg(eye)}L{_svg(end)}" for end in ends)
