"""Zhang et al.'s labels on runs of KITTI's tracking benchmark: their layout, and every class of their readme."""

import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat
from tiny_drive import BASELINE, CAMERA_FROM_LIDAR, LIDAR_FROM_IMU, SIZE, K, write_packet, write_tiny_drive

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.workshop.paper.datasets import KittiTrackingRun, ZhangDrive, ZhangLabels

README = ["building", "sky", "road", "vegetation", "sidewalk", "car", "pedestrian", "bicycle", "signage", "fence"]
"""Names of the numbers 1 to 10 in the data set's readme, which says cyclist for bicycle; 0 is not ground-truthed."""

EXPECTED = np.array([IGNORE, *map(KITTI_14.index, README)], dtype=np.uint8)


@pytest.fixture
def numbers():
    return np.arange(SIZE[0] * SIZE[1]).reshape(SIZE) % 11


@pytest.fixture
def folder(tmp_path, numbers):
    """Matrices for acquisition 1 of run 9 and for acquisition 20 of run 0."""
    for name in ("trn/0009/000001", "test/0000/000020"):
        path = tmp_path / "zhang" / "image_02" / f"{name}.mat"
        path.parent.mkdir(parents=True)
        savemat(path, {"truth": numbers.astype(float)})
    return tmp_path / "zhang"


def write_run(root, run=9, n_frames=2):
    """Write a run in the layout of the tracking benchmark's development kit: 1 m ahead from frame to frame."""
    training, name = root / "training", f"{run:04d}"
    for sensor in ("image_02", "velodyne"):
        (training / sensor / name).mkdir(parents=True)
    for folder in ("calib", "oxts"):
        (training / folder).mkdir(exist_ok=True)
    packets = []
    for k in range(n_frames):
        image = np.full((*SIZE, 3), (k, 2, 3), np.uint8)
        image[1:] = np.random.default_rng(k).integers(0, 256, image[1:].shape)
        Image.fromarray(image).save(training / "image_02" / name / f"{k:06d}.png")
        np.array([[10 + k, 1, -1.73, 0.5]], "<f4").tofile(training / "velodyne" / name / f"{k:06d}.bin")
        write_packet(root / "packet.txt", np.array([float(k), 0, 0]), (0.0, 0.0, 0.0))
        packets.append((root / "packet.txt").read_text())
    (training / "oxts" / f"{name}.txt").write_text("".join(packets))
    P2 = np.c_[K, [K[0, 0] * BASELINE, 0, 0]]
    rows = [("P0:", P2), ("P1:", P2), ("P2:", P2), ("P3:", P2), ("R_rect", np.eye(3))]
    rows += [("Tr_velo_cam", CAMERA_FROM_LIDAR[:3]), ("Tr_imu_velo", LIDAR_FROM_IMU[:3])]
    text = "".join(f"{key} {' '.join(f'{x:.12e}' for x in np.ravel(matrix))} \n" for key, matrix in rows)
    (training / "calib" / f"{name}.txt").write_text(text + "\n")
    return root


class TestLabels:
    @pytest.mark.parametrize(("run", "acquisition"), [(9, 1), (0, 20)])
    def test_every_class_becomes_that_of_kitti_14(self, folder, numbers, run, acquisition):
        labels = ZhangLabels(folder).read(run, acquisition, SIZE)
        np.testing.assert_array_equal(labels.image, EXPECTED[numbers])
        assert labels.label_set is KITTI_14

    def test_says_nothing_about_what_it_does_not_know(self, folder):
        labels = ZhangLabels(folder).read(9, 1, SIZE)
        assert np.isnan(labels.depth).all()
        assert (labels.birdseye == IGNORE).all()
        assert not labels.visible.any()

    def test_a_frame_without_labels(self, folder):
        assert ZhangLabels(folder).read(9, 2, SIZE) is None

    def test_splits_go_by_run(self, folder):
        labels = ZhangLabels(folder)
        assert (labels.frames("train"), labels.frames("test")) == ([(9, 1)], [(0, 20)])
        with pytest.raises(ArgumentError, match="split: expected one of train, test, found 'validation'"):
            labels.frames("validation")

    @pytest.mark.parametrize(
        ("variables", "message"),
        [
            ({"truth": np.full(SIZE, 11)}, "expected labels among 0, 1, .*, 10, found 11"),
            ({"truth": np.full(SIZE, 1.5)}, "expected labels among .*, found 1.5"),
            ({"truth": np.zeros((4, 5))}, "expected labels of 12 x 40 pixels, found 4 x 5"),
            ({"a": np.zeros(SIZE), "b": np.zeros(SIZE)}, "expected one matrix of numbers, found the variables a, b"),
            ({"name": "text"}, "expected one matrix of numbers, found the variables name"),
        ],
    )
    def test_a_wrong_matrix_is_named(self, folder, variables, message):
        savemat(folder / "image_02/trn/0009/000001.mat", variables)
        with pytest.raises(DataError, match=f"000001.mat: {message}"):
            ZhangLabels(folder).read(9, 1, SIZE)

    @pytest.mark.parametrize("content", [b"no matrix", b"MATLAB 5.0 MAT-file" + bytes(30), b"\0" * 200])
    def test_a_damaged_file_is_named(self, folder, content):
        (folder / "image_02/trn/0009/000001.mat").write_bytes(content)
        with pytest.raises(DataError, match=r"000001.mat: expected"):
            ZhangLabels(folder).read(9, 1, SIZE)

    def test_matlab_7_3_is_told_how_to_be_saved(self, folder):
        header = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
        (folder / "image_02/trn/0009/000001.mat").write_bytes(header + bytes(400))
        with pytest.raises(DataError, match=r"up to version 7.2, found version 7.3; save it again with `-v7`"):
            ZhangLabels(folder).read(9, 1, SIZE)


