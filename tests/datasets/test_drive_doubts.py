"""What is doubtful about a drive is said, and a sound drive is believed."""

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation
from tiny_drive import DATE, SIZE, K, write_packet, write_tiny_dataset, write_tiny_drive

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.oxts import EARTH_RADIUS, read_packet
from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.workshop import demo
from semgrid_edu.workshop.commands import main as cli
from semgrid_edu.workshop.commands.arguments import dataset_doubts
from semgrid_edu.workshop.doubts import drive_doubts, frame_doubts
from semgrid_edu.workshop.pose_doubts import FASTEST, packet_doubts, path_doubts


def test_sound_drives_are_believed(tmp_path):
    assert drive_doubts(sample_drive()) == []
    assert dataset_doubts(write_tiny_dataset(tmp_path), "train", "test") == []


def places(folder: Path, metres: list[float]) -> dict:
    """Packets of a car that drives north, at distances from its start."""
    paths = [folder / f"{k}.txt" for k in range(len(metres))]
    for path, north in zip(paths, metres, strict=True):
        write_packet(path, np.array([0.0, north, 0.0]), (0.0, 0.0, np.pi / 2))
    return {path: read_packet(path) for path in paths}


def test_a_packet_is_doubtful_just_beyond_the_way_of_the_fastest_car(tmp_path):
    slow, fast = 0.99 * FASTEST / 10, 1.01 * FASTEST / 10
    packets = places(tmp_path, [0.0, slow, slow + fast, 2 * slow + fast])
    (doubt,) = packet_doubts(packets, np.arange(4) / 10)
    assert doubt.startswith(f"{tmp_path / '2.txt'}: expected a place within 10 m of the packet before, found 10 m")


def test_a_gap_in_time_allows_a_longer_way(tmp_path):
    packets = places(tmp_path, [0.0, 60.0])
    assert len(packet_doubts(packets, np.array([0.0, 0.1]))) == 1
    assert packet_doubts(packets, np.array([0.0, 1.0])) == []
    assert packet_doubts(packets, np.array([0.0, np.nan])) == []
    assert packet_doubts({}, np.empty(0)) == []


def packets_of_a_drive(change: Callable[[np.ndarray], None] = lambda fields: None) -> dict[Path, np.ndarray]:
    """Packets of a car that drives 2.5 s at 10 m/s to the north-north-east, 49 degrees north."""
    yaw = np.radians(70)
    metres = 10 * np.arange(25) / 10
    fields = np.zeros((25, 30))
    fields[:, 0] = 49 + np.degrees(metres * np.sin(yaw) / EARTH_RADIUS)
    fields[:, 1] = 8 + np.degrees(metres * np.cos(yaw) / EARTH_RADIUS / np.cos(np.radians(49)))
    fields[:, 5] = yaw
    fields[:, 6:8] = 10 * np.sin(yaw), 10 * np.cos(yaw)
    fields[:, 27] = 4
    change(fields)
    return {Path(f"{k}.txt"): packet for k, packet in enumerate(fields)}


def from_frame_12(field: int, by: float) -> Callable[[np.ndarray], None]:
    def change(fields: np.ndarray) -> None:
        fields[12:, field] += by

    return change


def everywhere(field: int, values: Callable[[np.ndarray], object]) -> Callable[[np.ndarray], None]:
    def change(fields: np.ndarray) -> None:
        fields[:, field] = values(fields)

    return change


METRE = 360 / (2 * np.pi * EARTH_RADIUS)
"""A metre to the north, degrees of latitude."""

POSES = {
    "3 m to the north": (from_frame_12(0, 3 * METRE), r"^12.txt: .* where the steps around it lead, found one 3\.0 m"),
    "3 m to the east": (from_frame_12(1, 3 * METRE / np.cos(np.radians(49))), r"^12.txt: .* found one 3\.0 m"),
    "1 m up": (from_frame_12(2, 1.0), r"^12.txt: expected a height .* found one \+1\.0 m"),
    "20 degrees of yaw": (from_frame_12(5, np.radians(20)), r"^12.txt: expected a turn of at most 11 .* 20 degrees"),
    "9 degrees of roll": (from_frame_12(3, np.radians(9)), r"^12.txt: expected roll and pitch .* found 9 degrees"),
    "clockwise": (everywhere(5, lambda f: -f[:, 5]), "moves the way it looks .* is yaw clockwise[?]"),
    "from north": (everywhere(5, lambda f: f[:, 5] - np.pi / 2), "moves the way it looks .* is yaw from north[?]"),
    "like a compass": (everywhere(5, lambda f: np.pi / 2 - f[:, 5]), "is yaw clockwise from north[?]"),
    "longitude first": (everywhere([0, 1], lambda f: f[:, [1, 0]]), "are latitude and longitude swapped[?]"),
    "km/h": (everywhere([6, 7], lambda f: 3.6 * f[:, 6:8]), r"as fast as .* found 0\.28 times as fast"),
    "no fix": (everywhere(27, lambda f: np.where(np.arange(25) < 7, 4, 1)), r"^7.txt: .* in 18 of 25 packets"),
}


