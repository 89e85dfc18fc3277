"""Pictures inside the page, which needs no other file: rasters as data URIs, bird's-eye panels as SVG in metres."""

import base64
import io
import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.camera import Camera, invert_rigid
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LabelSet
from semgrid_edu.plotting import depth_colours, velocity_arrows
from semgrid_edu.plotting.grids import ARROW_SECONDS
from semgrid_edu.plotting.images import visible_points

PHOTO_QUALITY = 72
"""Quality of WebP, 0..100: the lowest at which leaves and lattice fences keep their texture."""

DOTS_ACROSS = 414
"""Number of LIDAR dots that fill the image's width side by side, so that each is 3 pixels wide on KITTI's images."""

LEAST_OPACITY, MOST_OPACITY = 0.15, 0.8
"""How strongly the least and the most certain class covers its pixel."""

TICK = 10
"""Distance between the marks of an axis, metres."""


def photo_uri(image: NDArray[np.uint8]) -> str:
    """Return a photograph as the data URI of a WebP.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB.
    """
    return _uri(Image.fromarray(image), "webp", quality=PHOTO_QUALITY, method=2)


def raster_uri(raster: NDArray[np.uint8]) -> str:
    """Return a raster as the data URI of a PNG, without loss.

    Parameters
    ----------
    raster : (h, w, 3) or (h, w, 4) uint8
        RGB or RGBA.
    """
    return _uri(Image.fromarray(raster), "png", optimize=True)


def classes_uri(labels: NDArray[np.uint8], label_set: LabelSet) -> str:
    """Return a map of classes as the data URI of a PNG.

    Parameters
    ----------
    labels : (h, w) uint8
        The class of each pixel or cell.
    label_set : LabelSet
        The classes, whose colours become the palette of the PNG.
    """
    image = Image.fromarray(labels).convert("P")
    image.putpalette(label_set.colours(np.arange(256)).tobytes())
    return _uri(image, "png", optimize=True)


def _uri(image: Image.Image, kind: str, **options: object) -> str:
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return f"data:image/{kind};base64,{base64.b64encode(buffer.getvalue()).decode()}"


def points_layer(frame: Frame) -> NDArray[np.uint8]:
    """Draw the LIDAR returns that the camera sees on a transparent picture of the image's size.

    Parameters
    ----------
    frame : Frame
        The frame; it has to have a camera.

    Returns
    -------
    (h, w, 4) uint8
        RGBA. Each return is a square around its pixel, and near returns cover far ones.
    """
    height, width = frame.camera.size
    side = max(1, round(width / DOTS_ACROSS))
    pixels, depth = visible_points(frame)
    u, v = np.rint(pixels - (side - 1) / 2).astype(int).T[..., None] + side
    dv, du = np.indices((side, side)).reshape(2, 1, -1)
    layer = np.zeros((height + 2 * side, width + 2 * side, 4), np.uint8)
    layer[v + dv, u + du, :3] = depth_colours(depth)[:, None]
    layer[v + dv, u + du, 3] = 255
    return layer[side:-side, side:-side]


def scores_layer(scores: NDArray, label_set: LabelSet) -> NDArray[np.uint8]:
    """Paint the best class of each pixel; the more certain the network is, the more opaque is the colour.

    Parameters
    ----------
    scores : (C, h, w) float
        s, the scores of each class, before the soft-max.
    label_set : LabelSet
        The classes, for their colours.

    Returns
    -------
    (h, w, 4) uint8
        RGBA.
    """
    excess = np.exp(scores - scores.max(axis=0))
    certainty = 1 / excess.sum(axis=0)
    opacity = LEAST_OPACITY + (MOST_OPACITY - LEAST_OPACITY) * certainty
    alpha = np.rint(255 * opacity).astype(np.uint8)
    return np.concatenate([label_set.colours(scores.argmax(axis=0)), alpha[..., None]], axis=-1)


def grid_svg(name: str, spec: GridSpec, camera: Camera, raster: str, text: str, arrows: bool = False) -> str:
    """Draw axes in metres, the vehicle and the borders of what the camera sees around a raster.

    SVG has x to the right and y down. The grid has y to the left and x up, so both coordinates change their signs.

    Parameters
    ----------
    name : str
        The name by which the page's script finds the raster and its text.
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
    width = spec.y_max - spec.y_min
    height = spec.x_max - spec.x_min
    left = -spec.y_max
    top = -spec.x_max
    box = f'x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}"'
    href = f'href="{raster}"' if raster else ""
    compared = name.endswith(("grid", "refined", "remembered"))
    layers = ["textures"] * (not name.endswith("occupancy")) + ["errors"] * compared
    over = "".join(f'<image data-{layer}="{name}" {box} preserveAspectRatio="none"/>' for layer in layers)
    paths = f'<path class="arrows" data-arrows="{name}" d=""/>' if arrows else ""
    return (
        f'<svg viewBox="{left - 6.8:g} {top - 1:g} {width + 7.8:g} {height + 7:g}" role="img" '
        f'data-text="{name}" data-grid="{name}" aria-label="{text}">{_axes(spec)}'
        f'<svg {box} viewBox="{left:g} {top:g} {width:g} {height:g}">'
        f'<image data-image="{name}" {href} {box} preserveAspectRatio="none"/>{over}'
        f'<path class="sight" d="{_sight(camera, spec)}"/>{paths}<g data-marks="{name}"></g></svg>'
        f'<rect class="frame" {box}/><path class="vehicle" d="M0-1.6.9.7-.9.7z"/></svg>'
    )


def arrows_path(spec: GridSpec, probability: NDArray, velocity: NDArray, covariance: NDArray | None = None) -> str:
    """Return the velocities of a belief as an SVG path of arrows, in the panel's metres.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    probability : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    velocity : (2, H, W) float
        Velocity over ground along the grid's x and y axes, m/s; NaN where nothing moves.
    covariance : (2, 2, H, W) float, optional
        Covariance of the velocity, m^2/s^2.

    Returns
    -------
    str
        The attribute `d` of a path.
    """
    start, speed = velocity_arrows(spec, probability, velocity, covariance)
    way = speed * ARROW_SECONDS
    end = start + way
    length = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    back = -way / length
    side = way[:, ::-1] * (1, -1) / length
    barbs = [end + 0.9 * back + sign * 0.5 * side for sign in (1, -1)]
    arrows = zip(*(map(_svg, points) for points in (start, end, *barbs)), strict=True)
    return "".join(f"M{a}L{b}M{c}L{b}L{d}" for a, b, c, d in arrows)


def _svg(xy: NDArray) -> str:
    return f"{-xy[1]:.2f} {-xy[0]:.2f}"


def _axes(spec: GridSpec) -> str:
    """Draw marks, numbers and names of the axes, at the left side and at the bottom."""
    left = -spec.y_max
    bottom = -spec.x_min
    marks = [
        f'<path class="tick" d="M{left:g} {-x}h-.7"/><text class="x" x="{left - 1.1:g}" y="{-x + 0.7:g}">{x}</text>'
        for x in _ticks(spec.x_min, spec.x_max)
    ]
    marks += [
        f'<path class="tick" d="M{-y} {bottom:g}v.7"/><text class="y" x="{-y}" y="{bottom + 2.8:g}">{y}</text>'
        for y in _ticks(spec.y_min, spec.y_max)
    ]
    middle_x = -(spec.x_min + spec.x_max) / 2
    middle_y = -(spec.y_min + spec.y_max) / 2
    marks = [
        f"<g data-axes>{''.join(marks)}</g>",
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
