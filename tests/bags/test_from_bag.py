"""`data from-bag`: a drive written from a bag says the same as the bag; what a bag lacks is refused by name."""

import shutil

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the extra ros isn't installed")

from tiny_bag import (
    IMAGES,
    LANDMARKS,
    N_SCANS,
    PERIOD,
    START,
    T_BASE_FROM_LIDAR,
    T_BASE_FROM_MOUNT,
    T_MOUNT_FROM_OPTICAL,
    K,
    pose,
    rigid,
    write_bag,
)

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.workshop.bags.convert import convert_bag
from semgrid_edu.workshop.bags.survey import Topics
from semgrid_edu.workshop.bags.transforms import RecordedPath
from semgrid_edu.workshop.commands.main import run
from semgrid_edu.workshop.demo.find_drives import drive_at

TOPICS = Topics("/cam/image_raw", "/points", "/odom", "/cam/camera_info")
RECTIFIED = TOPICS._replace(image="/cam/image_rect_color")
HEIGHT = 1.9


def converted(tmp_path, kind="mcap", topics=TOPICS, **changes):
    """Write a bag, convert it, and open the drive."""
    written = convert_bag(write_bag(tmp_path / "bag", kind, **changes), tmp_path / "out", topics, HEIGHT)
    return written, KittiRawDrive(tmp_path / "out", written.date, written.drive)


def check_landmarks(frame):
    """Landmarks don't move: pose and points together give back where they are from the first pose."""
    T = frame.T_world_from_lidar
    expected = (np.linalg.inv(pose(0.0)) @ np.c_[LANDMARKS, np.ones(50)].T)[:3].T
    np.testing.assert_allclose(frame.points[:, :3] @ T[:3, :3].T + T[:3, 3], expected, atol=1e-3)


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_a_drive_says_what_the_bag_says(tmp_path, kind):
    written, drive = converted(tmp_path, kind)
    assert (written.date, written.n_frames, written.left_out) == ("2026_01_01", N_SCANS, {})
    assert drive.problems() == []
    T_camera_from_base = np.linalg.inv(T_BASE_FROM_MOUNT @ T_MOUNT_FROM_OPTICAL)
    for k, frame in enumerate(drive):
        np.testing.assert_array_equal(frame.image, IMAGES[k])
        assert frame.time == pytest.approx(k * PERIOD / 1e9, abs=1e-9)
        check_landmarks(frame)
        # The camera sees them where the bag's transforms say.
        T_base_from_world = np.linalg.inv(pose(k * PERIOD / 1e9))
        seen = (T_camera_from_base @ T_base_from_world @ np.c_[LANDMARKS, np.ones(50)].T)[:3].T
        T = frame.camera.T_camera_from_lidar
        np.testing.assert_allclose(frame.points[:, :3] @ T[:3, :3].T + T[:3, 3], seen, atol=1e-4)
        np.testing.assert_allclose(frame.points[:, 3], np.arange(50) * 5 / 255, rtol=1e-6)
    np.testing.assert_allclose(drive.camera.K, K)


def test_a_tilted_lidar_is_made_level_at_its_height(tmp_path):
    _, drive = converted(tmp_path)
    T_world_from_lidar = drive[0].T_world_from_lidar
    np.testing.assert_allclose(T_world_from_lidar[:3, 3], T_BASE_FROM_LIDAR[:3, 3], atol=1e-6)
    np.testing.assert_allclose(T_world_from_lidar[:3, :3], np.eye(3), atol=1e-6)
    assert drive.camera.lidar_height == HEIGHT
    np.testing.assert_allclose(drive[0].points_grid[:, 2], drive[0].points[:, 2] + HEIGHT, atol=1e-6)


@pytest.mark.parametrize(
    ("encoding", "expected"),
    [
        *((encoding, IMAGES) for encoding in ("bgr8", "rgba8", "bgra8", "8UC3", "png")),
        ("mono8", np.repeat(IMAGES[..., :1], 3, axis=-1)),
    ],
)
def test_encodings_of_images(tmp_path, encoding, expected):
    _, drive = converted(tmp_path, encoding=encoding)
    np.testing.assert_array_equal([frame.image for frame in drive], expected)


@pytest.mark.parametrize(
    ("changes", "factor"),
    [
        ({"big_endian": True}, 1.0),
        ({"intensity_type": 2}, 1.0),  # bytes
        ({"intensity": "reflectivity", "intensity_type": 4}, 1.0),  # 16 bits, up to 255
        ({"intensity_scale": 1 / 245, "intensity_type": 8}, 255 / 245),  # 0 to 1 already
        ({"intensity_scale": 10.0, "intensity_type": 4}, 2550 / 2450),  # 16 bits, divided by the brightest
        ({"intensity": None}, 0.0),
    ],
)
def test_any_layout_of_points_gives_a_reflectance_from_0_to_1(tmp_path, changes, factor):
    _, drive = converted(tmp_path, **changes)
    for frame in drive:
        np.testing.assert_allclose(frame.points[:, 3], factor * np.arange(50) * 5 / 255, rtol=1e-5)
        check_landmarks(frame)


