"""The reader against pykitti, on a hand-made drive with a calibration as general as KITTI's."""

import numpy as np
import pykitti
import pytest
from pykitti_peer import check_against_pykitti
from scipy.spatial.transform import Rotation
from tiny_drive import DATE, SIZE, write_packet, write_tiny_drive

from semgrid_edu.datasets import KittiRawDrive


def numbers(array):
    return " ".join(f"{value:.12e}" for value in np.ravel(array))


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    root = tmp_path_factory.mktemp("kitti")
    folder = write_tiny_drive(root, n_frames=5)
    rng = np.random.default_rng(0)
    lines = [f"S_rect_02: {SIZE[1]} {SIZE[0]}\n"]
    for camera in range(4):
        P = np.array([[700, 0, 19, rng.normal(0, 100)], [0, 710, 5, rng.normal()], [0, 0, 1, rng.normal(0, 0.003)]])
        R = Rotation.from_rotvec(rng.normal(0, 0.05, 3)).as_matrix()
        lines.append(f"R_rect_{camera:02d}: {numbers(R)}\nP_rect_{camera:02d}: {numbers(P)}\n")
    (root / DATE / "calib_cam_to_cam.txt").write_text("".join(lines))
    for name in ("velo_to_cam", "imu_to_velo"):
        R = Rotation.random(random_state=rng).as_matrix()
        (root / DATE / f"calib_{name}.txt").write_text(f"R: {numbers(R)}\nT: {numbers(rng.normal(size=3))}\n")
    for k in range(5):
        packet = folder / "oxts" / "data" / f"{k:010d}.txt"
        write_packet(packet, rng.normal(0, 50, 3), tuple(rng.uniform(-1, 1, 3)))
    return root


def test_calibration_poses_points_and_images_agree(root):
    check_against_pykitti(KittiRawDrive(root, DATE, "0001"), pykitti.raw(str(root), DATE, "0001"))
