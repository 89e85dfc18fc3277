"""Training of the CRF layer: what it learns, how it resumes, and its file."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.special import log_softmax

from semgrid_edu.crf import CrfParams
from semgrid_edu.crf.layer import CrfLayer, load_crf, save_crf
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import sole_writer
from semgrid_edu.storage.tensors import write_tensors
from semgrid_edu.training import CHECKPOINT, loop, weighted_cross_entropy
from semgrid_edu.training.crf import CRF_TRAINING, CrfObjective, GridBatch, train_crf
from semgrid_edu.training.log import LOG, read_log

QUICK = replace(CRF_TRAINING, grid_iterations=6)
CLASSES, SHAPE, FRAMES = 3, (6, 5), 5


def new_layer():
    return CrfLayer(CrfParams(sigma_alpha=2, sigma_gamma=1), CLASSES, iterations=2, learn_compatibility=True)


@pytest.fixture
def grids():
    """Noise, of which the network is sure and right: log g, occupancy and truth."""
    rng = np.random.default_rng(0)
    truth = rng.integers(CLASSES, size=(FRAMES, *SHAPE)).astype(np.uint8)
    log_g = log_softmax(3.0 * np.moveaxis(np.eye(CLASSES)[truth], -1, 1), axis=1).astype(np.float32)
    occupancy = np.moveaxis(rng.dirichlet(np.ones(4), (FRAMES, *SHAPE)), -1, 1).astype(np.float32)
    return log_g, occupancy, truth


def test_two_training_runs_never_share_a_folder(grids, tmp_path):
    with sole_writer(tmp_path), pytest.raises(DataError, match="a folder that no other process writes to"):
        train_crf(new_layer(), *grids, tmp_path, QUICK)
    assert not list(tmp_path.iterdir())


def values(layer):
    return torch.cat([tensor.detach().ravel() for tensor in layer.state_dict().values()])


def test_where_neighbours_say_nothing_the_weights_fall(grids, tmp_path):
    layer = CrfLayer(CrfParams(sigma_alpha=2, sigma_gamma=1), CLASSES, iterations=2)
    train_crf(layer, *grids, tmp_path, replace(QUICK, grid_iterations=20))
    learnt, loss = layer.params(), read_log(tmp_path / LOG).loss
    assert learnt.w_bilateral < 4
    assert learnt.w_spatial < 3
    unrefined = weighted_cross_entropy(grids[0], grids[2], np.ones(CLASSES))
    assert loss[-4:].mean() - unrefined < (loss[:4].mean() - unrefined) / 2
    assert layer.label_costs.equal(1 - torch.eye(CLASSES))


def test_the_objective_is_the_loss_written_out(grids):
    layer, alpha = new_layer(), torch.tensor([1.0, 2.0, 0.5])
    batch = GridBatch(*map(torch.from_numpy, grids))
    losses, weights = CrfObjective(layer, alpha)(batch)
    log_Q = layer(batch.log_g, batch.occupancy).detach().numpy()
    assert (losses / weights).item() == pytest.approx(weighted_cross_entropy(log_Q, grids[2], alpha), rel=1e-5)


def killed(grids, folder, monkeypatch):
    """A run that was killed in its fifth step and has kept a checkpoint after four."""
    monkeypatch.setattr(loop, "CHECKPOINT_EVERY", 2)
    steps = iter(range(4))

    def learn(*args, do=loop.learn):
        if next(steps, None) is None:
            raise KeyboardInterrupt
        return do(*args)

    with monkeypatch.context() as patch:
        patch.setattr(loop, "learn", learn)
        with pytest.raises(KeyboardInterrupt):
            train_crf(new_layer(), *grids, folder, QUICK)


def test_a_resumed_run_ends_like_one_without_a_break(grids, tmp_path, monkeypatch):
    whole, resumed = new_layer(), new_layer()
    train_crf(whole, *grids, tmp_path / "whole", QUICK)
    killed(grids, tmp_path / "killed", monkeypatch)
    train_crf(resumed, *grids, tmp_path / "killed", QUICK, resume=True)
    assert values(whole).equal(values(resumed))
    assert not values(whole).equal(values(new_layer()))
    assert (tmp_path / "whole" / LOG).read_text() == (tmp_path / "killed" / LOG).read_text()
    assert not (tmp_path / "killed" / CHECKPOINT).exists()


def test_only_its_own_run_is_resumed_and_none_is_overwritten(grids, tmp_path, monkeypatch):
    killed(grids, tmp_path, monkeypatch)
    with pytest.raises(DataError, match="resume continues it"):
        train_crf(new_layer(), *grids, tmp_path, QUICK)
    with pytest.raises(ArgumentError, match=r"'weight_limit': 4.0.*'weight_limit': 1"):
        train_crf(new_layer(), *grids, tmp_path, replace(QUICK, weight_limit=1), resume=True)
    train_crf(new_layer(), *grids, tmp_path, QUICK, resume=True)
    with pytest.raises(DataError, match="would be lost"):
        train_crf(new_layer(), *grids, tmp_path, QUICK)


def test_too_few_frames_are_refused(grids, tmp_path):
    with pytest.raises(ArgumentError, match="at least one batch of 2 frames, found 1"):
        train_crf(new_layer(), *(part[:1] for part in grids), tmp_path, QUICK)


def test_a_crf_comes_back_from_its_file(grids, tmp_path):
    layer = new_layer()
    layer.label_costs.data[0, 1] = 0.3
    save_crf(layer, tmp_path / "crf.safetensors")
    back = load_crf(tmp_path / "crf.safetensors")
    assert values(back).equal(values(layer))
    assert back.description() == layer.description()
    log_g, occupancy, _ = map(torch.from_numpy, grids)
    assert back(log_g, occupancy).equal(layer(log_g, occupancy))


def test_a_file_of_something_else_is_refused(tmp_path):
    write_tensors(tmp_path / "net.safetensors", {"weight": torch.zeros(3)}, {"architecture": "{}"})
    with pytest.raises(DataError, match="the description of a CRF"):
        load_crf(tmp_path / "net.safetensors")