@pytest.mark.parametrize(
    ("changes", "transforms"),
    [
        ({"base": ""}, TOPICS.transforms),
        ({"pose_type": "geometry_msgs/msg/PoseStamped"}, TOPICS.transforms),
        ({"pose_type": "geometry_msgs/msg/PoseWithCovarianceStamped"}, TOPICS.transforms),
        ({"tf_topic": "/tf"}, ("/tf",)),  # beside those that change
    ],
)
def test_poses_and_transforms_in_other_forms(tmp_path, changes, transforms):
    """Poses without a frame are those of base_link."""
    _, drive = converted(tmp_path, topics=TOPICS._replace(transforms=transforms), **changes)
    np.testing.assert_allclose(drive[0].T_world_from_lidar[:3, 3], T_BASE_FROM_LIDAR[:3, 3], atol=1e-6)


def test_a_rectified_topic_may_have_distortion_and_takes_the_projection(tmp_path):
    _, drive = converted(tmp_path, topics=RECTIFIED, image_topic=RECTIFIED.image, distortion=0.1)
    np.testing.assert_allclose(drive.camera.K, K)


@pytest.mark.parametrize(
    "changes",
    [
        {"slash": "/"},  # as old bags have it
        {"transforms": ("ground base_link", "ground lidar", "base_link mount", "mount optical")},
    ],
)
def test_the_chain_may_lead_through_a_parent_and_names_may_have_a_slash(tmp_path, changes):
    _, drive = converted(tmp_path, **changes)
    check_landmarks(drive[3])


def test_between_two_poses_the_turn_is_steady():
    path = RecordedPath(np.array([0, 10**9]), np.stack([np.eye(4), rigid((0, 0, 90), (4, 0, 0))]))
    np.testing.assert_allclose(path.at(250_000_000), rigid((0, 0, 22.5), (1, 0, 0)), atol=1e-12)


OF_THEIR_OWN = "scans without an image of their own within 0.05 s"


def test_scans_without_image_are_left_out(tmp_path):
    written, drive = converted(tmp_path, left_out_images=(2,))
    assert (written.n_frames, dict(written.left_out)) == (5, {OF_THEIR_OWN: 1})
    np.testing.assert_allclose([frame.time for frame in drive], [0.0, 0.1, 0.3, 0.4, 0.5], atol=1e-9)
    np.testing.assert_array_equal(drive[2].image, IMAGES[3])


def test_of_two_scans_beside_an_image_the_nearer_gets_it(tmp_path):
    written, drive = converted(tmp_path, scan_stamps={2: START + 108_000_000})  # the image is at 107 ms
    assert dict(written.left_out) == {OF_THEIR_OWN: 1}
    np.testing.assert_allclose([frame.time for frame in drive], [0.0, 0.108, 0.3, 0.4, 0.5], atol=1e-9)
    np.testing.assert_array_equal(drive[1].image, IMAGES[1])


def test_scans_after_the_odometry_are_left_out(tmp_path):
    written, _ = converted(tmp_path, scan_stamps={5: START + 900_000_000})
    assert dict(written.left_out) == {"scans without odometry around them within 0.5 s": 1}


def test_scans_without_returns_are_left_out(tmp_path):
    written, drive = converted(tmp_path, empty_scans=(0, 3))
    assert (written.n_frames, dict(written.left_out)) == (4, {"scans without returns": 2})
    assert drive.problems() == []
    np.testing.assert_array_equal(drive[0].image, IMAGES[1])


def test_returns_too_far_for_a_lidar_are_left_out_by_their_distance(tmp_path):
    written, drive = converted(tmp_path, n_far=2)  # at (200, 200) from a LIDAR that is turned
    assert dict(written.left_out) == {"returns beyond 250 m": 2 * N_SCANS}
    assert drive.problems() == []
    check_landmarks(drive[3])


def test_messages_may_overtake_each_other_or_come_twice(tmp_path):
    written, drive = converted(tmp_path, scan_stamps={1: START + 2 * PERIOD, 2: START + PERIOD, 4: START + 3 * PERIOD})
    assert dict(written.left_out) == {"scans with the time stamp of an earlier one": 1}
    np.testing.assert_allclose([frame.time for frame in drive], [0.0, 0.1, 0.2, 0.3, 0.5], atol=1e-9)
    for frame in drive:
        check_landmarks(frame)


