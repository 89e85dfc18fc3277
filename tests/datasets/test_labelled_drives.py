"""Any sequence of frames with truth becomes a training set: one in a layout that the package doesn't know."""

import numpy as np
import pytest
from npz_drive import NpzDrive, write_npz_drives

from semgrid_edu.datasets import training_cache
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.fast import TrainingSet, track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, SYNTHIA_10
from semgrid_edu.networks import WEIGHTS, Architecture, build_net
from semgrid_edu.training import TrainingParams, train

SPEC, SIZE = GridSpec(0, 71, -15.5, 15.5, 1.0), (24, 80)
WALL, ROAD, UNSEEN = (KITTI_14.index(name) for name in ("building", "road", "unknown-unobserved"))


@pytest.fixture(scope="module")
def index(tmp_path_factory):
    return write_npz_drives(tmp_path_factory.mktemp("npz"))


def training(index, split="train", truth=None):
    return TrainingSet(index, split, SPEC, SIZE, truth=truth)


def test_cells_take_the_readers_truth_and_else_their_occupancy(index):
    arrays, drive = training(index).arrays, NpzDrive(index.root, "b")
    (*_, belief), truth = track_drive(drive, SPEC, seed=0), drive.truth(2, SPEC)
    np.testing.assert_array_equal(arrays["occupancy"][1], belief.probability)
    labelled = truth != IGNORE
    assert {ROAD, WALL} == set(truth[labelled])
    assert (truth[71 - 29] == WALL)[8:23].all()  # the wall of frame 2 stands 28.5 m ahead
    np.testing.assert_array_equal(arrays["truth"][1][labelled], truth[labelled])
    assert (arrays["truth"][1][~labelled] >= KITTI_14.n_semantic).all()
    assert arrays["truth"][1][0, 0] == UNSEEN


def test_a_network_learns_from_it(index, tmp_path):
    frames = training(index)
    net = build_net(Architecture(image_size=SIZE, grid=SPEC, heights=(0.0, 1.0)), frames.camera)
    train(net, frames, tmp_path / "net", TrainingParams(image_iterations=1, grid_iterations=1, batch_size=2))
    assert (tmp_path / "net" / WEIGHTS).is_file()
    assert len((tmp_path / "net" / "log.csv").read_text().splitlines()) == 3


def test_a_changed_file_or_reader_makes_the_arrays_anew(index, monkeypatch):
    training(index)
    monkeypatch.setattr(training_cache, "drive_arrays", None)
    training(index)
    (index.root / "b" / "0.npz").touch()
    with pytest.raises(TypeError, match="NoneType"):
        training(index)

    class Other(NpzDrive):
        pass

    Other.__module__ = __name__
    with pytest.raises(TypeError, match="NoneType"):
        training(type(index)(index.root, "npz", KITTI_14, index.splits, reader=Other), "test")


def test_what_does_not_fit_is_named(index):
    def but(reader=NpzDrive, **changed):
        other = type("Other", (reader,), changed)
        return type(index)(index.root, "npz", KITTI_14, index.splits, reader=other)

    with pytest.raises(DataError, match="the label set of a, SYNTHIA-10, found KITTI-14"):
        training(but(label_set=SYNTHIA_10))
    with pytest.raises(DataError, match=r"in b the frame 2 that dataset.json lists, found 2 frames"):
        training(but(__len__=lambda self: 2))
    with pytest.raises(ArgumentError, match=r"Other: expected a class in a file, .*found one of builtins"):
        training(but(__module__="builtins"))
