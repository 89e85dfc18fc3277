"""Mean field by filters against the written-out one, and what must hold for every way to run it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from scipy.special import log_softmax, softmax

from semgrid_edu import crf, fast
from semgrid_edu.crf import CrfParams, mean_field, mean_field_naive, unary_from_probability
from semgrid_edu.errors import ArgumentError

EVERY = {
    "naive": mean_field_naive,
    "filters": mean_field,
    "fast": fast.mean_field,
}
WAYS = pytest.mark.parametrize("infer", EVERY.values(), ids=EVERY)
FILTERS = pytest.mark.parametrize("infer", [mean_field, fast.mean_field], ids=["book", "fast"])


def patches(shape, count, rng):
    return np.argmax([gaussian_filter(rng.normal(size=shape), 4) for _ in range(count)], axis=0)


def noisy_street(seed, shape=(40, 30), n_classes=14, structured=True):
    """Classes in patches under noisy scores; states in patches, or without any structure."""
    rng = np.random.default_rng(seed)
    truth = patches(shape, n_classes, rng)
    scores = 2 * np.eye(n_classes)[truth] + 1.5 * rng.normal(size=(*shape, n_classes))
    values = softmax(5 * np.eye(4)[patches(shape, 4, rng)] + 0.5 * rng.normal(size=(*shape, 4)), axis=-1)
    if not structured:
        values = rng.dirichlet(np.full(4, 0.5), shape)
    unary = unary_from_probability(softmax(scores, axis=-1).transpose(2, 0, 1))
    return unary, values.transpose(2, 0, 1), truth


@FILTERS
@pytest.mark.parametrize("structured", [True, False])
def test_filters_give_the_naive_result_up_to_the_lattice(infer, structured):
    # Over such values the lattice's normalised kernel differs from the Gaussian by 10 to 20 % (Frobenius), so a message
    # of at most w1 = 4 by up to 0.8, and a probability by up to a quarter of that. Few cells come near it: summed over
    # many neighbours the error is some 3 %. A cell at a tie can move more, since its neighbours move with it.
    for seed in range(3):
        unary, values, _ = noisy_street(seed, structured=structured)
        exact, found = (run(unary, values, CrfParams()) for run in (mean_field_naive, infer))
        error = np.abs(found - exact)
        assert error.mean() < 0.005, seed
        assert np.quantile(error.max(axis=0), 0.99) < 0.2, seed
        assert (found.argmax(axis=0) == exact.argmax(axis=0)).mean() > 0.97, seed
        assert found.dtype == np.float32
        assert exact.dtype == np.float64


@pytest.mark.parametrize("twin", [crf, fast])
@pytest.mark.parametrize("normalization", ["symmetric", "none"])
def test_updates_by_filters_are_those_over_the_matrices_of_the_filters(twin, normalization):
    """The filters as matrices: what they return for each column of the identity."""
    unary, values, _ = noisy_street(1, (14, 11), 16)
    params = CrfParams(w_bilateral=1, w_spatial=1, normalization=normalization)
    spatial = twin.SeparableGaussian.build((14, 11), params.sigma_gamma, params.w_spatial, normalization)
    identity = np.eye(14 * 11, dtype=np.float32)
    gram = (twin.bilateral_kernel(values, params)(identity) + spatial(identity)).astype(np.float64)
    own, phi = np.diag(gram), unary.reshape(16, -1)
    log_Q = log_softmax(-phi, axis=0)
    for _ in range(10):
        target = -phi + np.exp(log_Q) @ (gram - np.diag(own)).T
        log_Q = log_softmax(log_Q + (target - log_Q) / (1 + own / 2), axis=0)
    np.testing.assert_allclose(twin.mean_field(unary, values, params).reshape(16, -1), np.exp(log_Q), atol=2e-5)


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_the_book_and_fast_agree(data):
    """On any grid with any parameters, to 1e-4: without oscillation, rounding to float32 stays small."""
    classes, height, width = (data.draw(st.integers(1, high)) for high in (17, 12, 12))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    unary = rng.normal(0, 2, (classes, height, width))
    values = rng.dirichlet(np.full(4, data.draw(st.sampled_from([0.05, 0.5, 5]))), (height, width)).transpose(2, 0, 1)
    normalization = data.draw(st.sampled_from(["symmetric", "none"]))
    weights = (data.draw(st.floats(0, 5)) / (1 if normalization == "symmetric" else 20) for _ in range(2))
    widths = (data.draw(st.floats(low, 20)) for low in (0.1, 0.02, 0.1))
    case = unary, values, CrfParams(*weights, *widths, normalization), data.draw(st.integers(0, 10))
    pad = data.draw(st.integers(0, 3))
    np.testing.assert_allclose(fast.mean_field(*case, pad=pad), mean_field(*case, pad=pad), atol=1e-4)


@FILTERS
def test_a_pad_repeats_the_border_and_is_cut_off_again(infer):
    unary, values, _ = noisy_street(0, (12, 9))
    around = [np.pad(maps, ((0, 0), (4, 4), (4, 4)), mode="edge") for maps in (unary, values)]
    by_hand = infer(*around, CrfParams())[:, 4:-4, 4:-4]
    np.testing.assert_array_equal(infer(unary, values, CrfParams(), pad=4), by_hand)
    assert np.abs(by_hand - infer(unary, values, CrfParams())).max() > 0.01
    with pytest.raises(ArgumentError, match="pad"):
        infer(unary, values, CrfParams(), pad=-1)


@WAYS
@pytest.mark.parametrize(("params", "iterations"), [(CrfParams(w_bilateral=0, w_spatial=0), 10), (CrfParams(), 0)])
def test_without_pairs_or_updates_it_is_a_softmax(infer, params, iterations):
    unary, values, _ = noisy_street(0, (6, 5))
    np.testing.assert_allclose(infer(unary, values, params, iterations), softmax(-unary, axis=0), atol=1e-6)


@WAYS
def test_renamed_classes_give_renamed_results(infer):
    unary, values, _ = noisy_street(0, (12, 10))
    order = np.random.default_rng(0).permutation(len(unary))
    np.testing.assert_allclose(
        infer(unary[order], values, CrfParams()), infer(unary, values, CrfParams())[order], atol=1e-4
    )


@WAYS
def test_a_speck_is_smoothed_away_and_an_edge_of_occupancy_stays(infer):
    values = np.zeros((4, 12, 12))
    values[0, :, :6] = values[1, :, 6:] = 1
    probability = np.full((2, 12, 12), 0.3)
    probability[0, :, :6] = probability[1, :, 6:] = 0.7
    probability[:, 5, 2] = 0.3, 0.7  # a free cell that the network gives to the class of the static ones
    labels = infer(unary_from_probability(probability), values, CrfParams()).argmax(axis=0)
    np.testing.assert_array_equal(labels, np.broadcast_to(np.arange(12) >= 6, (12, 12)))


@WAYS
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_every_cell_holds_a_distribution(infer, data):
    height, width, n_classes = (data.draw(st.integers(1, high)) for high in (5, 6, 20))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    unary = rng.choice([0.0, 1.0, -3.0, 50.0, 1e5, -1e5, 1e38, np.inf], size=(n_classes, height, width))
    unary[0] = np.where(np.isinf(unary).all(axis=0), 0, unary[0])
    values = rng.dirichlet(np.full(4, 0.2), (height, width)).transpose(2, 0, 1)
    params = CrfParams(
        w_bilateral=data.draw(st.floats(0, 1e3)),
        sigma_alpha=data.draw(st.floats(0.1, 50)),
        sigma_beta=data.draw(st.floats(0.01, 5)),
        normalization=data.draw(st.sampled_from(["symmetric", "none"])),
    )
    Q = infer(unary, values, params, data.draw(st.integers(0, 4)))
    assert Q.shape == unary.shape
    assert (Q >= 0).all()
    np.testing.assert_allclose(Q.sum(axis=0), 1, atol=1e-5)


@FILTERS
def test_the_same_input_gives_the_same_bits_and_is_left_alone(infer):
    unary, values, _ = noisy_street(0, (12, 10))
    unary, values = unary.astype(np.float32), values.astype(np.float32)
    before = unary.copy(), values.copy()
    np.testing.assert_array_equal(infer(unary, values, CrfParams()), infer(*before, CrfParams()))
    np.testing.assert_array_equal(unary, before[0])
    np.testing.assert_array_equal(values, before[1])


@WAYS
@pytest.mark.parametrize("iterations", [-1, 2.5])
def test_iterations_are_counted(infer, iterations):
    with pytest.raises(ArgumentError, match="iterations"):
        infer(np.zeros((2, 3, 3)), np.full((4, 3, 3), 0.25), CrfParams(), iterations)