def test_clocks_that_are_apart_show_in_the_error(tmp_path):
    stamps = {k: START + k * PERIOD + 37_000_000_000 for k in range(N_SCANS)}
    with pytest.raises(DataError, match=r"found none; .*scans from 1767261637.0 to 1767261637.5 s, images from"):
        converted(tmp_path, scan_stamps=stamps)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"without": "/odom"}, r"the topic /odom of the type nav_msgs/Odometry .*found only .*/points \(sens"),
        (
            {"topics": TOPICS._replace(points="/odom")},
            "/odom of the type sensor_msgs/PointCloud2, found .* nav_msgs/Odometry",
        ),
        ({"without": "/tf_static"}, "the topic /tf_static"),
        ({"without": "/cam/camera_info"}, "the topic /cam/camera_info"),
        ({"transforms": ("base_link lidar", "mount optical")}, "a chain .* base_link and optical, .*-> lidar"),
        ({"base": "rear_axle"}, "/tf_static: expected a chain of fixed transforms between lidar and rear_axle"),
        ({"base": "optical"}, r"looks ahead, along x of optical, .* found z along \(0.00, 0.00, 1.00\)"),
        ({"base_turn": (180, 0, 0)}, r"y axis points down, against z, found .*, y along .*, 1.00\)"),
        ({"distortion": 0.1}, r"/cam/image_raw: expected rectified images.*found distortion .*\[0.1"),
        ({"model": "equidistant"}, "/cam/image_raw: expected rectified images.*found distortion 'equidistant'"),
        (
            {"topics": RECTIFIED, "image_topic": RECTIFIED.image, "shift": -2.4},
            r"the left one of a pair, .* found \[-2.4, 0.0",
        ),
        ({"scan_stamps": {3: START - 2 * 10**9}}, "/points: expected a clock that isn't set back, found"),
        ({"empty_scans": tuple(range(N_SCANS))}, "/points: expected two usable messages at least, .* found 0"),
        ({"n_far": 60}, "/points: expected returns within 250 m, found 60 of 110 beyond: are they metres"),
        ({"encoding": "mono16"}, "/cam/image_raw: expected images as rgb8, .* JPEG or PNG, found 'mono16'"),
        ({"encoding": "png16"}, "/cam/image_raw: expected images as .* with 8 bits, found 'png' with pixels 'I"),
        ({"intensity_scale": -1.0}, "/points: expected a finite brightness from 0 up, found -245 to"),
        (
            {"topics": TOPICS._replace(transforms=("/tf",)), "tf_topic": "/tf", "drifting": "base_link mount"},
            r"/tf: expected a chain of fixed transforms between base_link and optical.* -> mount \(changes\)",
        ),
        ({"info_size": (24, 80)}, "/cam/camera_info: expected the size of the images .*40 x 12 .*found 80 x"),
    ],
)
def test_what_a_bag_lacks_is_refused_by_name(tmp_path, changes, message):
    with pytest.raises(DataError, match=message):
        converted(tmp_path, **changes)
    assert not (tmp_path / "out").exists()
    assert {path.name for path in tmp_path.iterdir()} == {"bag"}  # no half of a drive


def test_a_folder_with_files_is_not_overwritten(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(DataError, match=r"out: expected a new or an empty folder, found one with files in it"):
        converted(tmp_path)


@pytest.mark.parametrize("height", [0.0, -1.7, 1730.0, float("nan")])
def test_a_height_that_no_lidar_has_is_refused(tmp_path, height):
    with pytest.raises(ArgumentError, match="--lidar-height"):
        convert_bag(tmp_path / "bag", tmp_path / "out", TOPICS, height)


def test_what_is_no_bag_is_named(tmp_path):
    (tmp_path / "no.bag").write_bytes(b"not a bag")
    for name in ("no.bag", "nothing.mcap"):
        with pytest.raises(DataError, match=f"{name}: expected a bag of ROS 1"):
            convert_bag(tmp_path / name, tmp_path / "out", TOPICS, HEIGHT)


def test_a_bag_cut_short_is_named(tmp_path):
    bag = write_bag(tmp_path / "bag", "ros1")
    bag.write_bytes(bag.read_bytes()[:-5000])
    with pytest.raises(DataError, match=r"bag\.bag"):
        convert_bag(bag, tmp_path / "out", TOPICS, HEIGHT)


def test_the_command_writes_a_drive_that_demo_finds(tmp_path, monkeypatch, capsys):
    bag = write_bag(tmp_path / "bag", "mcap")
    shutil.move(next(bag.glob("*.mcap")), tmp_path / "alone.mcap")  # a file without the folder of ROS 2
    options = ["--image", "/cam/image_raw", "--points", "/points", "--odometry", "/odom", "--lidar-height", "1.9"]
    arguments = ["data", "from-bag", str(tmp_path / "alone.mcap"), str(tmp_path / "out"), *options]
    monkeypatch.setattr("sys.argv", ["semgrid-edu", *arguments])
    with pytest.raises(SystemExit) as ended:
        run()
    assert not ended.value.code
    assert "holds the drive 2026_01_01 0001, frames: 6" in capsys.readouterr().out
    assert drive_at(tmp_path / "out")[0] == "KITTI raw"


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_the_demo_says_what_to_type_for_a_bag(tmp_path, kind):
    bag = write_bag(tmp_path / "bag", kind)
    file = bag if kind == "ros1" else next(one for one in bag.iterdir() if one.suffix != ".yaml")
    for path in (file, file.parent):
        with pytest.raises(DataError, match="first type semgrid-edu data from-bag BAG DIR --image TOPIC") as caught:
            drive_at(path)
        assert "\n" not in str(caught.value)
