"""SemanticKITTI's layout: every class, poses, truth of one scan and of several, and what is missing or damaged."""

import numpy as np
import pykitti
import pytest
from PIL import Image
from tiny_drive import BASELINE, CAMERA_FROM_LIDAR, SIZE, K

from semgrid_edu.datasets import SemanticKittiSequence
from semgrid_edu.datasets.semantic_kitti import SEMANTIC_KITTI_CLASSES
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14

SPEC = GridSpec(x_min=0, x_max=20, y_min=-5, y_max=5, cell=0.5)
GROUND = -1.73
STEP = 2.0
"""Metres that the car drives from scan to scan."""
ROAD, CAR, TRUNK, SIGN, MOVING_CAR, UNLABELLED = 40, 10, 71, 81, 252, 0

OFFICIAL = {
    "unlabeled": 0, "outlier": 1, "car": 10, "bicycle": 11, "bus": 13, "motorcycle": 15, "on-rails": 16, "truck": 18,
    "other-vehicle": 20, "person": 30, "bicyclist": 31, "motorcyclist": 32, "road": 40, "parking": 44, "sidewalk": 48,
    "other-ground": 49, "building": 50, "fence": 51, "other-structure": 52, "lane-marking": 60, "vegetation": 70,
    "trunk": 71, "terrain": 72, "pole": 80, "traffic-sign": 81, "other-object": 99, "moving-car": 252,
    "moving-bicyclist": 253, "moving-person": 254, "moving-motorcyclist": 255, "moving-on-rails": 256,
    "moving-bus": 257, "moving-truck": 258, "moving-other-vehicle": 259,
}  # fmt: skip
"""Name and number of every class, copied from the data set's configuration."""

SAME_NAME = ("car", "bicycle", "road", "sidewalk", "building", "fence", "vegetation")
BECOMES = {name: name for name in SAME_NAME} | {
    "bus": "car", "on-rails": "car", "truck": "car", "other-vehicle": "car", "motorcycle": "bicycle",
    "person": "pedestrian", "bicyclist": "bicycle", "motorcyclist": "bicycle", "parking": "road",
    "lane-marking": "road", "trunk": "vegetation", "terrain": "vegetation", "pole": "signage",
    "traffic-sign": "signage",
}  # fmt: skip


def scan_of(things):
    """Points and labels of things: (x, y, height above the ground, class), the instance in the upper bits."""
    points = np.array([(x, y, GROUND + z, 0.25) for x, y, z, _ in things], "<f4")
    labels = np.array([number + (k << 16) for k, (*_, number) in enumerate(things)], "<u4")
    return points, labels


def write_scan(folder, k, things):
    points, labels = scan_of(things)
    for sensor, array, suffix in (("velodyne", points, "bin"), ("labels", labels, "label")):
        (folder / sensor).mkdir(parents=True, exist_ok=True)
        (folder / sensor / f"{k:06d}.{suffix}").write_bytes(array.tobytes())


def write_images(folder):
    (folder / "image_2").mkdir()
    for k in range(3):
        Image.new("RGB", SIZE[::-1], (k, 0, 0)).save(folder / "image_2" / f"{k:06d}.png")


def write_sequence(root):
    """Write three scans of a car that drives 2 m ahead: a parked car at x = 12 in the world, and one that moves.

    In scan k the parked car is at 12 - 2 k. The moving one drives at the same speed ahead: at 6.2 in each scan.
    """
    folder = root / "sequences" / "00"
    for k in range(3):
        things = [(12.2 - STEP * k, 1.2, 0.5, CAR), (6.2, -1.2, 0.5, MOVING_CAR), (8.2 - k, -3.2, 0.0, ROAD)]
        write_scan(folder, k, things)
    rows = [
        ("P0:", np.c_[K, np.zeros(3)]),
        ("P2:", np.c_[K, [K[0, 0] * BASELINE, 0, 0]]),
        ("Tr:", CAMERA_FROM_LIDAR[:3]),
    ]
    text = "".join(f"{key} {' '.join(f'{x:.12e}' for x in np.ravel(matrix))}\n" for key, matrix in rows)
    (folder / "calib.txt").write_text(text)
    poses = [np.c_[np.eye(3), [0, 0, STEP * k]] for k in range(3)]  # camera 0: z ahead
    (folder / "poses.txt").write_text("".join(" ".join(f"{x:.6e}" for x in np.ravel(pose)) + "\n" for pose in poses))
    (folder / "times.txt").write_text("5.000000e+00\n5.103736e+00\n5.207472e+00\n")
    return root


@pytest.fixture
def root(tmp_path):
    return write_sequence(tmp_path)


@pytest.fixture
def folder(root):
    return root / "sequences" / "00"


