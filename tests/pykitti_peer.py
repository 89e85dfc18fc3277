"""A drive of our reader against pykitti's."""

import numpy as np


def check_against_pykitti(drive, peer) -> None:
    """Compare calibration, poses, points and images. Both are of image_02."""
    assert len(drive) == len(peer)
    T_world_from_enu = np.linalg.inv(peer.oxts[0].T_w_imu)  # our world turns with the car, as in KITTI's own kit
    for k, frame in enumerate(drive):
        np.testing.assert_allclose(frame.camera.K, peer.calib.K_cam2, rtol=0, atol=1e-9)
        np.testing.assert_allclose(frame.camera.T_camera_from_lidar, peer.calib.T_cam2_velo, rtol=0, atol=1e-9)
        pose = T_world_from_enu @ peer.oxts[k].T_w_imu @ np.linalg.inv(peer.calib.T_velo_imu)
        np.testing.assert_allclose(frame.T_world_from_lidar, pose, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(frame.points, peer.get_velo(k))
        np.testing.assert_array_equal(frame.image, np.asarray(peer.get_cam2(k)))
