"""Pictures inside a page: arrays as PNG or WebP data URIs, so that the page needs no other file."""

import base64
import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.frame import Frame
from semgrid_edu.labels import LabelSet
from semgrid_edu.plotting import depth_colours
from semgrid_edu.plotting.images import visible_points

PHOTO_QUALITY = 72
"""Quality of WebP, 0..100: the lowest at which leaves and lattice fences keep their texture."""

DOTS_ACROSS = 414
"""Number of LIDAR dots that fill the image's width side by side, so that each is 3 pixels wide on KITTI's images."""

LEAST_OPACITY, MOST_OPACITY = 0.15, 0.8
"""How strongly the least and the most certain class covers its pixel."""


def photo_uri(image: NDArray[np.uint8]) -> str:
    """Return a photograph as WebP.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB.

    Returns
    -------
    str
        A data URI.
    """
    return _uri(Image.fromarray(image), "webp", quality=PHOTO_QUALITY, method=2)


def raster_uri(raster: NDArray[np.uint8]) -> str:
    """Return a raster as PNG, without loss.

    Parameters
    ----------
    raster : (h, w, 3) or (h, w, 4) uint8
        RGB or RGBA.

    Returns
    -------
    str
        A data URI.
    """
    return _uri(Image.fromarray(raster), "png", optimize=True)


def classes_uri(labels: NDArray[np.uint8], label_set: LabelSet) -> str:
    """Return a map of classes as PNG.

    Parameters
    ----------
    labels : (h, w) uint8
        The class of each pixel or cell.
    label_set : LabelSet
        The classes, whose colours become the palette of the PNG.

    Returns
    -------
    str
        A data URI.
    """
    image = Image.fromarray(labels).convert("P")
    image.putpalette(label_set.colours(np.arange(256)).tobytes())
    return _uri(image, "png", optimize=True)


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
    """Paint the best class of each pixel; the surer the network is, the more opaque is the colour.

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


def _uri(image: Image.Image, kind: str, **options: object) -> str:
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return f"data:image/{kind};base64,{base64.b64encode(buffer.getvalue()).decode()}"
