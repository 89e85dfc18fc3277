import numpy as np
import pytest

from semgrid_edu.camera import Camera


@pytest.fixture
def camera():
    """A camera like KITTI's image_02."""
    K = np.array([[721.5, 0, 609.6], [0, 721.5, 172.9], [0, 0, 1]])
    T_camera_from_lidar = np.array([[0, -1, 0, 0.06], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]])
    return Camera(K, T_camera_from_lidar, (375, 1242))