def class_at(truth, x, y):
    rows, cols, inside = SPEC.cells(np.array([[x, y]]))
    assert inside.all()
    number = truth[rows[0], cols[0]]
    return None if number == IGNORE else KITTI_14.names[number]


class TestClasses:
    def test_the_table_has_every_number_and_no_other(self):
        assert sorted(SEMANTIC_KITTI_CLASSES.names) == sorted(OFFICIAL.values())

    @pytest.mark.parametrize("name", OFFICIAL)
    def test_every_class_becomes_that_of_kitti_14(self, root, folder, name):
        write_scan(folder, 0, [(5, 0, 1, OFFICIAL[name])] * 3)
        expected = BECOMES.get(name.removeprefix("moving-"))
        sequence = SemanticKittiSequence(root, "00")
        assert set(sequence.classes(0)) == {IGNORE if expected is None else KITTI_14.index(expected)}
        assert sequence.moving(0).all() == name.startswith("moving-")

    def test_an_unknown_class_is_named(self, root, folder):
        write_scan(folder, 0, [(5, 0, 1, 53)])
        with pytest.raises(DataError, match=r"000000.label: expected labels among 0, 1, 10, .*, found 53"):
            SemanticKittiSequence(root, "00").classes(0)


class TestFrames:
    def test_pykitti_reads_the_same(self, root, folder):
        (root / "poses").mkdir()
        (folder / "poses.txt").rename(root / "poses" / "00.txt")
        text = (
            (folder / "calib.txt")
            .read_text()
            .replace("Tr:", "P1: 1 0 0 0 0 1 0 0 0 0 1 0\nP3: 1 0 0 0 0 1 0 0 0 0 1 0\nTr:")
        )
        (folder / "calib.txt").write_text(text)
        theirs = pykitti.odometry(str(root), "00")
        (root / "poses" / "00.txt").rename(folder / "poses.txt")
        ours = SemanticKittiSequence(root, "00")
        np.testing.assert_allclose(ours.camera.T_camera_from_lidar, theirs.calib.T_cam2_velo, atol=1e-12)
        np.testing.assert_allclose(ours.camera.K, theirs.calib.K_cam2)
        T_camera0_from_lidar = theirs.calib.T_cam0_velo
        for k, (frame, pose) in enumerate(zip(ours, theirs.poses, strict=True)):
            np.testing.assert_array_equal(frame.points, theirs.get_velo(k))
            assert frame.time == pytest.approx((theirs.timestamps[k] - theirs.timestamps[0]).total_seconds(), abs=1e-6)
            expected = np.linalg.inv(T_camera0_from_lidar) @ pose @ T_camera0_from_lidar
            np.testing.assert_allclose(frame.T_world_from_lidar, expected, atol=1e-9)

    def test_without_images_the_size_is_that_of_the_sequence(self, root, folder):
        assert SemanticKittiSequence(root, "00")[0].image is None
        assert SemanticKittiSequence(root, "00").camera.size == (376, 1241)
        folder.rename(folder.parent / "21")
        with pytest.raises(DataError, match="expected an image, to know the camera's size, found no folder image_2"):
            SemanticKittiSequence(root, "21")[0]

    def test_with_images(self, root, folder):
        write_images(folder)
        frame = SemanticKittiSequence(root, "00")[2]
        assert frame.camera.size == SIZE
        assert frame.image[0, 0, 0] == 2

    def test_labels_of_a_frame_are_those_of_its_scan(self, root):
        labels = SemanticKittiSequence(root, "00")[0].labels
        assert (labels.image == IGNORE).all()
        assert (labels.birdseye != IGNORE).sum() == 3
        assert (labels.visible & (labels.birdseye == KITTI_14.index("car"))).sum() == 2

    def test_a_sequence_without_labels(self, root, folder):
        (folder / "labels").rename(folder / "hidden")
        assert SemanticKittiSequence(root, "00")[0].labels is None


