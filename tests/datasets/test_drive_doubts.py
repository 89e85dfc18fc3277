"""What is doubtful about a drive is said, and a sound drive is believed."""

from pathlib import Path

import numpy as np
import pytest
from tiny_drive import DATE, write_packet, write_tiny_dataset, write_tiny_drive

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.index import dataset_doubts
from semgrid_edu.datasets.readers.drive_doubts import FASTEST, jumps
from semgrid_edu.datasets.readers.oxts import read_packet
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.errors import ArgumentError, DataError


def test_sound_drives_are_believed(tmp_path):
    assert sample_drive().doubts() == []
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
    (doubt,) = jumps(packets, np.arange(4) / 10)
    assert doubt.startswith(f"{tmp_path / '2.txt'}: expected a place within 10 m of the packet before, found 10 m")


def test_a_gap_in_time_allows_a_longer_way(tmp_path):
    packets = places(tmp_path, [0.0, 60.0])
    assert len(jumps(packets, np.array([0.0, 0.1]))) == 1
    assert jumps(packets, np.array([0.0, 1.0])) == []
    assert jumps(packets, np.array([0.0, np.nan])) == []
    assert jumps({}, np.empty(0)) == []


def test_doubts_do_not_stop_at_a_damaged_packet_or_missing_times(tmp_path):
    folder = write_tiny_drive(tmp_path, n_frames=5)
    (folder / "oxts" / "data" / "0000000001.txt").write_text("?")
    write_packet(folder / "oxts" / "data" / "0000000003.txt", np.array([4e6, 0, 0]), (0.0, 0.0, 0.0))
    doubts = KittiRawDrive(tmp_path, DATE, "0001").doubts()
    assert [doubt.partition(":")[0][-14:] for doubt in doubts] == ["0000000003.txt", "0000000004.txt"]
    (folder / "oxts" / "timestamps.txt").unlink()
    assert KittiRawDrive(tmp_path, DATE, "0001").doubts() == []


@pytest.mark.parametrize(("date", "drive"), [("", "0001"), (DATE, "")])
def test_an_empty_name_is_refused(tmp_path, date, drive):
    write_tiny_drive(tmp_path)
    with pytest.raises(ArgumentError, match=r"(date|drive): expected"):
        KittiRawDrive(tmp_path, date, drive)


def test_labels_of_another_set_are_refused(tmp_path):
    root = write_tiny_dataset(tmp_path)
    path = root / DATE / f"{DATE}_drive_0002_sync" / "labels" / "label_set.txt"
    path.write_text("SYNTHIA-10\n")
    with pytest.raises(DataError, match=r"expected the label set of 2026_01_01 0002, SYNTHIA-10, found KITTI-14"):
        dataset_doubts(root, "train")
    assert dataset_doubts(root, "test") == []
