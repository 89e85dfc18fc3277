"""Training a network that sees the heights of returns."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tiny_streets import CAMERA, SMALL, tiny_streets

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import WEIGHTS, build_net, load_net
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.training.batches import draw_batch, grid_logits, share_of_batch
from semgrid_edu.training.log import read_log
from semgrid_edu.workshop.scoring.grids import learned_log_g

TALL = replace(SMALL, uses_return_heights=True)


@pytest.fixture(scope="module")
def streets():
    """Flat streets on which every cell of class 1 stands 1 m high."""
    flat = [torch.where(sample.truth == 1, 1.0, 0.0) for sample in tiny_streets()]
    return [
        sample._replace(return_heights=torch.stack([0 * high, high]))
        for sample, high in zip(tiny_streets(), flat, strict=True)
    ]


def test_it_learns_and_its_file_gives_what_it_gave(streets, tmp_path):
    net = build_net(TALL, CAMERA)
    train(net, streets, tmp_path, TrainingParams(2, 25, batch_size=2, mirror=True))
    log = read_log(tmp_path / "log.csv")
    losses = log.loss[log.stage == "grid"]
    assert np.mean(losses[-3:]) < 0.7 * np.mean(losses[:3])
    loaded = load_net(tmp_path / WEIGHTS, CAMERA)
    np.testing.assert_array_equal(learned_log_g(loaded, streets[0]), learned_log_g(net, streets[0]))


def test_a_batch_has_the_heights_of_its_frames_and_shares_them(streets):
    batch = draw_batch(streets, 4, 0.2, iteration=0, seed=0)
    for truth, heights in zip(batch.frames.truth, batch.frames.return_heights, strict=True):
        assert torch.equal(heights[1] == 1, truth == 1)
    halves = [share_of_batch(batch, k, 2, "cpu").frames.return_heights for k in range(2)]
    assert torch.equal(torch.cat(halves), batch.frames.return_heights)
    net = build_net(TALL, CAMERA).eval()
    batch = batch._replace(mirrored=False)
    frames = batch.frames
    assert torch.equal(grid_logits(net, batch), net(frames.image, frames.occupancy, frames.return_heights))


def test_frames_without_heights_are_refused_before_the_first_step(streets, tmp_path):
    with pytest.raises(ArgumentError, match=r"dataset: expected return_heights, .* found none in frame 0"):
        train(build_net(TALL, CAMERA), tiny_streets(), tmp_path / "run", TrainingParams(1, 1, batch_size=2))
    wrong = [sample._replace(return_heights=sample.return_heights[:1]) for sample in streets]
    with pytest.raises(ArgumentError, match=r"dataset: expected return_heights of shape \(2, 24, 12\)"):
        train(build_net(TALL, CAMERA), wrong, tmp_path / "run", TrainingParams(1, 1, batch_size=2))
    assert not (tmp_path / "run").exists()


def test_other_networks_learn_the_same_with_and_without_heights(streets, tmp_path):
    usual = tiny_streets()
    for name, frames in {"with": streets, "without": usual, "some": [usual[0], *streets[1:-1], usual[-1]]}.items():
        train(build_net(SMALL, CAMERA), frames, tmp_path / name, TrainingParams(1, 2, batch_size=2))
    learned = {(tmp_path / name / WEIGHTS).read_bytes() for name in ("with", "without", "some")}
    assert len(learned) == 1
