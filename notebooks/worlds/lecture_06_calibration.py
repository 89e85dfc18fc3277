"""A camera on the sample drive that learns its pitch from a map, and how much noise a cell's reading keeps."""

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from scipy import ndimage
from torch import Tensor

from semgrid_edu.camera import Camera, transform_points
from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.fast.planes import bilinear_matrix
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.planes import plane_pixels

FLAT = tuple(KITTI_14.index(name) for name in ("road", "sidewalk"))
Lesson = tuple[Tensor, Tensor, Tensor]
"""Scores of road and sidewalk (C, h, w), what the map says (C, J), and points in the camera's frame (J, 3)."""


def ground_heights(frame: Frame, spec: GridSpec) -> NDArray[np.float64]:
    """Return the height of the ground in each cell, (H, W): a curved surface fitted to the scan's lowest returns."""
    x, y, z = frame.points_grid[:, :3].T.astype(float)
    near = (x > 5) & (x < 30) & (np.abs(y) < 6)
    terms, z = np.stack([np.ones(near.sum()), x[near], y[near], x[near] ** 2], axis=1), z[near]
    keep = np.abs(z) < 0.6
    for _ in range(10):
        surface = np.linalg.lstsq(terms[keep], z[keep])[0]
        keep = np.abs(terms @ surface - z) < 0.12
    x, y = np.moveaxis(spec.centers(), -1, 0)
    return surface[0] + surface[1] * x + surface[2] * y + surface[3] * x**2


def lesson_of(frame: Frame, spec: GridSpec, camera: Camera) -> Lesson:
    """Return what one image teaches: its true labels, and the map's road and sidewalk from 8 to 25 m ahead.

    Parameters
    ----------
    frame : Frame
        A labelled frame.
    spec : GridSpec
        The cells of the map.
    camera : Camera
        The frame's camera at the size at which it is read.
    """
    truth, x = frame.labels.birdseye_on(spec), spec.centers()[..., 0]
    cells = frame.labels.visible_on(spec) & np.isin(truth, FLAT) & (x > 8) & (x < 25)
    on_ground = np.dstack([spec.centers(), ground_heights(frame, spec)])[cells]
    points = torch.from_numpy(transform_points(camera.T_camera_from_grid, on_ground))
    labels = resize_labels(frame.labels.image, camera.size)
    scores, wanted = (torch.from_numpy(np.stack([a == c for c in FLAT])).double() for a in (labels, truth[cells]))
    return scores, wanted, points


def pixels_at(points: Tensor, pitch: Tensor, K: NDArray) -> tuple[Tensor, Tensor]:
    """Return u and v of points seen by a camera that is turned down by `pitch`, radians: equation (1)."""
    X, Y, Z = points.T
    Y, Z = torch.cos(pitch) * Y - torch.sin(pitch) * Z, torch.sin(pitch) * Y + torch.cos(pitch) * Z
    return K[0, 0] * X / Z + K[0, 2], K[1, 1] * Y / Z + K[1, 2]


def read_points(scores: Tensor, u: Tensor, v: Tensor) -> Tensor:
    """Return what points (J,) read of scores (C, h, w) by equation (2), (C, J); 0 outside the image."""
    where = torch.stack([2 * u / (scores.shape[2] - 1) - 1, 2 * v / (scores.shape[1] - 1) - 1], dim=-1)
    return F.grid_sample(scores[None], where[None, None], align_corners=True)[0, :, 0]


def loss_at(pitch: Tensor, lessons: list[Lesson], K: NDArray) -> Tensor:
    """Return half the mean squared difference between what the points read and what the map says."""
    losses = [((read_points(s, *pixels_at(points, pitch, K)) - t) ** 2).mean() / 2 for s, t, points in lessons]
    return torch.stack(losses).mean()


def clear_of_things(lesson: Lesson, K: NDArray) -> Lesson:
    """Leave out points that have anything but road and sidewalk within two pixels, at the true pitch."""
    scores, wanted, points = lesson
    all_flat = ndimage.minimum_filter(scores.sum(dim=0).numpy(), size=5) > 0
    u, v = (a.round().long().numpy() for a in pixels_at(points, torch.tensor(0.0), K))
    keep = torch.from_numpy(all_flat[v.clip(0, scores.shape[1] - 1), u.clip(0, scores.shape[2] - 1)])
    return scores, wanted[:, keep], points[keep]


def as_many_at_random(lesson: Lesson, count: int, seed: int) -> Lesson:
    """Keep `count` points of a lesson, drawn at random."""
    scores, wanted, points = lesson
    kept = torch.from_numpy(np.random.default_rng(seed).permutation(len(points))[:count])
    return scores, wanted[:, kept], points[kept]


def noise_left(spec: GridSpec, camera: Camera, side: int) -> NDArray[np.float64]:
    """Return what a cell's reading keeps of independent noise of standard deviation 1 in each pixel, (H, W).

    Parameters
    ----------
    spec : GridSpec
        The cells, on the ground.
    camera : Camera
        The camera at the size at which it is read.
    side : int
        The mean of side x side points in each cell is taken; NaN where one of them is out of view.
    """
    fine = GridSpec(spec.x_min, spec.x_max, spec.y_min, spec.y_max, spec.cell / side)
    (pixels,), (visible,) = plane_pixels(fine, [0.0], camera)
    H, W = spec.shape
    order = np.arange(visible.size).reshape(H, side, W, side).swapaxes(1, 2).reshape(H * W, side**2)
    matrix = bilinear_matrix(np.where(visible[..., None], pixels, 0), visible, camera.size)
    mean = sum(matrix[order[:, k]] for k in range(side**2)) / side**2
    left = np.sqrt(mean.power(2).sum(axis=1))
    return np.where(visible.ravel()[order].all(axis=1), left, np.nan).reshape(H, W)