class TestTruth:
    def test_of_one_scan_needs_scan_and_labels_alone(self, root, folder):
        for name in ("calib.txt", "poses.txt", "times.txt"):
            (folder / name).unlink()
        truth = SemanticKittiSequence(root, "00").truth(0, SPEC)
        found = [class_at(truth, 12.2, 1.2), class_at(truth, 6.2, -1.2), class_at(truth, 8.2, -3.2)]
        assert found == ["car", "car", "road"]
        assert (truth != IGNORE).sum() == 3

    def test_accumulated_scans_lie_where_the_poses_put_them(self, root):
        # Road at 8.2 - k in scan k, 2 m further for each scan after: seen from scan 1 at 6.2, 7.2 and 8.2.
        truth = SemanticKittiSequence(root, "00").truth(1, SPEC, before=1, after=1)
        assert [class_at(truth, x, -3.2) for x in (6.2, 7.2, 8.2)] == ["road"] * 3
        assert class_at(truth, 10.2, 1.2) == "car"

    def test_what_stands_stays_and_what_moves_leaves_no_trail(self, root):
        truth = SemanticKittiSequence(root, "00").truth(1, SPEC, before=1, after=1)
        cars = np.argwhere(truth == KITTI_14.index("car"))
        assert len(cars) == 2
        assert class_at(truth, 6.2, -1.2) == "car"
        assert [class_at(truth, x, -1.2) for x in (4.2, 8.2)] == [None, None]

    def test_scans_that_are_not_there_are_left_out(self, root):
        sequence = SemanticKittiSequence(root, "00")
        np.testing.assert_array_equal(sequence.truth(1, SPEC, before=9, after=9), sequence.truth(1, SPEC, 1, 1))

    def test_nor_are_scans_in_a_gap(self, root, folder):
        sequence = SemanticKittiSequence(root, "00")
        alone = sequence.truth(2, SPEC, before=1)
        (folder / "velodyne" / "000000.bin").unlink()
        np.testing.assert_array_equal(sequence.truth(2, SPEC, before=2), alone)

    @pytest.mark.parametrize(
        ("things", "expected"),
        [
            ([(5.2, 0.2, 0.0, ROAD)] * 9 + [(5.2, 0.2, 1.0, SIGN)], "signage"),
            ([(5.2, 0.2, 0.0, ROAD)] + [(5.2, 0.2, 4.0, TRUNK)] * 9, "road"),
            ([(5.2, 0.2, 4.0, TRUNK)], "vegetation"),
            ([(5.2, 0.2, 0.0, UNLABELLED)] * 9 + [(5.2, 0.2, 4.0, SIGN)], "signage"),
            ([(5.2, 0.2, 0.0, UNLABELLED)], None),
        ],
        ids=["what stands wins", "a crown hangs over", "only a crown", "unlabelled is no ground", "unlabelled"],
    )
    def test_votes_of_one_cell(self, root, folder, things, expected):
        write_scan(folder, 0, things)
        assert class_at(SemanticKittiSequence(root, "00").truth(0, SPEC), 5.2, 0.2) == expected


class TestDamage:
    def test_a_number_is_no_sequence(self, root):
        with pytest.raises(ArgumentError, match="sequence: expected text such as '00', found 0"):
            SemanticKittiSequence(root, 0)

    def test_a_label_file_cut_short(self, root, folder):
        path = folder / "labels" / "000000.label"
        path.write_bytes(path.read_bytes()[:-2])
        with pytest.raises(DataError, match=r"expected 4 bytes for each of the scan's 3 returns, found 10 bytes"):
            SemanticKittiSequence(root, "00").truth(0, SPEC)

    @pytest.mark.parametrize(
        ("file", "content", "message"),
        [
            ("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n", "expected at least 3 lines, one per frame, found 1"),
            ("poses.txt", "1 0 0 0 0 1 0 0 0 0 1\n" * 3, "expected 12 numbers for line 1, found 11"),
            ("poses.txt", "2 0 0 0 0 1 0 0 0 0 1 0\n" * 3, "expected a rotation matrix for line 1"),
            ("times.txt", "0\n0.1\nnoon\n", "expected numbers for the time in line 3"),
            ("times.txt", "0\n\n0.1\n0.2\n", "expected one time in line 2, found ''"),
            ("times.txt", "0 0.1 0.2\n0.3\n0.4\n", "expected one time in line 1, found '0 0.1 0.2'"),
            ("times.txt", "0\n0.2\n0.1\n", "expected increasing times, found '0.1' in line 3"),
            ("calib.txt", "P2: 1 0 0 0 0 1 0 0 0 0 1 0\n", "expected the key Tr of the odometry benchmark, or R_rect"),
            ("calib.txt", "P2: 1 2 3\n", "expected 12 numbers for P2, found 3"),
            ("calib.txt", "Tr: 1 2 3\n", "expected the key P2, found the keys Tr"),
        ],
    )
    def test_a_damaged_file_is_named(self, root, folder, file, content, message):
        (folder / file).write_text(content)
        with pytest.raises(DataError, match=f"{file}: {message}"):
            SemanticKittiSequence(root, "00")[0]

    def test_problems_names_each_once(self, root, folder):
        (folder / "velodyne" / "000001.bin").write_bytes(b"cut")
        (folder / "labels" / "000002.label").write_bytes(b"")
        problems = SemanticKittiSequence(root, "00").problems()
        assert [problem.split(": ")[0][-12:] for problem in problems] == ["e/000001.bin", "000002.label"]
