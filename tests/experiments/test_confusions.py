"""Confusion matrices of frames, summed by drive and by distance, and kept on disk."""

import numpy as np
import pytest

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.labels import KITTI_14
from semgrid_edu.storage.tensors import write_arrays
from semgrid_edu.workshop.scoring.confusions import (
    FrameConfusions,
    distance_band_names,
    drive_confusions,
    load_confusions,
    save_confusions,
    seed_confusions,
)

ROAD, CAR = (KITTI_14.index(name) for name in ("road", "car"))


COUNTS = np.zeros((3, 14, 14), np.int64)
COUNTS[:, ROAD, ROAD], COUNTS[:, CAR, ROAD] = (1, 0, 2), (1, 1, 0)


@pytest.fixture
def found():
    """Three frames of two drives that take turns."""
    return FrameConfusions(("b", "a", "b"), {"road": COUNTS, "twice": 2 * COUNTS})


def test_drives_come_in_the_order_of_their_first_frames(found):
    by_drive = found.by_drive("road")
    assert by_drive[:, ROAD, ROAD].tolist() == [3, 0]
    assert by_drive[:, CAR, ROAD].tolist() == [1, 1]
    np.testing.assert_array_equal(found.total("road"), by_drive.sum(axis=0))


def test_bands_of_distance_are_added_up_unless_one_is_named():
    keys = [f"network, true labels, {band}" for band in distance_band_names()]
    others = {"network, lidar labels, 0-10 m": COUNTS, "network + CRF, true labels, 0-10 m": COUNTS}
    found = FrameConfusions(("b", "a", "b"), {key: k * COUNTS for k, key in enumerate(keys)} | others)
    assert found.of("network", "true", "20-30 m").total("network").sum() == 2 * COUNTS.sum()
    assert found.of("network", "true").total("network").sum() == sum(range(7)) * COUNTS.sum()


def test_matrices_come_back_from_disk(found, tmp_path):
    for name in ("one.npz", "two.npz"):
        save_confusions(tmp_path / name, found)
    back = load_confusions(tmp_path / "one.npz")
    assert back.drives == found.drives
    assert list(back.counts) == list(found.counts)
    for method, counts in found.counts.items():
        np.testing.assert_array_equal(back.counts[method], counts)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()


def test_a_damaged_file_is_named(found, tmp_path):
    path = tmp_path / "confusions.npz"
    save_confusions(path, found)
    whole = path.read_bytes()
    for damaged in (whole[:100], whole[:-30], whole[:80] + bytes(40) + whole[120:], b"", b"something else"):
        path.write_bytes(damaged)
        with pytest.raises(DataError, match=r"confusions.npz"):
            load_confusions(path)
    for arrays in ({"road": found.counts["road"]}, {"drives": np.array(["a"]), "road": found.counts["road"]}):
        write_arrays(path, arrays)
        with pytest.raises(DataError, match=r"confusion matrices \(F, C, C\)"):
            load_confusions(path)


def test_seeds_are_stacked_only_on_the_same_frames(found):
    stacked = seed_confusions([found, found], "road")
    assert stacked.shape == (2, 2, 14, 14)
    np.testing.assert_array_equal(stacked[1], found.by_drive("road"))
    for runs in ([found, FrameConfusions(("a", "a", "b"), found.counts)], []):
        with pytest.raises(ArgumentError, match="runs"):
            seed_confusions(runs, "road")


def test_a_drive_for_each_frame(found):
    with pytest.raises(ArgumentError, match=r"drives: .*3 frames"):
        drive_confusions(found.counts["road"], ["a"])
    with pytest.raises(ArgumentError, match="drives"):
        save_confusions("never.npz", FrameConfusions(("a",), {"drives": found.counts["road"][:1]}))
