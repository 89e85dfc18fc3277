"""Camera images with LIDAR points, planes, labels or scores (eq. (1), section 3.1)."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from semgrid_edu.camera import project, transform_points
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.labels import LabelSet
from semgrid_edu.plotting.colours import class_legend, depth_colours


def points_on_image(frame: Frame, ax: Axes | None = None, size: float = 3.0) -> Axes:
    """Draw the camera image with the visible LIDAR returns, coloured by depth (`depth_colours`).

    Parameters
    ----------
    frame : Frame
        A frame with image, points and calibration.
    ax : Axes, optional
        Axes to draw into.
    size : float
        Area of a point in the figure, points squared.

    Raises
    ------
    ArgumentError
        When the frame has no image.
    """
    ax = draw_image(frame.need_image(), ax)
    pixels, depth = visible_points(frame)
    ax.scatter(*pixels.T, s=size, c=depth_colours(depth) / 255, linewidths=0)
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
