"""Camera images with LIDAR points, planes, labels or scores (eq. (1), section 3.1)."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from numpy.typing import NDArray

from semgrid_edu.camera import project, transform_points
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LabelSet
from semgrid_edu.plotting.colours import DEPTH_RANGE, class_legend, depth_colours


def points_on_image(frame: Frame, ax: Axes | None = None, size: float = 3.0, colour_bar: bool = True) -> Axes:
    """Draw the camera image with the visible LIDAR returns, coloured by depth.

    Parameters
    ----------
    frame : Frame
        A frame with image, points and calibration.
    ax : Axes, optional
        Axes to draw into.
    size : float
        Area of a point in the figure, points squared.
    colour_bar : bool
        Whether to add a colour bar in metres.

    Raises
    ------
    ArgumentError
        When the frame has no image.
    """
    ax = draw_image(frame.need_image(), ax)
    return _draw_by_depth(*visible_points(frame), ax, size, colour_bar)


def plane_on_image(
    spec: GridSpec, height: float, frame: Frame, ax: Axes | None = None, size: float = 3.0, colour_bar: bool = True
) -> Axes:
    """Draw the camera image with the grid's cell centres at one height, projected by equation (1).

    Parameters
    ----------
    spec : GridSpec
        The grid.
    height : float
        Height of the plane above the ground, delta_d, metres.
    frame : Frame
        A frame with image and calibration.
    ax : Axes, optional
        Axes to draw into.
    size : float
        Area of a point in the figure, points squared.
    colour_bar : bool
        Whether to add a colour bar in metres. The colours are the same as in `points_on_image`.

    Raises
    ------
    ArgumentError
        When the frame has no image.
    """
    ax = draw_image(frame.need_image(), ax)
    centers = np.dstack([spec.centers(), np.full(spec.shape, height)])
    points_camera = transform_points(frame.camera.T_camera_from_grid, centers)
    pixels, visible = project(points_camera, frame.camera)
    return _draw_by_depth(pixels[visible], points_camera[visible, 2], ax, size, colour_bar)


def _draw_by_depth(pixels: NDArray, depth: NDArray, ax: Axes, size: float, colour_bar: bool) -> Axes:
    """Add points, (N, 2) pixels, to an image, coloured by depth, (N,) metres."""
    ax.scatter(*pixels.T, s=size, c=depth_colours(depth) / 255, linewidths=0)
    if colour_bar:
        mapping = ScalarMappable(LogNorm(*DEPTH_RANGE), "plasma_r")
        bar = ax.figure.colorbar(mapping, ax=ax, label="depth [m]", fraction=0.02, pad=0.01, extend="both")
        bar.set_ticks([5, 10, 20, 40], labels=["5", "10", "20", "40"], minor=False)
        bar.minorticks_off()
    return ax


def visible_points(frame: Frame) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Find the LIDAR returns that the camera sees.

    Parameters
    ----------
    frame : Frame
        A frame with points and calibration.

    Returns
    -------
    pixels : (N, 2) float32
        u (right) and v (down) of each return, pixels; the farthest is first, so that near points are drawn on top.
    depth : (N,) float32
        Depth of each return along the optical axis, metres.
    """
    points_camera = transform_points(frame.camera.T_camera_from_lidar, frame.points[:, :3])
    pixels, visible = project(points_camera, frame.camera)
    depth = points_camera[visible, 2]
    order = np.argsort(-depth, kind="stable")
    return pixels[visible][order], depth[order]


def image_labels(
    image: NDArray, labels: NDArray, label_set: LabelSet, ax: Axes | None = None, opacity: float = 0.6
) -> Axes:
    """Overlay the pixel classes on an image, with a legend of the classes that occur.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB.
    labels : (h, w) int
        Class of each pixel; 255 (unlabelled) leaves the pixel unchanged.
    label_set : LabelSet
        The classes, for colours and names.
    ax : Axes, optional
        Axes to draw into.
    opacity : float
        Weight of the label colours: 0 shows only the image, 1 only the labels.

    Raises
    ------
    ArgumentError
        When image and labels differ in size.
    """
    ax = draw_image(blend_labels(image, labels, label_set, opacity), ax)
    return class_legend(ax, label_set, labels)


def blend_labels(image: NDArray, labels: NDArray, label_set: LabelSet, opacity: float) -> NDArray[np.uint8]:
    """Blend an image with the colours of its labels; unlabelled pixels stay unchanged.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB.
    labels : (h, w) int
        Class of each pixel; 255 is unlabelled.
    label_set : LabelSet
        The classes, for their colours.
    opacity : float
        Weight of the label colours, 0..1.

    Raises
    ------
    ArgumentError
        When image and labels differ in size.
    """
    if image.shape[:2] != labels.shape:
        raise ArgumentError("labels", f"the image's size {image.shape[:2]}", f"shape {labels.shape}")
    weight = np.where(labels < len(label_set), opacity, 0.0)[..., None]
    return np.rint((1 - weight) * image + weight * label_set.colours(labels)).astype(np.uint8)


def image_values(values: NDArray, name: str, ax: Axes | None = None, **style: object) -> Axes:
    """Draw one number per pixel, such as the scores of a class, with a colour bar.

    Parameters
    ----------
    values : (h, w) float
        The number of each pixel.
    name : str
        Label of the colour bar: quantity and unit.
    ax : Axes, optional
        Axes to draw into.
    **style
        Passed on to `Axes.imshow` (`vmin`, `vmax`, `cmap`).
    """
    ax = draw_image(values, ax, **style)
    ax.figure.colorbar(ax.images[-1], ax=ax, label=name, fraction=0.02, pad=0.01)
    return ax


def draw_image(image: NDArray, ax: Axes | None = None, **style: object) -> Axes:
    """Draw an image without ticks or frame; the centre of pixel (u, v) is at (u, v).

    Parameters
    ----------
    image : (h, w, 3) uint8 or (h, w) float
        Colours or numbers.
    ax : Axes, optional
        Axes to draw into.
    **style
        Passed on to `Axes.imshow`.
    """
    ax = ax or plt.subplots(figsize=(10, 3.2), layout="constrained")[1]
    ax.imshow(image, **style)
    ax.set(xticks=[], yticks=[])
    ax.spines[:].set_visible(False)
    return ax
