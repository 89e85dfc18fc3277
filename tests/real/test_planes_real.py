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
    """x = P_rect_02 R_rect_00 T_cam0_velo X, for far points to a third of a pixel.

    Rectified cameras are taken to differ along x alone, as pykitti does; P_rect_02 has 3 mm more along z.
    """
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
