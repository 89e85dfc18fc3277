"""Pretraining on a real street: what the lecture shows is what was measured, and the parts of the measurement."""

import json

import numpy as np
import pytest
import torch
from worlds import lecture_07_imagenet as imagenet
from worlds import lecture_07_pretrained as pretrained
from worlds.lecture_07_imagenet import FRESH, IMAGENET, SHUFFLED, Images, Run

from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.frame import resize_image
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.storage.files import shipped_folder


@pytest.fixture(scope="module")
def measured():
    path = shipped_folder("docs") / "results" / "imagenet_worth.json"
    return json.loads(path.read_text(encoding="utf-8"))


def test_the_lectures_numbers_are_those_of_the_results(measured):
    for start, reached in zip((IMAGENET, SHUFFLED, FRESH), pretrained.REACHED.values(), strict=True):
        name = Run(start, 24, 100, True).name
        others = measured["scores"][name]["pixel accuracy"]
        assert [round(100 * others[key]) for key in ("mean", "low", "high")] == [*reached[:3]]
        assert round(100 * measured[imagenet.OWN][name]) == reached.own
    longer = [measured["scores"][Run(FRESH, 24, steps, False).name]["pixel accuracy"]["mean"] for steps in (100, 300)]
    assert tuple(round(100 * mean) for mean in longer) == pretrained.LONGER
    rows = measured["scores"]["the most frequent class of each row"]["pixel accuracy"]["mean"]
    assert round(100 * rows) == pretrained.ROWS
    added = measured["scores"][Run(IMAGENET, 24, 100, True).name]["above fresh weights"]["pixel accuracy"]
    assert [round(100 * added[key]) for key in ("mean", "low", "high")] == list(pretrained.ADDED)


def _images(n, seed, label=0):
    drawn = torch.from_numpy(np.random.default_rng(seed).integers(0, 256, (n, 3, *imagenet.SIZE), np.uint8))
    labels = torch.full((n, *imagenet.SIZE), IGNORE)
    labels[:, 50:] = label
    return Images(drawn, labels)


def test_frames_come_from_all_cameras_alike_and_fewer_are_among_more():
    cameras = [_images(6, seed) for seed in range(4)]
    few, many = (imagenet.draw_frames(cameras, n, seed=1) for n in (8, 24))
    assert all(torch.equal(a.image, b.image) for a, b in zip(few, many, strict=False))
    found = [
        [k for k, camera in enumerate(cameras) if (camera.image == frame.image).flatten(1).all(1).any()]
        for frame in few
    ]
    assert sorted(found) == 2 * [[0]] + 2 * [[1]] + 2 * [[2]] + 2 * [[3]]


def test_shuffled_weights_have_the_same_values_in_another_order():
    taught, shuffled = (imagenet.start_from(start, 0).imagenet_tensors() for start in (IMAGENET, SHUFFLED))
    for name, tensor in taught.items():
        assert torch.equal(tensor.flatten().sort().values, shuffled[name].flatten().sort().values)
    assert not torch.equal(taught["_conv_stem.weight"], shuffled["_conv_stem.weight"])


def test_the_control_leaves_the_normalisation_out_and_changes_nothing_else():
    with_norm, without = (imagenet.start_from(FRESH, 3, normalised) for normalised in (True, False))
    assert not any(isinstance(layer, torch.nn.BatchNorm2d) for layer in without.lateral.modules())
    for (convolution, _), alone in zip(with_norm.lateral, without.lateral, strict=True):
        assert torch.equal(convolution.weight, alone.weight)


def test_maps_of_pretrained_weights_are_three_to_seven_times_as_large():
    frame = sample_drive()[0]
    image = torch.tensor(resize_image(frame.image, imagenet.SIZE)).permute(2, 0, 1)[None] / 255
    sizes = []
    for start in (IMAGENET, FRESH):
        net = imagenet.start_from(start, 0).train()
        with torch.no_grad():
            sizes.append([one.std().item() for one in net.backbone((image - net.mean) / net.std)])
    ratios = np.divide(*sizes)
    assert 2.5 < ratios.min() < ratios.max() < 7.5


def test_rules_without_an_image_know_rows():
    learned, tested = _images(2, 0, label=1), _images(1, 1, label=1)
    learned.labels[:, 80:] = 3
    tested.labels[:, 80:] = 3
    always, by_row = imagenet.baselines([learned], tested).values()
    assert (always.trace() / always.sum(), by_row.trace() / by_row.sum()) == (30 / 46, 1)
    assert always.shape == (len(KITTI_14),) * 2


def test_an_ended_run_is_read_from_its_file(tmp_path):
    counts = {"camera": np.eye(2, dtype=int)}
    first, seconds = imagenet._once(tmp_path / "run.npz", lambda: counts)
    again, same = imagenet._once(tmp_path / "run.npz", lambda: 1 / 0)
    assert again["camera"].tolist() == first["camera"].tolist() == [[1, 0], [0, 1]]
    assert seconds == same
