"""Equation (1) with KITTI's calibration, against the chain of matrices in its own files."""

import numpy as np
import pykitti
import pytest

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.grid import GridSpec
from semgrid_edu.planes import plane_heights, plane_pixels

pytestmark = pytest.mark.real


def test_planes_land_where_the_matrices_of_the_files_put_them(kitti_root):
    """x = P_rect_02 R_rect_00 T_cam0_velo X; see test_kitti_real for why far points, and why a third of a pixel."""
    camera = KittiRawDrive(kitti_root, "2011_09_26", "0013").camera
    calibration = pykitti.raw(str(kitti_root), "2011_09_26", "0013").calib
    spec, heights = GridSpec.paper(), plane_heights()
    pixels, visible = plane_pixels(spec, heights, camera)
    P = calibration.P_rect_20 @ calibration.R_rect_00 @ calibration.T_cam0_velo_unrect
    for i, delta in enumerate(heights):
        x, y = np.moveaxis(spec.centers(), -1, 0)
        points = np.stack([x, y, np.full_like(x, delta - KITTI_LIDAR_HEIGHT), np.ones_like(x)], axis=-1)
        u, v, depth = np.moveaxis(points @ P.T, -1, 0)
        expected = np.stack([u, v], axis=-1) / depth[..., None]
        far = visible[i] & (depth > 10)
        assert np.abs(pixels[i] - expected)[far].max() < 0.35
        h, w = camera.size
        inside = (depth > 0) & (expected >= 0).all(axis=-1) & (expected[..., 0] <= w - 1) & (expected[..., 1] <= h - 1)
        assert np.mean(visible[i] != inside) < 0.001
    assert 0.8 < visible.mean() < 0.95  # nearly all of the grid lies in the camera's field of view


def test_a_plane_a_return_lies_on_has_its_pixel(kitti_root):
    """Cells and planes are 0.2 m apart, so that some point of theirs is within 0.17 m of each LIDAR return."""
    drive = KittiRawDrive(kitti_root, "2011_09_26", "0013")
    frame, spec, heights = drive[11], GridSpec.paper(), plane_heights()
    pixels, visible = plane_pixels(spec, heights, frame.camera)
    calibration = pykitti.raw(str(kitti_root), "2011_09_26", "0013").calib
    points = frame.points_grid[:, :3].astype(np.float64)
    rows, cols, inside = spec.cells(points)
    near = inside & (points[:, 2] > -0.1) & (points[:, 2] < 3.8) & (points[:, 0] > 10)
    plane = np.rint(points[near, 2] / 0.2).astype(int)
    seen, at = visible[plane, rows[near], cols[near]], pixels[plane, rows[near], cols[near]]
    homogeneous = np.c_[frame.points[near, :3], np.ones(near.sum())].astype(np.float64)
    in_camera = homogeneous @ calibration.T_cam2_velo.T
    u, v, depth = (in_camera[:, :3] @ calibration.K_cam2.T).T
    off = np.hypot(at[:, 0] - u / depth, at[:, 1] - v / depth)
    # 0.17 m move the pixel by at most f sqrt(1 + (X^2 + Y^2) / Z^2) 0.17 / Z, and the root is below 1.4 in the image.
    assert (off[seen] < 1.4 * calibration.K_cam2[0, 0] * np.sqrt(3) * 0.1 / depth[seen]).all()