class TestTrackingRun:
    def test_what_was_written_is_read(self, tmp_path):
        run = KittiTrackingRun(write_run(tmp_path), 9)
        assert run.problems() == []
        frame = run[1]
        assert tuple(frame.image[0, 0]) == (1, 2, 3)
        np.testing.assert_array_equal(frame.points, np.array([[11, 1, -1.73, 0.5]], np.float32))
        np.testing.assert_array_equal(frame.camera.K, K)
        assert (len(run), frame.camera.size, frame.time) == (2, SIZE, 0.1)

    def test_the_object_benchmarks_names_mean_the_same(self, tmp_path):
        root = write_run(tmp_path)
        before = KittiTrackingRun(root, 9)[1]
        (path,) = root.rglob("calib/0009.txt")
        text = path.read_text().replace("R_rect ", "R0_rect: ").replace("Tr_velo_cam ", "Tr_velo_to_cam: ")
        path.write_text(text.replace("Tr_imu_velo ", "Tr_imu_to_velo: "))
        after = KittiTrackingRun(root, 9)[1]
        np.testing.assert_array_equal(after.camera.T_camera_from_lidar, before.camera.T_camera_from_lidar)
        np.testing.assert_array_equal(after.T_world_from_lidar, before.T_world_from_lidar)

    def test_the_camera_stands_where_calibration_says(self, tmp_path):
        expected = CAMERA_FROM_LIDAR.copy()
        expected[0, 3] += BASELINE
        camera = KittiTrackingRun(write_run(tmp_path), 9).camera
        np.testing.assert_allclose(camera.T_camera_from_lidar, expected, atol=1e-12)

    def test_the_car_drives_east_in_the_world_of_its_imu(self, tmp_path):
        expected = np.linalg.inv(LIDAR_FROM_IMU)
        for frame in KittiTrackingRun(write_run(tmp_path), 9):
            np.testing.assert_allclose(frame.T_world_from_lidar, expected, atol=1e-6)
            expected[0, 3] += 1

    @pytest.mark.parametrize(
        ("folder", "old", "new", "message"),
        [
            ("calib", "Tr_velo_cam", "Tr_velo", "expected the key Tr_velo_cam, found the keys P0, .*Tr_velo,"),
            ("calib", "Tr_velo_cam", "Tr", "expected the key Tr_imu_velo, found a calibration of the odometry"),
            ("calib", "R_rect 1", "R_rect 2", "expected a rotation matrix for R_rect"),
            ("calib", "P2: 2", "P2: 2 2", "expected 12 numbers for P2, found 13"),
            ("oxts", "\n", "\n\n", "expected 2 lines, one per frame, found 4"),
            ("oxts", "49.0", "449.0", "expected latitude and longitude in degrees"),
        ],
    )
    def test_damage_is_named(self, tmp_path, folder, old, new, message):
        path = write_run(tmp_path) / "training" / folder / "0009.txt"
        assert old in path.read_text()
        path.write_text(path.read_text().replace(old, new))
        with pytest.raises(DataError, match=f"0009.txt: {message}"):
            KittiTrackingRun(tmp_path, 9)[1]

    def test_no_such_run(self, tmp_path):
        with pytest.raises(DataError, match=r"0003: expected images such as 000000.png, found no folder"):
            KittiTrackingRun(write_run(tmp_path), 3)


class TestLabelledDrive:
    def test_frames_of_the_run_carry_their_labels(self, tmp_path, folder, numbers):
        drive = ZhangDrive(KittiTrackingRun(write_run(tmp_path), 9), ZhangLabels(folder), 9)
        assert drive[0].labels is None
        np.testing.assert_array_equal(drive[1].labels.image, EXPECTED[numbers])
        np.testing.assert_array_equal(drive[1].points, drive.drive[1].points)

    def test_raw_drives_too(self, tmp_path, folder, numbers):
        write_tiny_drive(tmp_path)
        raw = KittiRawDrive(tmp_path, "2026_01_01", "0001")
        drive = ZhangDrive(raw, ZhangLabels(folder), 9)
        np.testing.assert_array_equal(drive[1].labels.image, EXPECTED[numbers])
        np.testing.assert_array_equal(drive[1].points, raw[1].points)

    def test_it_is_what_a_training_set_takes(self, tmp_path, folder):
        drive = ZhangDrive(KittiTrackingRun(write_run(tmp_path), 9), ZhangLabels(folder), 9)
        assert (drive.name, drive.label_set, drive.camera) == ("run 9", KITTI_14, drive.drive.camera)
        assert {"000001.mat", "000001.bin", "000001.png"} <= {path.name for path in drive.files()}
        assert (drive.truth(1, GridSpec.compact()) == IGNORE).all()  # the data set says nothing of cells
