"""Written drives have KITTI's raw layout, as pykitti and our reader understand it."""

import json

import numpy as np
import pykitti
import pytest

from semgrid_edu.camera import invert_rigid
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.calibration_files import write_calibration
from semgrid_edu.workshop.simulation.street.plan import Wishes
from semgrid_edu.workshop.simulation.writer import DATE, depth_to_png, write_drive


@pytest.fixture(scope="module")
def simulated():
    return SimulatedDrive(11, 4, Wishes(layout="bend", speed=12.0))


@pytest.fixture(scope="module")
def root(simulated, tmp_path_factory):
    root = tmp_path_factory.mktemp("kitti")
    write_calibration(root, simulated.rig, DATE)
    write_drive(root, "0007", simulated, labelled=[3])
    return root


@pytest.fixture(scope="module")
def theirs(root):
    return pykitti.raw(str(root), DATE, "0007")


def test_pykitti_reads_the_calibration(theirs, simulated):
    rig = simulated.rig
    assert theirs.calib.K_cam2 == pytest.approx(rig.camera.K, rel=1e-11)
    assert theirs.calib.T_cam2_velo == pytest.approx(rig.camera.T_camera_from_lidar, abs=1e-10)
    assert np.linalg.inv(theirs.calib.T_velo_imu) == pytest.approx(invert_rigid(rig.T_lidar_from_imu), abs=1e-10)


def test_pykitti_reads_the_poses(theirs, simulated):
    first = invert_rigid(theirs.oxts[0].T_w_imu)
    start = invert_rigid(simulated.T_world_from_imu(0.0))
    for k, packet in enumerate(theirs.oxts):
        assert first @ packet.T_w_imu == pytest.approx(start @ simulated.T_world_from_imu(0.1 * k), abs=1e-6)


def test_oxts_rates_are_those_of_the_poses(theirs):
    a, b, c = (theirs.oxts[k] for k in (1, 2, 3))
    velocity = (c.T_w_imu[:3, 3] - a.T_w_imu[:3, 3]) / 0.2
    assert [b.packet.ve, b.packet.vn, b.packet.vu] == pytest.approx(velocity, abs=0.05)
    assert np.hypot(b.packet.vf, b.packet.vl) == pytest.approx(np.hypot(b.packet.ve, b.packet.vn))
    assert b.packet.vf > 10
    turn = (c.packet.yaw - a.packet.yaw + np.pi) % (2 * np.pi) - np.pi
    assert b.packet.wu == pytest.approx(turn / 0.2, abs=0.02)
    assert b.packet.az == pytest.approx(9.81, abs=1.0)


def test_pykitti_reads_points_image_and_times(theirs, simulated):
    frame = simulated.frame(2, labelled=False)
    assert np.array_equal(theirs.get_velo(2), frame.points)
    assert np.array_equal(np.asarray(theirs.get_cam2(2)), frame.picture.image)
    steps = np.diff([t.timestamp() for t in theirs.timestamps])
    assert steps == pytest.approx(0.1, abs=1e-6)


def test_our_reader_finds_no_problems(root, simulated):
    drive = KittiRawDrive(root, DATE, "0007")
    assert drive.problems() == []
    assert [frame.labels is None for frame in drive] == [True, True, True, False]
    frame = drive[3]
    true = simulated.frame(3, labelled=True)
    relative = invert_rigid(drive[0].T_world_from_lidar) @ frame.T_world_from_lidar
    assert relative == pytest.approx(invert_rigid(simulated.pose(0.0)) @ simulated.pose(0.3), abs=1e-5)
    assert np.array_equal(frame.labels.visible, true.truth.visible)
    seen = np.isfinite(frame.labels.depth)
    assert frame.labels.depth[seen] == pytest.approx(true.picture.depth[seen], abs=1 / 256)


def test_objects_are_those_of_the_world(root, simulated):
    folder = root / DATE / f"{DATE}_drive_0007_sync"
    objects = json.loads((folder / "labels" / "objects.json").read_text())
    assert list(objects) == [f"{k:010d}" for k in range(4)]
    assert objects["0000000003"] == simulated.objects(3 * 0.1)


def test_depth_png_keeps_kittis_convention():
    depth = np.array([[1.0, np.nan], [300.0, 255.9]], np.float32)
    assert depth_to_png(depth).tolist() == [[256, 0], [0, 65510]]
