"""Confusion matrices of frames counted by hand, summed by drive, and kept on disk."""

import numpy as np
import pytest

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.labels import KITTI_14
from semgrid_edu.storage.tensors import write_arrays
from semgrid_edu.workshop.scoring.confusions import (
    FrameConfusions,
    drive_confusions,
    frame_confusions,
    load_confusions,
    save_confusions,
    seed_confusions,
)

ROAD, CAR = (KITTI_14.index(name) for name in ("road", "car"))


class ThreeFrames:
    """Three frames of 1 x 2 cells, of two drives that take turns."""

    label_set, drives = KITTI_14, ("b", "a", "b")
    arrays = {"truth": np.array([[[ROAD, CAR]], [[CAR, 255]], [[ROAD, ROAD]]], np.uint8)}  # noqa: RUF012

    def __len__(self):
        return 3


def all_road(frames, k):
    return {"road": np.full((1, 2), ROAD), "true": np.minimum(frames.arrays["truth"][k], 13)}


@pytest.fixture(scope="module")
def found():
    return frame_confusions(all_road, ThreeFrames())


def test_frames_and_drives_are_those_counted_by_hand(found):
    assert found.counts["road"].shape == (3, 14, 14)
    assert found.counts["road"][:, ROAD, ROAD].tolist() == [1, 0, 2]
    assert found.counts["road"][:, CAR, ROAD].tolist() == [1, 1, 0]
    assert found.counts["road"].sum() == 5  # the unlabelled cell counts nowhere
    by_drive = found.by_drive("road")  # b comes first, as in the frames
    assert by_drive[:, ROAD, ROAD].tolist() == [3, 0]
    assert by_drive[:, CAR, ROAD].tolist() == [1, 1]
    np.testing.assert_array_equal(found.total("road"), by_drive.sum(axis=0))
    assert np.trace(found.total("true")) == 5


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
