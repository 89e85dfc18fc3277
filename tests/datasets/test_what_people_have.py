"""Folders as people have them: clips that begin late, images as JPEG, damaged frames; and doubts about their poses."""

import re

import numpy as np
import pytest
from PIL import Image
from test_kitti_raw import frames_equal
from test_semantic_kitti import write_images, write_sequence
from test_synthia import NAME, pose
from test_synthia import VIEW as SYNTHIA_VIEW
from test_synthia import root as synthia  # noqa: F401 (a fixture)
from test_zhang import write_run
from tiny_drive import DATE, write_tiny_drive
from tiny_pandaset import SCENE, write_tiny_pandaset

from semgrid_edu.datasets import KittiRawDrive, PandasetScene, SemanticKittiSequence
from semgrid_edu.datasets.drive_files import first_sound, sound_frames
from semgrid_edu.errors import DataError
from semgrid_edu.workshop.doubts import drive_doubts
from semgrid_edu.workshop.paper.datasets import KittiTrackingRun, SynthiaSequence
from semgrid_edu.workshop.pose_doubts import path_doubts

READERS = {
    "KITTI raw": (
        write_tiny_drive,
        lambda root: KittiRawDrive(root, DATE, "0001"),
        "*.bin",
        {"*/*/*/timestamps.txt": "2025-12-31 00:00:00.000000000"},
    ),
    "tracking": (
        lambda root: write_run(root, n_frames=3),
        lambda root: KittiTrackingRun(root, 9),
        "*.bin",
        {"*/oxts/0009.txt": "48 8 0" + 27 * " 0"},
    ),
    "SemanticKITTI": (
        lambda root: write_images(write_sequence(root) / "sequences" / "00"),
        lambda root: SemanticKittiSequence(root, "00"),
        "*.bin",
        {"*/00/times.txt": "1.0", "*/00/poses.txt": "1 0 0 9 0 1 0 9 0 0 1 9"},
    ),
    "PandaSet": (write_tiny_pandaset, lambda root: PandasetScene(root, SCENE), "lidar/*.pkl.gz", {}),
}
"""Writes three frames, opens them, names of their scans, and files with a line a frame: what it could be before."""


@pytest.mark.parametrize("k", range(3))
@pytest.mark.parametrize("reader", READERS)
def test_a_missing_scan_is_a_gap_in_the_same_time_line(tmp_path, reader, k):
    write, opened, scans, _ = READERS[reader]
    write(tmp_path)
    whole = opened(tmp_path)[:]
    scan = sorted(tmp_path.rglob(scans))[k]
    scan.unlink()
    drive = opened(tmp_path)
    assert (drive.gaps, drive.problems()) == ((k,), [])
    for j, (frame, expected) in enumerate(zip(drive, whole, strict=True)):
        assert frame.points.shape == ((0, 4) if j == k else expected.points.shape)
        np.testing.assert_array_equal(frame.image, expected.image)
        np.testing.assert_array_equal(frame.T_world_from_lidar, expected.T_world_from_lidar)
        assert frame.time == expected.time
        assert frame.camera.lidar_height == pytest.approx(expected.camera.lidar_height)
    assert any(f"{scan.name}: expected a scan, found none" in doubt for doubt in drive_doubts(drive))


@pytest.mark.parametrize("lines", ["of the clip", "of the whole drive"])
@pytest.mark.parametrize("reader", [reader for reader, (*_, by_line) in READERS.items() if by_line])
def test_a_clip_may_begin_at_any_frame(tmp_path, reader, lines):
    write, opened, _, by_line = READERS[reader]
    write(tmp_path)
    whole = opened(tmp_path)[1:]
    for path in tmp_path.rglob("*"):
        if path.is_file() and path.stem.isdecimal() and int(path.stem) == 0:
            path.unlink()
    for path, line in ((path, line) for pattern, line in by_line.items() for path in tmp_path.glob(pattern)):
        before = [] if lines == "of the clip" else [f"{line}\n"]
        path.write_text("".join(before + path.read_text().splitlines(keepends=True)[1:]))
    clip = opened(tmp_path)
    assert (*clip.numbers, clip.gaps, clip.problems()) == (1, 2, (), [])
    for frame, expected in zip(clip, whole, strict=True):
        np.testing.assert_array_equal(frame.points, expected.points)
        np.testing.assert_array_equal(frame.image, expected.image)
        assert frame.time == pytest.approx(expected.time - whole[0].time)
        way, expected_way = (
            np.linalg.inv(first.T_world_from_lidar) @ one.T_world_from_lidar
            for first, one in ((clip[0], frame), (whole[0], expected))
        )
        np.testing.assert_allclose(way, expected_way, atol=1e-6)
        if expected.labels:
            np.testing.assert_array_equal(frame.labels.birdseye, expected.labels.birdseye)


