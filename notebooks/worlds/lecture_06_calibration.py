"""A camera on the sample drive that learns its pitch from a map."""

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

from semgrid_edu.camera import Camera, transform_points
from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14

FLAT = tuple(KITTI_14.index(name) for name in ("road", "sidewalk"))
Lesson = tuple[Tensor, Tensor, Tensor]
"""Scores of road and sidewalk (C, h, w), what the map says (C, J), and points in the camera's frame (J, 3)."""


def ground_heights(frame: Frame, spec: GridSpec) -> NDArray[np.float64]:
    """Return the height of the ground in each cell, (H, W): a curved surface fitted to the scan's lowest returns."""
    x, y, z = frame.points_grid[:, :3].T.astype(float)
    near = (x > 5) & (x < 30) & (np.abs(y) < 6)
    terms = np.stack([np.ones(near.sum()), x[near], y[near], x[near] ** 2], axis=1)
    z = z[near]
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
    truth = frame.labels.birdseye_on(spec)
    x = spec.centers()[..., 0]
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
