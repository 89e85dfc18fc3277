"""A training set whose truth is made from LIDAR: what changes, what stays, and when it is made anew."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tiny_drive import DATE, write_tiny_dataset

from semgrid_edu.datasets import KittiRawDrive, training_cache
from semgrid_edu.datasets.ground_truth import TruthPolicy, lidar_truth
from semgrid_edu.datasets.label_policies import LidarTruth
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.fast import TrainingSet, track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.workshop.flaws import NO_FLAWS, TruthFlaws

SMALL = (6, 20)
EXACT = LidarTruth(flaws=NO_FLAWS)


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return write_tiny_dataset(tmp_path_factory.mktemp("tiny"))


def training(root, truth=None, split="train"):
    return TrainingSet(root, split, image_size=SMALL, truth=truth)


def test_the_truth_is_made_and_the_rest_stays(root):
    true, made = training(root), training(root, EXACT)
    for name in true.arrays.keys() - {"truth"}:
        np.testing.assert_array_equal(true.arrays[name], made.arrays[name])
    np.testing.assert_array_equal(true.arrays["true"], true.arrays["truth"])
    assert (made.arrays["truth"] != made.arrays["true"]).any()
    for k, name in enumerate(("0001", "0002")):
        drive, spec = KittiRawDrive(root, DATE, name), GridSpec.compact()
        *_, belief = track_drive(drive, spec, seed=0)
        expected = lidar_truth(drive[2], belief.probability, spec)
        np.testing.assert_array_equal(made[k].truth, expected)
        assert made[k].truth.dtype == torch.uint8


def test_it_is_made_once(root, monkeypatch):
    first = training(root, EXACT).arrays["truth"]
    monkeypatch.setattr(training_cache, "in_each_drive", None)
    np.testing.assert_array_equal(training(root, EXACT).arrays["truth"], first)
    for other in (
        replace(EXACT, seed=1),
        replace(EXACT, policy=TruthPolicy(cleanup="none")),
        LidarTruth(flaws=TruthFlaws()),
    ):
        with pytest.raises(TypeError, match="NoneType"):
            training(root, other)


def test_seed_policy_and_flaws_decide_it(root):
    flawed = LidarTruth(TruthPolicy(past=2, movers="carved"), TruthFlaws(rotation=2.0))
    one, other = (training(root, made).arrays["truth"] for made in (flawed, replace(flawed, seed=1)))
    assert (one != other).any()
    for path in root.glob("cache/train-labels-*"):
        path.unlink()
    np.testing.assert_array_equal(training(root, flawed).arrays["truth"], one)


def test_a_damaged_file_is_named(root):
    training(root, EXACT, "test")
    (path,) = root.glob("cache/test-labels-*.npz")
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(DataError, match=r"labels-.*: .*delete the file to compute them again"):
        training(root, EXACT, "test")


def test_a_negative_seed_is_refused():
    with pytest.raises(ArgumentError, match="seed"):
        LidarTruth(seed=-1)