def as_jpeg(folder):
    for path in folder.rglob("*.png"):
        Image.open(path).convert("RGB").save(path.with_suffix(".jpg"), quality=100, subsampling=0)
        path.unlink()


def test_packets_of_the_whole_drive_may_lie_beside_a_clip(tmp_path):
    folder = write_tiny_drive(tmp_path, n_frames=5, labelled=())
    last = KittiRawDrive(tmp_path, DATE, "0001")[4]
    for k in range(3):
        for sensor, suffix in (("velodyne_points", "bin"), ("image_02", "png")):
            (folder / sensor / "data" / f"{k:010d}.{suffix}").unlink()
    clip = KittiRawDrive(tmp_path, DATE, "0001")
    assert (len(clip), clip.gaps) == (2, ())
    np.testing.assert_array_equal(clip[1].points, last.points)


def close(image, expected):
    return np.abs(image.astype(int) - expected).mean() < 3


def test_images_may_be_jpeg(tmp_path, synthia):  # noqa: F811
    raw = write_tiny_drive(tmp_path / "raw", labelled=())
    write_run(tmp_path / "tracking")
    drives = [
        lambda: KittiRawDrive(tmp_path / "raw", DATE, "0001"),
        lambda: KittiTrackingRun(tmp_path / "tracking", 9),
        lambda: SynthiaSequence(synthia, NAME),
    ]
    before = [drive()[1].image for drive in drives]
    for folder in (raw, tmp_path / "tracking", synthia / NAME / "RGB"):
        as_jpeg(folder)
    for drive, expected in zip(drives, before, strict=True):
        assert close(drive()[1].image, expected)
        assert drive().problems() == []
    path = raw / "image_02" / "data" / "0000000001.jpg"
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(DataError, match=r"0001.jpg: expected a sound JPEG image"):
        drives[0]()[1]
    Image.open(raw / "image_02" / "data" / "0000000000.jpg").convert("L").save(path)
    with pytest.raises(DataError, match=r"0001.jpg: expected RGB of 12 x 40 pixels, found L"):
        drives[0]()[1]


class TestDamagedFrames:
    @pytest.fixture
    def drive(self, tmp_path):
        folder = write_tiny_drive(tmp_path, n_frames=5, labelled=())
        (folder / "velodyne_points" / "data" / "0000000000.bin").write_bytes(b"no scan")
        (folder / "image_02" / "data" / "0000000003.png").write_bytes(b"no image")
        return KittiRawDrive(tmp_path, DATE, "0001")

    def test_are_left_out_and_named(self, drive):
        left_out = []
        frames = list(sound_frames(drive, range(5), lambda k, error: left_out.append((k, error.path.name))))
        assert [frame.time for frame in frames] == [drive[k].time for k in (1, 2, 4)]
        assert left_out == [(0, "0000000000.bin"), (3, "0000000003.png")]

    def test_end_the_drive_by_default(self, drive):
        with pytest.raises(DataError, match=r"0003.png: expected a sound PNG image"):
            list(sound_frames(drive, range(1, 5)))

    def test_a_drive_without_a_sound_frame_ends_in_any_case(self, drive):
        for path in drive.folder.rglob("*.bin"):
            path.write_bytes(b"no scan")
        with pytest.raises(DataError, match=r"0000.bin"):
            list(sound_frames(drive, range(5), lambda *_: None))

    def test_the_world_begins_at_the_first_sound_packet(self, drive):
        (drive.folder / "oxts" / "data" / "0000000000.txt").write_text("?")
        assert first_sound(lambda k: drive[k].time, range(5)) == pytest.approx(0.1)
        expected = np.linalg.inv(drive._T_lidar_from_imu)
        np.testing.assert_allclose(drive[1].T_world_from_lidar, expected, atol=1e-9)


