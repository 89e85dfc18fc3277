"""Temperature and calibration against torch, torchmetrics, and answers that are known."""

import numpy as np
import pytest
import torch
from scipy.special import log_softmax
from torchmetrics.functional.classification import multiclass_calibration_error

from semgrid_edu.crf import (
    at_temperature,
    expected_calibration_error,
    fit_temperature,
    reliability,
)
from semgrid_edu.errors import ArgumentError


@pytest.fixture
def drawn():
    """Distributions over 5 classes of 40 x 50 cells, with labels that are drawn from them, one in ten unlabelled."""
    rng = np.random.default_rng(0)
    log_p = log_softmax(rng.normal(0, 2, (5, 40, 50)), axis=0)
    truth = (rng.random((40, 50)) < np.exp(log_p).cumsum(axis=0)).argmax(axis=0)
    return log_p, np.where(rng.random((40, 50)) < 0.1, 255, truth)


def cross_entropy(scores, truth):
    return torch.nn.functional.cross_entropy(
        torch.from_numpy(scores)[None], torch.from_numpy(truth)[None], ignore_index=255
    ).item()


def test_two_temperatures_in_turn_are_their_product(drawn):
    log_p, _ = drawn
    np.testing.assert_allclose(at_temperature(at_temperature(log_p, 3.0), 0.5), at_temperature(log_p, 1.5), atol=1e-12)
    np.testing.assert_allclose(at_temperature(log_p, 1.0), log_p, atol=1e-12)


def test_limits_are_the_uniform_distribution_and_the_arg_max(drawn):
    log_p, _ = drawn
    np.testing.assert_allclose(np.exp(at_temperature(log_p, 1e6)), 0.2, atol=1e-4)
    np.testing.assert_array_equal(np.exp(at_temperature(log_p, 1e-6)).argmax(axis=0), log_p.argmax(axis=0))


def test_float32_stays_float32(drawn):
    assert at_temperature(drawn[0].astype(np.float32), 2.0).dtype == np.float32


@pytest.mark.parametrize("temperature", [0.3, 1.0, 4.0])
def test_labels_drawn_from_the_distribution_give_back_the_temperature_by_which_it_was_spoilt(drawn, temperature):
    log_p, truth = drawn
    spoilt = at_temperature(log_p, temperature)
    assert fit_temperature(spoilt, truth) == pytest.approx(1 / temperature, rel=0.05)


def test_no_other_temperature_is_more_likely_by_torchs_loss(drawn):
    log_p, truth = drawn
    truth[:20] = 0
    best = fit_temperature(log_p, truth)
    losses = [cross_entropy(log_p / (best * factor), truth) for factor in (0.98, 1.0, 1.02)]
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
    probability = np.exp(at_temperature(log_p, temperature))
    found = expected_calibration_error(reliability(probability, truth))
    flat = torch.from_numpy(probability.reshape(5, -1).T.copy()), torch.from_numpy(truth.ravel())
    expected = multiclass_calibration_error(*flat, num_classes=5, n_bins=15, norm="l1", ignore_index=255)
    assert found == pytest.approx(expected.item(), abs=1e-6)


@pytest.mark.parametrize(
    ("log_p", "truth", "message"),
    [
        (np.log([[0.9, 0.2], [0.1, 0.8]]), [0, 1], "every cell right"),
        (np.log([[0.9, 0.8], [0.1, 0.2]]), [1, 1], "tells nothing about the truth"),
        (np.array([[0.0, -1.0], [-np.inf, -0.5]]), [0, 1], "finite logarithms"),
        (np.log([[0.9, 0.2], [0.1, 0.8]]), [0, 2], "classes 0..1"),
        (np.log([[0.9, 0.2], [0.1, 0.8]]), [255, 255], "labelled cell"),
        (np.log([[0.9, 0.2], [0.1, 0.8]]), [0, 0.5], "truth: expected whole numbers"),
        (np.log([[0.9, 0.2], [0.1, 0.8]]), [0, np.nan], "truth: expected whole numbers"),
        (np.array([[0.9, 0.2], [0.1, 0.8]]), [0, 0], "expected logarithms of probabilities that sum to 1"),
        (np.log([[0.9, 0.2], [0.1, 0.8]]), [0, 1, 1], r"shape \(C, 3\)"),
    ],
)
def test_what_has_no_temperature_is_refused(log_p, truth, message):
    with pytest.raises(ArgumentError, match=message):
        fit_temperature(log_p, truth)


@pytest.mark.parametrize("probability", [[0.9, 0.2], [1.5, -0.5], [np.nan, 1.0], np.log([0.9, 0.1])])
def test_a_reliability_of_what_is_no_distribution_is_refused(probability):
    with pytest.raises(ArgumentError, match="probability: expected probabilities that sum to 1"):
        reliability(np.transpose([probability, [0.9, 0.1]]), [0, 1])


def test_a_class_without_probability_stays_without_and_scores_are_refused():
    assert at_temperature(np.array([0.0, -np.inf]), 2).tolist() == [0, -np.inf]
    with pytest.raises(ArgumentError, match="log_probability: expected logarithms of probabilities that sum to 1"):
        at_temperature(np.array([2.0, 1.0]), 2)


@pytest.mark.parametrize("temperature", [0.0, -1.0, np.nan, np.inf])
def test_an_impossible_temperature_is_refused(temperature):
    with pytest.raises(ArgumentError, match="temperature: expected a positive number"):
        at_temperature(np.log([0.5, 0.5]), temperature)
