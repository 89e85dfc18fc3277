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
"""WebP's, 0..100: the least at which leaves and lattice fences keep their texture."""

DOTS_ACROSS = 414
"""So many LIDAR dots side by side would fill the image's width: three pixels a dot on KITTI's images."""

LEAST_OPACITY, MOST_OPACITY = 0.15, 0.8
"""How strongly the least and the most certain class covers its pixel."""


def photo_uri(image: NDArray[np.uint8]) -> str:
    """Return a photograph, (h, w, 3) uint8, as WebP."""
    return _uri(Image.fromarray(image), "webp", quality=PHOTO_QUALITY, method=2)


def raster_uri(raster: NDArray[np.uint8]) -> str:
    """Return a raster, (h, w, 3) or (h, w, 4) uint8, as PNG without loss."""
    return _uri(Image.fromarray(raster), "png", optimize=True)


def classes_uri(labels: NDArray[np.uint8], label_set: LabelSet) -> str:
    """Return a map of classes, (h, w) uint8, as PNG with the label set's palette."""
    image = Image.fromarray(labels).convert("P")
    image.putpalette(label_set.colours(np.arange(256)).tobytes())
    return _uri(image, "png", optimize=True)


def points_layer(frame: Frame) -> NDArray[np.uint8]:
    """Draw the LIDAR returns that the camera sees on a transparent picture of the image's size.

    Parameters
    ----------
    frame : Frame
        With a camera.

    Returns
    -------
    (h, w, 4) uint8
        RGBA; a return is a square around its pixel, and near ones lie over far ones.
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
    """Paint the best class of each pixel, the more opaque the surer the network is.

    Parameters
    ----------
    scores : (C, h, w) float
        Without soft-max.
    label_set : LabelSet

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
