"""A hand-made drive: what it holds comes out, and whatever is broken is named."""

import shutil

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from tiny_drive import (
    BASELINE,
    DATE,
    SIZE,
    K,
    write_tiny_drive,
)

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.errors import DataError
from semgrid_edu.fast import track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import State
from semgrid_edu.workshop.doubts import drive_doubts

slow_disk = settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture
def root(tmp_path):
    write_tiny_drive(tmp_path)
    return tmp_path


@pytest.fixture
def folder(root):
    return root / DATE / f"{DATE}_drive_0001_sync"


def read_all(root):
    return KittiRawDrive(root, DATE, "0001")[:]


def frames_equal(a, b):
    same = [np.array_equal(x, y) for x, y in (
        (a.image, b.image), (a.points, b.points), (a.camera.K, b.camera.K),
        (a.camera.T_camera_from_lidar, b.camera.T_camera_from_lidar),
        (a.T_world_from_lidar, b.T_world_from_lidar), (a.time, b.time),
    )]  # fmt: skip
    if a.labels is None or b.labels is None:
        return all(same) and a.labels is b.labels
    kinds = ("image", "birdseye", "visible")
    same += [np.array_equal(getattr(a.labels, kind), getattr(b.labels, kind)) for kind in kinds]
    return all(same) and np.array_equal(a.labels.depth, b.labels.depth, equal_nan=True)


class TestGap:
    """Scans that are missing between others, as KITTI's drive 0009 lacks four."""

    @pytest.fixture
    def gap(self, tmp_path):
        folder = write_tiny_drive(tmp_path, n_frames=6, labelled=())
        for k in (2, 3):
            (folder / "velodyne_points" / "data" / f"{k:010d}.bin").unlink()
        return KittiRawDrive(tmp_path, DATE, "0001")

    def test_empty_lines_of_scans_never_recorded_are_no_error(self, gap):
        times = [frame.time for frame in gap]
        path = gap.folder / "velodyne_points" / "timestamps.txt"
        lines = path.read_text().splitlines()
        path.write_text("\n".join("" if k in (2, 3) else line for k, line in enumerate(lines)) + "\n")
        again = [frame.time for frame in KittiRawDrive(gap.folder.parents[1], DATE, "0001")]
        np.testing.assert_allclose(again, times, atol=0.02)  # the IMU's times, 17 ms later

    def test_the_filter_predicts_over_it(self, gap):
        beliefs = [belief.probability for belief in track_drive(gap, GridSpec.compact(), seed=0)]
        unknown = [p[State.UNKNOWN].mean() for p in beliefs]
        assert unknown[1] < unknown[2] < unknown[3] > unknown[4]

    def test_a_link_to_nothing_is_an_error(self, tmp_path):
        folder = write_tiny_drive(tmp_path, n_frames=3, labelled=())
        path = folder / "velodyne_points" / "data" / "0000000001.bin"
        path.unlink()
        path.symlink_to(tmp_path / "nowhere.bin")
        with pytest.raises(DataError, match=r"0001.bin: expected a file, found nothing there"):
            KittiRawDrive(tmp_path, DATE, "0001")[1]


class TestRightCamera:
    @pytest.fixture
    def right(self, root, folder):
        """The drive with a right camera, which stands 0.5 m to the right of the left one."""
        shutil.copytree(folder / "image_02", folder / "image_03")
        Image.fromarray(np.zeros((*SIZE, 3), np.uint8)).save(folder / "image_03" / "data" / "0000000002.png")
        path = root / DATE / "calib_cam_to_cam.txt"
        P = np.c_[K, [K[0, 0] * (BASELINE - 0.5), 0, 0]]
        numbers = " ".join(map(str, P.ravel()))
        path.write_text(path.read_text() + f"S_rect_03: {SIZE[1]} {SIZE[0]}\nP_rect_03: {numbers}\n")
        return KittiRawDrive(root, DATE, "0001", view="image_03")

    def test_sees_its_images_from_where_it_stands(self, root, right):
        left = KittiRawDrive(root, DATE, "0001")
        assert not right[2].image.any()
        assert left[2].image.any()
        moved = right.camera.T_camera_from_lidar - left.camera.T_camera_from_lidar
        np.testing.assert_allclose(moved[:3, 3], [-0.5, 0, 0], atol=1e-12)
        assert right.problems() == []

    def test_has_no_labels_since_those_are_of_the_left_images(self, root, right):
        assert KittiRawDrive(root, DATE, "0001")[2].labels is not None
        assert right[2].labels is None