def test_a_drive_that_a_car_can_have_driven_is_believed():
    assert packet_doubts(packets_of_a_drive(), np.arange(25) / 10) == []


@pytest.mark.parametrize(("change", "says"), POSES.values(), ids=POSES)
def test_poses_that_no_car_can_have_are_named(change, says):
    doubts = packet_doubts(packets_of_a_drive(change), np.arange(25) / 10)
    assert any(re.search(says, doubt) for doubt in doubts), doubts
    assert len(doubts) <= 2


def test_braking_and_turning_as_hard_as_a_car_can_is_believed():
    t = np.arange(30) / 10
    speed = np.maximum(20 - 9 * t, 0)
    yaw = 0.5 * t
    steps = 0.1 * speed[:, None] * np.c_[np.cos(yaw), np.sin(yaw)]
    poses = np.tile(np.eye(4), (30, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("z", yaw[:, None]).as_matrix()
    poses[:, :2, 3] = np.cumsum(steps, axis=0)
    assert path_doubts(poses, t, range(30)) == []
    assert path_doubts(poses[:1], t[:1], range(1)) == []


def test_doubts_do_not_stop_at_a_damaged_packet_or_missing_times(tmp_path):
    folder = write_tiny_drive(tmp_path, n_frames=5)
    (folder / "oxts" / "data" / "0000000001.txt").write_text("?")
    write_packet(folder / "oxts" / "data" / "0000000003.txt", np.array([4e6, 0, 0]), (0.0, 0.0, 0.0))
    doubts = drive_doubts(KittiRawDrive(tmp_path, DATE, "0001"))
    assert [doubt.partition(":")[0][-14:] for doubt in doubts] == ["0000000003.txt", "0000000004.txt"]
    (folder / "oxts" / "timestamps.txt").unlink()
    assert drive_doubts(KittiRawDrive(tmp_path, DATE, "0001")) == []


@pytest.mark.parametrize(("date", "drive"), [("", "0001"), (DATE, "")])
def test_an_empty_name_is_refused(tmp_path, date, drive):
    write_tiny_drive(tmp_path)
    with pytest.raises(ArgumentError, match=r"(date|drive): expected"):
        KittiRawDrive(tmp_path, date, drive)


def scans(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """Change the returns (N, 4) of every scan of a drive."""

    def spoil(folder: Path) -> None:
        for path in (folder / "velodyne_points" / "data").glob("*.bin"):
            points = np.fromfile(path, "<f4").reshape(-1, 4)
            path.write_bytes(change(points).astype("<f4").tobytes())

    return spoil


def again(sensor: str) -> Callable[[Path], None]:
    """Write the first file of a sensor over all others."""

    def spoil(folder: Path) -> None:
        first, *others = sorted((folder / sensor / "data").iterdir())
        for other in others:
            shutil.copyfile(first, other)

    return spoil


def black(folder: Path) -> None:
    for path in (folder / "image_02" / "data").glob("*.png"):
        Image.new("RGB", SIZE[::-1]).save(path)


def intrinsics(fx: float, cx: float) -> Callable[[Path], None]:
    """Write another focal length and principal point, pixels."""

    def spoil(folder: Path) -> None:
        P = np.c_[[fx, 0, 0], [0, K[1, 1], 0], [cx, K[1, 2], 1], [0, 0, 0]]
        path = folder.parent / "calib_cam_to_cam.txt"
        lines = [line for line in path.read_text().splitlines() if not line.startswith("P_rect_02")]
        path.write_text("\n".join([*lines, f"P_rect_02: {' '.join(map(str, P.ravel()))}\n"]))

    return spoil


def rotation(R: np.ndarray) -> Callable[[Path], None]:
    """Write another rotation from LIDAR to camera."""
    text = f"R: {' '.join(map(str, np.ravel(R)))}\nT: 0 0 0\n"
    return lambda folder: (folder.parent / "calib_velo_to_cam.txt").write_text(text)


LIDAR_FROM_CAMERA = np.array([[0, 0, 1.0], [-1, 0, 0], [0, -1, 0]])

DOUBTFUL = {
    "scans of only zeros": (scans(lambda p: 0 * p), "found only zeros"),
    "camera axes": (scans(lambda p: p[:, [1, 2, 0, 3]] * (-1, -1, 1, 1)), "are they in camera axes"),
    "three columns": (scans(lambda p: p[:, :3].reshape(-1, 4)), "were three columns read as four"),
    "axes of graphics": (scans(lambda p: p[:, [1, 2, 0, 3]] * (-1, 1, -1, 1)), "does y point up"),
    "no reflectance": (scans(lambda p: p * (1, 1, 1, 0)), "returns with a reflectance, found 0 for 100%"),
    "50 m below ground": (scans(lambda p: p - (0, 0, 50, 0)), "1.73 m below .*, found 0% .* below z = -51.7 m"),
    "all behind": (scans(lambda p: p * (-1, 1, 1, 1)), "returns ahead .*, found 0 of 700"),
    "beside the image": (scans(lambda p: p - (0, 75, 0, 0)), "returns in the image, found 0 of 700"),
    "the same scan": (again("velodyne_points"), "scans that differ, found the same"),
    "the same image": (again("image_02"), "images that differ, found the same"),
    "black images": (black, "shows something, found .* from 0 to 0"),
    "identity": (rotation(np.eye(3)), "from LIDAR to camera .*, found the identity"),
    "camera to LIDAR": (rotation(LIDAR_FROM_CAMERA), "from LIDAR to camera .*, found"),
}
"""Drives that are done after a line that says what can't be right: how to make one, and what is said."""

NONSENSE = {
    "focal length of 1e30": (intrinsics(1e30, 19.5), "calib_cam_to_cam.txt: expected in K focal lengths of"),
    "no focal length": (intrinsics(1e-6, 19.5), "calib_cam_to_cam.txt: expected in K focal lengths of"),
    "principal point": (intrinsics(20, 4000), "in K a principal point within the image of 40 x 12 pixels, found .4000"),
    "millimetres": (scans(lambda p: p * (1e3, 1e3, 1e3, 1)), "expected finite coordinates within 250 m"),
}
"""Drives that are refused."""


@pytest.fixture
def spoilt(request, tmp_path) -> KittiRawDrive:
    request.param(write_tiny_drive(tmp_path, labelled=()))
    return KittiRawDrive(tmp_path, DATE, "0001")


@pytest.fixture
def demo_says(tmp_path, monkeypatch, capsys) -> Callable[[], str]:
    """Run the demo up to where the work begins, which reads the first frame, and return what it says."""

    def says() -> str:
        monkeypatch.setattr("sys.argv", ["semgrid-edu", "demo", str(tmp_path)])
        monkeypatch.setattr(demo, "write_demo", lambda drive, *_, **__: (drive[0], Path("done").resolve() / "page")[1])
        with pytest.raises(SystemExit) as ended:
            cli.run()
        return f"{capsys.readouterr().err}{ended.value.code or ''}"

    return says


@pytest.mark.parametrize(("spoilt", "says"), DOUBTFUL.values(), ids=DOUBTFUL, indirect=["spoilt"])
def test_what_cannot_be_right_is_said_before_the_work(spoilt, says, demo_says):
    assert any(re.search(says, line) for line in drive_doubts(spoilt))
    assert spoilt.problems() == []
    assert re.search(f"doubtful: .*{says}", demo_says())


@pytest.mark.parametrize(("spoilt", "says"), NONSENSE.values(), ids=NONSENSE, indirect=["spoilt"])
def test_nonsense_is_refused(spoilt, says, demo_says):
    assert any(re.search(says, line) for line in spoilt.problems())
    with pytest.raises(DataError, match=says):
        next(run_pipeline(spoilt, Stages()))
    assert re.search(f"(?m)^semgrid-edu: .*{says}", demo_says())


def test_returns_in_millimetres_that_no_reader_refused():
    frame = sample_drive()[0]
    (doubt,) = frame_doubts([replace(frame, points=1000 * frame.points)])
    assert "are they in millimetres" in doubt


LAYOUTS = {
    "is z the height above the ground": lambda p: p + np.array([0, 0, 1.73, 0]),
    "does z point down": lambda p: p * (1, 1, -1, 1),
    "are they in kilometres": lambda p: p * (1e-3, 1e-3, 1e-3, 1),
    "does x point up": lambda p: p[:, [2, 0, 1, 3]],
    "were five columns read": lambda p: np.c_[p, np.zeros(len(p))].ravel()[: 5 * len(p) // 4 * 4].reshape(-1, 4),
}


@pytest.mark.parametrize("drive", [sample_drive, real_drive])
@pytest.mark.parametrize(("question", "spoil"), LAYOUTS.items(), ids=LAYOUTS)
def test_the_right_mistake_is_named_between_walls_too(question, spoil, drive):
    """On the real street more returns are on walls, 1.73 m above the ground, than on the ground itself."""
    frame = drive()[0]
    points = spoil(frame.points).astype(np.float32)
    (doubt,) = [doubt for doubt in frame_doubts([replace(frame, points=points)]) if "ground about" in doubt]
    assert question in doubt


def test_a_scan_without_its_ground_is_not_taken_for_kilometres():
    """Returns at the height of the LIDAR would be near the ground at a thousand times their distance."""
    frame = sample_drive()[0]
    doubts = frame_doubts([replace(frame, points=frame.points[frame.points[:, 2] > 0])])
    assert not any("kilometres" in doubt for doubt in doubts)


def test_no_frames_and_no_returns_give_no_doubt():
    frame = sample_drive()[0]
    assert frame_doubts([]) == []
    assert frame_doubts([replace(frame, points=frame.points[:0], image=None)]) == []


def test_a_frozen_sensor_is_said_wherever_the_drive_freezes():
    frames = sample_drive()[:]
    frames[12:] = [replace(frame, points=frames[12].points) for frame in frames[12:]]
    (doubt,) = frame_doubts(frames)
    assert doubt == "frames: expected scans that differ, found the same scan again in the next frame (frame 18)"
