"""Reliability diagrams against torchmetrics and a case by hand, and the temperature that mends them."""

import numpy as np
import pytest
import torch
from scipy.special import log_softmax
from torchmetrics.functional.classification import multiclass_calibration_error
from worlds.lecture_11_search import fit_temperature

from semgrid_edu.errors import ArgumentError
from semgrid_edu.workshop.scoring.calibration import expected_calibration_error, reliability


@pytest.fixture
def drawn():
    """Distributions over 5 classes of 40 x 50 cells, with labels that are drawn from them, one in ten unlabelled."""
    rng = np.random.default_rng(0)
    log_p = log_softmax(rng.normal(0, 2, (5, 40, 50)), axis=0)
    truth = (rng.random((40, 50)) < np.exp(log_p).cumsum(axis=0)).argmax(axis=0)
    return log_p, np.where(rng.random((40, 50)) < 0.1, 255, truth)


@pytest.mark.parametrize("temperature", [0.3, 1.0, 4.0])
def test_labels_drawn_from_the_distribution_give_back_the_temperature_by_which_it_was_spoilt(drawn, temperature):
    log_p, truth = drawn
    spoilt = log_softmax(log_p / temperature, axis=0)
    assert fit_temperature(spoilt, truth) == pytest.approx(1 / temperature, rel=0.05)


def test_no_other_temperature_is_more_likely_by_torchs_loss(drawn):
    log_p, truth = drawn
    truth[:20] = 0
    best = fit_temperature(log_p, truth)
    target = torch.from_numpy(truth)[None]
    scaled = [torch.from_numpy(log_p / (best * factor))[None] for factor in (0.98, 1.0, 1.02)]
    losses = [torch.nn.functional.cross_entropy(scores, target, ignore_index=255).item() for scores in scaled]
    assert np.argmin(losses) == 1


def test_a_hand_made_calibration_error():
    """Two cells at 90 % of which one is right, one at 60 % and right: 2/3 of 0.4 and 1/3 of 0.4."""
    probability = np.array([[0.9, 0.9, 0.6], [0.1, 0.1, 0.4]])
    diagram = reliability(probability, [0, 1, 0], n_bins=10)
    assert diagram.cells.tolist() == [0, 0, 0, 0, 0, 1, 0, 0, 2, 0]
    np.testing.assert_allclose([diagram.confidence[8], diagram.accuracy[8]], [0.9, 0.5])
    assert expected_calibration_error(diagram) == pytest.approx(0.4)


@pytest.mark.parametrize("temperature", [0.4, 1.0, 2.5])
def test_the_calibration_error_is_that_of_torchmetrics(drawn, temperature):
    log_p, truth = drawn
    probability = np.exp(log_softmax(log_p / temperature, axis=0))
    found = expected_calibration_error(reliability(probability, truth))
    flat = torch.from_numpy(probability.reshape(5, -1).T.copy()), torch.from_numpy(truth.ravel())
    expected = multiclass_calibration_error(*flat, num_classes=5, n_bins=15, norm="l1", ignore_index=255)
    assert found == pytest.approx(expected.item(), abs=1e-6)


@pytest.mark.parametrize(
    ("probability", "truth", "message"),
    [
        ([[0.9, 0.9], [0.2, 0.1]], [0, 1], "probability: expected probabilities that sum to 1"),
        ([[1.5, 0.9], [-0.5, 0.1]], [0, 1], "probability: expected probabilities that sum to 1"),
        ([[np.nan, 0.9], [1.0, 0.1]], [0, 1], "probability: expected probabilities that sum to 1"),
        ([[0.9, 0.9], [0.1, 0.1]], [255, 255], "truth: expected at least one labelled cell"),
        ([[0.9, 0.9], [0.1, 0.1]], [0, 1, 1], r"probability: expected shape \(C, 3\)"),
    ],
)
def test_what_has_no_reliability_is_refused(probability, truth, message):
    with pytest.raises(ArgumentError, match=message):
        reliability(probability, truth)
