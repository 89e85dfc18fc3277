import math

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from hypothesis import given, settings
from hypothesis import strategies as st

from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import IGNORE
from semgrid_edu.training import median_frequency_weights, weighted_cross_entropy
from semgrid_edu.training.devices import open_fabric
from semgrid_edu.training.loss import class_frequencies, cross_entropy_sums, process_loss

FABRIC = open_fabric("cpu")


def test_frequencies_and_weights_by_hand():
    # Class 0: 15 of 24 cells; class 1: 3 of the 16 in whose maps it occurs; class 2: 6 of 8; class 3: none.
    maps = np.array([[[0, 0, 0, 0], [0, 0, 0, 1]], [[0, 0, 0, 0], [0, 0, 1, 1]], [[0, 0, 2, 2], [2, 2, 2, 2]]])
    f = np.array([15 / 24, 3 / 16, 6 / 8, 0])
    np.testing.assert_allclose(class_frequencies(maps, 4), f)
    np.testing.assert_allclose(median_frequency_weights(maps, 4), [1, 15 / 24 * 16 / 3, 15 / 24 * 8 / 6, 0])
    np.testing.assert_allclose(median_frequency_weights(maps, 4, limit=2)[1], 2)


def test_unlabelled_cells_count_nowhere():
    maps = [np.array([0, 1, 1, 255, 255]), np.array([255, 0])]
    np.testing.assert_allclose(class_frequencies(maps, 2), [2 / 4, 2 / 3])


@pytest.mark.parametrize("wrong", [3, 254, -1])
def test_wrong_labels_are_named(wrong):
    with pytest.raises(ArgumentError, match=r"maps: expected classes 0..2 or 255, found .* in map 1"):
        class_frequencies([np.array([0, 1]), np.array([0, wrong])], 3)


def test_no_labels_at_all_are_refused():
    with pytest.raises(ArgumentError, match="at least one labelled cell"):
        median_frequency_weights([np.full(4, 255)], 3)


# The loss


def test_the_loss_by_hand():
    """Three cells, one of them unlabelled: the classes' probabilities are powers of two, the weights 1 and 3."""
    scores = np.log([[[0.5, 0.25, 0.9], [0.5, 0.75, 0.1]]])  # one map, two classes, three cells
    loss = weighted_cross_entropy(scores + 7, [[0, 0, IGNORE]], alpha=[1, 3])
    assert loss == pytest.approx((math.log(2) + math.log(4)) / 2)
    loss = weighted_cross_entropy(scores, [[1, 0, 255]], alpha=[1, 3])
    assert loss == pytest.approx((3 * math.log(2) + math.log(4)) / 4)


@st.composite
def _maps(draw):
    """Scores, truth (some of it unlabelled) and weights (some of them zero), of images or of lists of cells."""
    n_classes, shape = draw(st.integers(1, 5)), draw(st.sampled_from([(2, 3, 4), (1, 1, 6), (3, 5)]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    scores = rng.normal(scale=draw(st.sampled_from([0.1, 3, 50])), size=(shape[0], n_classes, *shape[1:]))
    truth = rng.integers(0, n_classes, shape)
    truth[rng.random(shape) < draw(st.sampled_from([0, 0.5, 1]))] = IGNORE
    alpha = rng.uniform(0.25, 4, n_classes) * (rng.random(n_classes) < draw(st.sampled_from([0.5, 1])))
    return scores, truth, alpha


@settings(max_examples=60, deadline=None)
@given(_maps())
def test_the_fast_loss_is_the_literal_one(maps):
    scores, truth, alpha = maps
    x = torch.from_numpy(scores).requires_grad_()
    loss = process_loss(FABRIC, *cross_entropy_sums(x, torch.from_numpy(truth), torch.from_numpy(alpha)))
    assert loss.item() == pytest.approx(weighted_cross_entropy(*maps), rel=1e-12, abs=1e-15)
    in_32_bits = cross_entropy_sums(x.detach().float(), torch.from_numpy(truth), torch.from_numpy(alpha).float())
    assert process_loss(FABRIC, *in_32_bits).item() == pytest.approx(loss.item(), rel=1e-5, abs=1e-6)
    loss.backward()
    assert torch.isfinite(x.grad).all()


@settings(max_examples=60, deadline=None)
@given(_maps())
def test_the_literal_loss_is_that_of_torch(maps):
    expected = F.cross_entropy(*map(torch.from_numpy, maps[:2]), weight=torch.from_numpy(maps[2]), ignore_index=IGNORE)
    found = weighted_cross_entropy(*maps)
    if (maps[2][maps[1][maps[1] != IGNORE]] > 0).any():
        assert found == pytest.approx(expected.item(), rel=1e-12, abs=1e-15)
    else:  # PyTorch divides 0 by 0
        assert math.isnan(expected)
        assert found == 0


def test_a_loss_of_what_does_not_fit_is_refused():
    scores = np.zeros((2, 3, 4, 5))
    with pytest.raises(ArgumentError, match=r"truth: expected shape \(B, ...\).*truth of shape \(2, 4\)"):
        weighted_cross_entropy(scores, np.zeros((2, 4), int), np.ones(3))
    with pytest.raises(ArgumentError, match=r"alpha: expected shape \(3,\), one weight per class, found shape \(4,\)"):
        weighted_cross_entropy(scores, np.zeros((2, 4, 5), int), np.ones(4))
    with pytest.raises(ArgumentError, match=r"truth: expected integers, .*found float64"):
        weighted_cross_entropy(scores, np.zeros((2, 4, 5)), np.ones(3))
    for wrong in (3, -1):
        with pytest.raises(ArgumentError, match=f"truth: expected classes 0..2 or 255, found {wrong}"):
            weighted_cross_entropy(scores, np.full((2, 4, 5), wrong), np.ones(3))
