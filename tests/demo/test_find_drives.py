"""`demo PATH`: which drive is in a folder, and a reader of fifteen lines for a recording of one's own."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from tiny_drive import DATE, write_tiny_drive

from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.errors import DataError
from semgrid_edu.workshop.demo.find_drives import drive_at, find_drives, read_with

COMMANDS = Path(__file__).parents[2] / "docs" / "commands.md"


def the_guide_s_reader() -> str:
    """The reader that docs/commands.md shows."""
    (code,) = re.findall(r"```python\n(.*?class Recording.*?)```", COMMANDS.read_text(encoding="utf-8"), re.DOTALL)
    return code


@pytest.fixture
def data(tmp_path):
    write_tiny_drive(tmp_path)
    return tmp_path


@pytest.mark.parametrize("inside", ["", DATE, f"{DATE}/{DATE}_drive_0001_sync", f"{DATE}/{DATE}_drive_0001_sync/oxts"])
def test_one_drive_is_found_from_above_and_from_within(data, inside):
    kind, drive = drive_at(data / inside)
    assert (kind, len(drive)) == ("KITTI raw", 3)
    np.testing.assert_array_equal(drive[0].points, drive_at(data)[1][0].points)


@pytest.mark.parametrize("relative", [False, True])
def test_of_two_drives_neither_is_chosen(data, monkeypatch, relative):
    write_tiny_drive(data, "0002")
    monkeypatch.chdir(data.parent)
    with pytest.raises(DataError, match=r"give the folder .* found .*_0001_sync, .*_0002_sync"):
        drive_at(data.name if relative else data)


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(DataError, match="no folder"):
        drive_at(tmp_path / "nowhere")
    with pytest.raises(DataError, match="the folder of a recording, found no folder"):
        read_with("my_reader.py", tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("made", "kind"),
    [
        ("scenes/002/lidar/poses.json", "PandaSet"),
        ("dataset/sequences/08/velodyne/000000.bin", "SemanticKITTI"),
        ("training/velodyne/0011/000000.bin", "KITTI tracking"),
    ],
)
def test_other_data_sets_are_known_by_their_folders(tmp_path, made, kind):
    (tmp_path / made).parent.mkdir(parents=True)
    (tmp_path / made).touch()
    assert [drive.kind for drive in find_drives(tmp_path)] == [kind]


def test_a_layout_without_a_reader_is_named(tmp_path):
    (tmp_path / "v1.0-mini").mkdir()
    with pytest.raises(DataError, match="nuScenes"):
        drive_at(tmp_path)


def test_one_camera_is_one_camera(tmp_path):
    (tmp_path / "sequences" / "08" / "velodyne").mkdir(parents=True)
    with pytest.raises(DataError, match="no --camera"):
        drive_at(tmp_path, camera="image_03")


@pytest.fixture
def recording(tmp_path):
    """Three frames of the sample drive as the guide's recording keeps them."""
    folder, drive = tmp_path / "recording", sample_drive()
    frames = drive[:3]
    for name in ("images", "scans"):
        (folder / name).mkdir(parents=True)
    for k, frame in enumerate(frames):
        shutil.copy(drive.image_file(k), folder / "images" / f"{k:06d}.png")
        np.save(folder / "scans" / f"{k:06d}.npy", frame.points)
    np.savetxt(folder / "poses.txt", [frame.T_world_from_lidar.ravel() for frame in frames])
    np.savetxt(folder / "times.txt", [frame.time for frame in frames])
    np.savetxt(folder / "K.txt", drive.camera.K)
    np.savetxt(folder / "T_camera_from_lidar.txt", drive.camera.T_camera_from_lidar)
    (tmp_path / "my_reader.py").write_text(the_guide_s_reader())
    return folder


def test_the_guide_s_reader_reads_a_recording(recording):
    drive = read_with(recording.parent / "my_reader.py", recording)
    assert len(drive) == 3
    for mine, theirs in zip(drive, sample_drive()[:3], strict=True):
        np.testing.assert_array_equal(mine.image, theirs.image)
        np.testing.assert_array_equal(mine.points, theirs.points)
        np.testing.assert_allclose(mine.T_world_from_lidar, theirs.T_world_from_lidar)
        np.testing.assert_allclose(mine.camera.K, theirs.camera.K)
        assert mine.time == pytest.approx(theirs.time)


def test_the_guide_s_reader_is_short():
    assert sum(bool(line.strip()) for line in the_guide_s_reader().splitlines()) <= 25


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("", "one class derived from FrameSequence, found none"),
        ("import no_such_module", "a file that Python can import"),
        (
            "class Recording(FrameSequence):\n    def __init__(self, f): 1 / 0\n    def __len__(self): return 1",
            "ZeroDivision",
        ),
        (
            "class Recording(FrameSequence):\n    def __init__(self, f): pass\n    def __len__(self): return 0",
            "found none",
        ),
    ],
)
def test_a_reader_that_cannot_read_is_named(tmp_path, code, found):
    reader = tmp_path / "my_reader.py"
    frame = "    def _frame(self, k): pass\n" if "class" in code else ""
    reader.write_text(f"from semgrid_edu.datasets.frames import FrameSequence\n{code}\n{frame}")
    with pytest.raises(DataError, match=found):
        read_with(reader, tmp_path)