class TestSoundDrive:
    def test_indexes_like_a_list(self, root):
        drive = KittiRawDrive(root, DATE, "0001")
        assert len(drive) == 3
        assert frames_equal(drive[-1], drive[2])
        assert [frame.time for frame in drive[::-1]] == [frame.time for frame in reversed(list(drive))]
        for k in (3, -4):
            with pytest.raises(IndexError):
                drive[k]

    def test_labels_are_what_was_written(self, root, folder):
        frames = read_all(root)
        assert frames[0].labels is None
        labels = frames[2].labels
        depth = np.asarray(Image.open(folder / "labels" / "depth" / "0000000002.png")) / 256
        np.testing.assert_array_equal(labels.depth, np.where(depth > 0, depth, np.nan).astype(np.float32))
        assert labels.label_set.names[labels.birdseye[410, 150]] == "building"
        assert labels.visible.sum() == 310 * 200

    def test_camera_folder_may_be_absent(self, root, folder):
        shutil.rmtree(folder / "image_02")
        drive = KittiRawDrive(root, DATE, "0001")
        assert all(frame.image is None for frame in drive)
        assert drive.camera.lidar_height == 1.73
        assert drive.problems() == []


def test_missing_root_is_named(tmp_path):
    with pytest.raises(DataError, match="nowhere"):
        KittiRawDrive(tmp_path / "nowhere", DATE, "0001")


def replace(old, new):
    def damage(path):
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))

    return damage


def put(*values):
    def damage(path):
        points = np.fromfile(path, "<f4")
        points[: len(values)] = values
        points.tofile(path)

    return damage


def empty(path):
    path.write_bytes(b"")


def save_image(array):
    return lambda path: Image.fromarray(array).save(path)


def drop_last_line(path):
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))


def duplicate_last_line(path):
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:-1], lines[-2]]))


SCAN, IMAGE, PACKET = (
    "drive/velodyne_points/data/0000000001.bin",
    "drive/image_02/data/0000000001.png",
    "drive/oxts/data/0000000001.txt",
)
STAMPS = "drive/velodyne_points/timestamps.txt"
CAM, VELO, IMU = (f"calib_{name}.txt" for name in ("cam_to_cam", "velo_to_cam", "imu_to_velo"))
LABELS = "drive/labels"

DAMAGES = {
    **{f"{path} missing": (path, lambda path: path.unlink()) for path in (
        IMAGE, PACKET, STAMPS, CAM, VELO, IMU, f"{LABELS}/label_set.txt", f"{LABELS}/depth/0000000002.png")},
    **{f"{path} empty": (path, empty) for path in (SCAN, IMAGE, PACKET, STAMPS, CAM, VELO, IMU)},
    "NaN coordinate": (SCAN, put(np.nan)),
    "coordinate no LIDAR can see": (SCAN, put(1, 1e9)),
    "reflectance that is infinite": (SCAN, put(1, 2, 3, np.inf)),
    "image of another size": (IMAGE, save_image(np.zeros((6, 40, 3), np.uint8))),
    "grey image": (IMAGE, save_image(np.zeros(SIZE, np.uint8))),
    "too few fields": (PACKET, replace(" 0.0", "")),
    "NaN field": (PACKET, replace("0.0", "nan")),
    "latitude past the pole": (PACKET, replace("49.0", "149.0")),
    "a time too few": (STAMPS, drop_last_line),
    "a time twice": (STAMPS, duplicate_last_line),
    "a date that isn't": (STAMPS, replace("2026-01-01", "2026-13-01")),
    "times of another day": (STAMPS, lambda path: path.write_text(path.read_text().replace("2026", "2027"))),
    "image times missing": ("drive/image_02/timestamps.txt", drop_last_line),
    "key missing": (CAM, replace("P_rect_02", "P_rect_03")),
    "word in calibration": (CAM, replace("2.000000e+01", "twenty")),
    "number missing": (VELO, replace("0.000000e+00", "")),
    "no rotation": (IMU, replace("1.000000e+00", "2.000000e+00")),
    "mirror": (IMU, replace("1.000000e+00", "-1.000000e+00")),
    "focal length zero": (CAM, replace("P_rect_02: 2.000000e+01", "P_rect_02: 0.000000e+00")),
    "image size of nothing": (CAM, replace("S_rect_02: 40", "S_rect_02: 0")),
    "unknown label set": (f"{LABELS}/label_set.txt", replace("KITTI-14", "KITTI-15")),
    "class that isn't": (f"{LABELS}/image/0000000002.png", save_image(np.full(SIZE, 14, np.uint8))),
    "grey mask": (f"{LABELS}/visible/0000000002.png", save_image(np.full((710, 310), 7, np.uint8))),
    "labels on another grid": (f"{LABELS}/birdseye/0000000002.png", save_image(np.zeros((355, 155), np.uint8))),
    "depth in 8 bits": (f"{LABELS}/depth/0000000002.png", save_image(np.zeros(SIZE, np.uint8))),
}  # fmt: skip


