"""The reader against pykitti, on a real drive."""

from itertools import pairwise

import numpy as np
import pykitti
import pytest
from pykitti_peer import check_against_pykitti

from semgrid_edu.camera import project, transform_points
from semgrid_edu.datasets import KittiRawDrive

pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def drive(kitti_root):
    return KittiRawDrive(kitti_root, "2011_09_26", "0013")


@pytest.fixture(scope="module")
def peer(kitti_root):
    return pykitti.raw(str(kitti_root), "2011_09_26", "0013")


def test_drive_is_sound_and_as_pykitti_reads_it(drive, peer):
    assert drive.problems() == []
    check_against_pykitti(drive, peer)


def test_projection_agrees_with_the_whole_matrix_p_rect_02(drive, peer):
    # Rectified cameras are taken to differ along x alone, as pykitti does; P_rect_02 has 3 mm more along z.
    frame = drive[0]
    points = frame.points[:, :3].astype(np.float64)
    in_camera = transform_points(frame.camera.T_camera_from_lidar, points)
    pixels, visible = project(in_camera, frame.camera)
    T_rectified_from_lidar = peer.calib.R_rect_00 @ peer.calib.T_cam0_velo_unrect
    homogeneous = np.c_[points, np.ones(len(points))] @ (peer.calib.P_rect_20 @ T_rectified_from_lidar).T
    expected = homogeneous[:, :2] / homogeneous[:, 2:]
    far = visible & (in_camera[:, 2] > 10)
    assert np.abs(pixels - expected)[far].max() < 0.35


def test_car_moves_as_its_odometer_says(drive, peer):
    # Forward speed (field vf) is measured apart from the positions.
    frames = drive[:]
    positions = np.array([frame.T_world_from_lidar[:2, 3] for frame in frames])
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    driven = sum((a.packet.vf + b.packet.vf) / 2 for a, b in pairwise(peer.oxts))
    seconds = (frames[-1].time - frames[0].time) / (len(frames) - 1)
    assert steps.sum() == pytest.approx(driven * seconds, rel=0.02)
