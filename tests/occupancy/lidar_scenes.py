"""A world of upright boxes on flat ground, and a LIDAR that scans it: made from its definition, with numpy alone."""

from typing import NamedTuple

import numpy as np

from semgrid_edu.grid import GridSpec

LIDAR_HEIGHT = 1.73


class Box(NamedTuple):
    """Its borders on the ground and its height, metres, in the world."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float
    height: float

    @classmethod
    def around(cls, x, y, length, width, height):
        return cls(x - length / 2, x + length / 2, y - width / 2, y + width / 2, height)


def scan(boxes, x=0.0, y=0.0, yaw=0.0, columns=300, rings=64, field=180.0, noise=0.0, rng=None, farthest=70.0):
    """Return what a LIDAR at x, y, yaw sees, (N, 3) float32 in the grid frame: each ray ends where it first hits."""
    azimuth = np.radians((np.arange(columns) + 0.5) / columns * field - field / 2)
    elevation = np.radians(np.linspace(-24.8, 2.0, rings))
    azimuth, elevation = (angle.ravel() for angle in np.meshgrid(azimuth, elevation))
    ray = np.stack(
        [np.cos(elevation) * np.cos(azimuth + yaw), np.cos(elevation) * np.sin(azimuth + yaw), np.sin(elevation)],
        axis=1,
    )
    ray[ray == 0] = 1e-12
    start = np.array([x, y, LIDAR_HEIGHT])
    length = np.where(ray[:, 2] < 0, -start[2] / ray[:, 2], np.inf)
    for box in boxes:
        low, high = np.array([box.x_min, box.y_min, 0]), np.array([box.x_max, box.y_max, box.height])
        first, second = (low - start) / ray, (high - start) / ray
        enters, leaves = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
        length = np.where((enters > 0) & (enters < leaves), np.minimum(length, enters), length)
    hit = length < farthest
    length = length[hit] + (rng.normal(0, noise, hit.sum()) if noise else 0)
    points = start * [0, 0, 1] + ray[hit] * length[:, None]
    cos, sin = np.cos(yaw), np.sin(yaw)
    points[:, :2] = points[:, :2] @ np.array([[cos, -sin], [sin, cos]])
    return points.astype(np.float32)


def hit_cells(points, spec: GridSpec, least=2):
    """Return where at least so many returns between 0.3 and 1.6 m fell, (H, W) bool."""
    rows, cols, inside = spec.cells(points[(points[:, 2] >= 0.3) & (points[:, 2] <= 1.6)])
    count = np.zeros(spec.shape, int)
    np.add.at(count, (rows[inside], cols[inside]), 1)
    return count >= least


def cells_in(box: Box, spec: GridSpec, x=0.0, y=0.0, margin=0.0):
    """Return which cells lie in a box of the world, (H, W) bool, for a vehicle at x, y that looks along x."""
    centre_x, centre_y = np.moveaxis(spec.centers() + np.array([x, y]), -1, 0)
    return (
        (centre_x > box.x_min - margin)
        & (centre_x < box.x_max + margin)
        & (centre_y > box.y_min - margin)
        & (centre_y < box.y_max + margin)
    )