def test_poses_of_a_tracking_run_are_doubted(tmp_path):
    write_run(tmp_path, n_frames=12)
    assert not any("expected" in doubt and "oxts" in doubt for doubt in drive_doubts(KittiTrackingRun(tmp_path, 9)))
    path = tmp_path / "training/oxts/0009.txt"
    packets = [line.split() for line in path.read_text().splitlines()]
    for words in packets[6:]:
        words[2] = repr(float(words[2]) + 1.5)
    path.write_text("".join(" ".join(words) + "\n" for words in packets))
    says = "frame 6: expected a height to which the steps around it lead, found one .1.5 m"
    doubts = drive_doubts(KittiTrackingRun(tmp_path, 9))
    assert any(re.search(says, doubt) for doubt in doubts), doubts


def synthia_poses(folder, positions, scale=1.0):
    for k, (ahead, up) in enumerate(positions):
        numbers = np.array(pose(0).split(), float).reshape(4, 4).T
        numbers[:3, 3] = 10 + scale * ahead, 2 + up, 3
        (folder / "CameraParams" / SYNTHIA_VIEW / f"{k:06d}.txt").write_text(" ".join(map(str, numbers.T.ravel())))


@pytest.fixture
def long_sequence(synthia):  # noqa: F811
    """Ten frames, whose camera moves 0.8 m ahead at a time."""
    folder = synthia / NAME
    for k in range(3, 10):
        for kind in ("RGB", "Depth", "GT/LABELS"):
            source = folder / kind / SYNTHIA_VIEW / "000002.png"
            (folder / kind / SYNTHIA_VIEW / f"{k:06d}.png").write_bytes(source.read_bytes())
    synthia_poses(folder, [(0.8 * k, 0.0) for k in range(10)])
    return synthia


@pytest.mark.parametrize(
    ("positions", "says"),
    [
        ([(0.8 * k, 0.0) for k in range(10)], None),
        ([(0.8 * k + 9 * (k >= 5), 0.0) for k in range(10)], "000005.txt: expected a place where the steps"),
        ([(0.8 * k, 3.0 * (k >= 5)) for k in range(10)], "000005.txt: expected a height .* found one .3.0 m"),
        ([(-0.8 * k, 0.0) for k in range(10)], "expected a vehicle that moves the way it looks"),
    ],
)
def test_poses_of_a_synthia_sequence_are_doubted(long_sequence, positions, says):
    synthia_poses(long_sequence / NAME, positions)
    doubts = [line for line in drive_doubts(SynthiaSequence(long_sequence, NAME)) if "CameraParams" in line]
    assert len(doubts) == (says is not None), doubts
    if says:
        assert re.search(says, doubts[0])


def rewritten(pattern, change):
    """Change the bytes of all files of a drive whose names fit."""

    def spoil(folder):
        for path in folder.parent.rglob(pattern):
            path.write_bytes(change(path.read_bytes()))

    return spoil


def floats(change):
    return rewritten("*.bin", lambda content: change(np.frombuffer(content, "<f4").reshape(-1, 4)).tobytes())


HARMLESS = {
    "Windows line ends": rewritten("*.txt", lambda content: content.replace(b"\n", b"\r\n")),
    "a byte order mark": rewritten("*.txt", lambda content: b"\xef\xbb\xbf" + content),
    "a blank line at the end": rewritten("timestamps.txt", lambda content: content + b"\n"),
    "files of a Mac": lambda folder: (folder / "velodyne_points/data/._0000000001.bin").write_bytes(b"x"),
    "copies": lambda folder: (folder / "velodyne_points/data/0000000001 (1).bin").write_bytes(b"x"),
    "capital letters": lambda folder: [p.rename(p.with_suffix(".PNG")) for p in (folder / "image_02").rglob("*.png")],
}