def path_of(root, name):
    return root / DATE / name.replace("drive/", f"{DATE}_drive_0001_sync/")


@pytest.mark.parametrize(("name", "damage"), DAMAGES.values(), ids=DAMAGES)
def test_damage_is_named(root, name, damage):
    path = path_of(root, name)
    damage(path)
    with pytest.raises(DataError, match=r"expected .+, found .+") as caught:
        read_all(root)
    # Times that don't match are found by comparing two files; either may be the wrong one.
    assert path.name in str(caught.value)
    assert any(path.name in problem for problem in KittiRawDrive(root, DATE, "0001").problems())


def test_a_lidar_below_the_ground_is_named(root):
    with path_of(root, VELO).open("a") as file:
        file.write("lidar_height: -1.9\n")
    with pytest.raises(DataError, match=r"calib_velo_to_cam.txt: expected lidar_height: metres above the ground"):
        read_all(root)
    assert any("lidar_height" in problem for problem in KittiRawDrive(root, DATE, "0001").problems())


def test_problems_lists_every_broken_file_at_once(root):
    # Calibration 3, times 3, scans 2, packets 3, images 3, labels 4: none hides another.
    files = [path for path in (root / DATE).rglob("*") if path.is_file() and path.suffix in (".bin", ".txt", ".png")]
    sound = {"0000000000.bin", "label_set.txt"}
    broken = [path for path in files if path.name not in sound]
    for k, path in enumerate(broken):
        path.write_bytes(b"?" * (k + 1))  # no file is that before it again
    problems = KittiRawDrive(root, DATE, "0001").problems()
    assert len(broken) == 18
    assert len(problems) == len(broken)
    for path in broken:
        assert sum(problem.startswith(f"{path}: ") for problem in problems) == 1


def test_half_of_a_scan_is_suspected_though_the_whole_was_longer_than_the_others(root):
    path = path_of(root, SCAN)
    path.write_bytes(path.read_bytes()[: 16 * 360])  # of 720 points; the others have 700
    (problem,) = drive_doubts(KittiRawDrive(root, DATE, "0001"))
    assert path.name in problem


def test_arrays_of_a_frame_may_be_written_to(root):
    frame = read_all(root)[2]
    labels = frame.labels
    for array in (frame.image, frame.points, labels.image, labels.depth, labels.birdseye, labels.visible):
        assert array.flags.writeable


FILES = (SCAN, IMAGE, PACKET, STAMPS, CAM, VELO, IMU, *(
    f"{LABELS}/{kind}/0000000002.png" for kind in ("image", "depth", "birdseye", "visible")))  # fmt: skip


@slow_disk
@given(name=st.sampled_from(FILES), share=st.floats(0, 1, exclude_max=True))
def test_truncated_file_is_named_or_changes_nothing(tmp_path_factory, name, share):
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root)
    sound = read_all(root)
    path = path_of(root, name)
    content = path.read_bytes()
    length = int(share * len(content))
    if name == SCAN:
        length |= 1  # a cut between two points can't be seen in the file; problems() suspects it
    path.write_bytes(content[:length])
    try:
        frames = read_all(root)
    except DataError as error:
        complaint = str(error)
    else:
        complaint = path.name if all(map(frames_equal, frames, sound)) else "a wrong frame came out"
    assert path.name in complaint


@slow_disk
@given(name=st.sampled_from([name for name in FILES if name.endswith("png")]), data=st.data())
def test_flipped_bit_in_an_image_is_named(tmp_path_factory, name, data):
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root)
    path = path_of(root, name)
    content = bytearray(path.read_bytes())
    content[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(content)
    with pytest.raises(DataError, match=path.name):
        read_all(root)


@slow_disk
@given(name=st.sampled_from((PACKET, STAMPS, CAM, VELO, IMU)), junk=st.binary(min_size=1, max_size=40))
def test_junk_in_a_text_file_is_named(tmp_path_factory, name, junk):
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root)
    path = path_of(root, name)
    path.write_bytes(junk)
    with pytest.raises(DataError, match=path.name):
        read_all(root)


@slow_disk
@given(nanoseconds=st.lists(st.integers(1, 100_000_000), min_size=2, max_size=2))
def test_times_are_exact_to_the_nanosecond(root, nanoseconds):
    start = np.datetime64("2026-01-01T23:59:59.950000001", "ns")
    times = start + np.cumsum([0, *nanoseconds]).astype("timedelta64[ns]")
    path_of(root, STAMPS).write_text("".join(f"{str(time).replace('T', ' ')}\n" for time in times))
    found = [frame.time for frame in KittiRawDrive(root, DATE, "0001")]
    np.testing.assert_allclose(found, np.cumsum([0, *nanoseconds]) * 1e-9, rtol=0, atol=5e-10)