@pytest.mark.parametrize("spoil", HARMLESS.values(), ids=HARMLESS)
def test_what_does_no_harm_changes_nothing(tmp_path, spoil):
    folder = write_tiny_drive(tmp_path, labelled=())
    before = KittiRawDrive(tmp_path, DATE, "0001")[:]
    spoil(folder)
    drive = KittiRawDrive(tmp_path, DATE, "0001")
    assert (drive.problems(), drive_doubts(drive)) == ([], [])
    assert all(frames_equal(*pair) for pair in zip(drive, before, strict=True))


def test_a_run_and_a_sequence_from_windows(tmp_path, synthia):  # noqa: F811
    write_run(tmp_path, n_frames=3)
    before = KittiTrackingRun(tmp_path, 9)[2], SynthiaSequence(synthia, NAME)[2]
    for path in (*(tmp_path / "training").rglob("*.txt"), *(synthia / NAME).rglob("*.txt")):
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    path = tmp_path / "training/oxts/0009.txt"
    path.write_bytes(path.read_bytes() + b"\r\n")
    after = KittiTrackingRun(tmp_path, 9)[2], SynthiaSequence(synthia, NAME)[2]
    for frame, expected in zip(after, before, strict=True):
        np.testing.assert_array_equal(frame.T_world_from_lidar, expected.T_world_from_lidar)


OTHER_FORMATS = {
    "64 bits": (floats(lambda p: p.astype("<f8")), r"0000.bin: expected finite .* do the floats have 64 bits"),
    "big-endian": (floats(lambda p: p.astype(">f4")), r"0000.bin: expected finite .* are the floats big-endian"),
    "NumPy": (rewritten("*.bin", lambda c: b"\x93NUMPY" + c), r"0000.bin: expected points .* a file of NumPy"),
    "text": (rewritten("*.bin", lambda c: b"1.0 2.0 3.0\n" * 700), r"0000.bin: expected floats in binary, found text"),
    "commas": (rewritten("00*.txt", lambda c: c.replace(b".", b",")), r"0000.txt: expected numbers"),
    "UTF-16": (rewritten("00*.txt", lambda c: c.decode().encode("utf-16")), r"0000.txt: expected ASCII text"),
    "names of six digits": (
        lambda folder: [path.rename(path.with_name(path.name[4:])) for path in folder.rglob("0000*.*")],
        r"data: expected frames such as 0000000000.bin, found none, but 3 others, such as 000000.bin",
    ),
}


@pytest.mark.parametrize(("spoil", "says"), OTHER_FORMATS.values(), ids=OTHER_FORMATS)
def test_another_format_is_named(tmp_path, spoil, says):
    spoil(write_tiny_drive(tmp_path, labelled=()))
    with pytest.raises(DataError, match=says):
        KittiRawDrive(tmp_path, DATE, "0001")[:]


@pytest.mark.parametrize(("factor", "says"), [(255, "0 to 1, found .*: are they bytes"), (-1, "from 0 to 1, found -")])
def test_reflectances_that_are_no_fractions_are_doubted(tmp_path, factor, says):
    floats(lambda p: (p * (1, 1, 1, factor)).astype("<f4"))(write_tiny_drive(tmp_path, labelled=()))
    (doubt,) = drive_doubts(KittiRawDrive(tmp_path, DATE, "0001"))
    assert re.search(says, doubt)


@pytest.mark.parametrize("unit", [1e3, 1e9, 1e-3])
def test_times_in_another_unit_are_doubted(unit):
    poses = np.tile(np.eye(4), (9, 1, 1))
    poses[:, 0, 3] = np.arange(9)
    (doubt,) = path_doubts(poses, unit * np.arange(9) / 10, ["times"] * 9)
    assert doubt.startswith("times: expected times in seconds")
    assert path_doubts(poses, np.arange(9) / 10, ["times"] * 9) == []


def test_a_depth_camera_needs_no_reflectance(synthia):  # noqa: F811
    assert not any("reflectance" in doubt for doubt in drive_doubts(SynthiaSequence(synthia, NAME)))
