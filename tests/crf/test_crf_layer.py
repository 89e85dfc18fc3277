"""The trainable CRF equals mean field written out, and its gradients equal differences (eq. (3), (4))."""

import subprocess
import sys

import numpy as np
import pytest
import torch
from scipy.special import xlogy

from semgrid_edu.crf import (
    CrfParams,
    damping,
    gram_matrix,
    mean_field,
    mean_field_naive,
    pair_weights,
    unary_from_log_probability,
)
from semgrid_edu.crf import layer as layer_module
from semgrid_edu.crf.layer import CrfLayer, step_size
from semgrid_edu.crf.naive import mean_field_update
from semgrid_edu.crf.pair_window import PairSum, PairWindow
from semgrid_edu.errors import ArgumentError

COVERING = 9
"""A window that covers every grid of `random_grids`."""


@pytest.fixture(autouse=True)
def _in_double_precision():
    torch.set_default_dtype(torch.float64)
    yield
    torch.set_default_dtype(torch.float32)


def random_grids(seed, batch=2, classes=None, shape=None):
    """Scores and states of any small grids."""
    rng = np.random.default_rng(seed)
    classes, shape = classes or rng.integers(1, 6), shape or tuple(rng.integers(1, 8, 2))
    log_g = rng.normal(0, rng.choice([0.1, 1, 5]), (batch, classes, *shape))
    occupancy = np.moveaxis(rng.dirichlet(np.full(4, rng.choice([0.05, 0.3, 3])), (batch, *shape)), -1, 1)
    return torch.from_numpy(log_g), torch.from_numpy(occupancy)


def random_params(seed):
    rng = np.random.default_rng(seed)
    return CrfParams(
        *rng.choice([0.0, 0.5, 4, 40], 2), *rng.choice([0.1, 1, 8, 50], 3), rng.choice(["symmetric", "none"])
    )


def random_costs(seed, classes):
    """Any symmetric costs of two labels."""
    rng = np.random.default_rng(seed)
    costs = rng.normal(0, rng.choice([0.1, 1, 3]), (classes, classes)) + rng.choice([0, 1]) * (1 - np.eye(classes))
    return torch.from_numpy(costs + costs.T) / 2


@torch.no_grad()
def refined(layer, log_g, occupancy):
    return layer(log_g, occupancy).exp().numpy()


def test_it_is_mean_field_written_out():
    for seed in range(100):
        (log_g, occupancy), params = random_grids(seed), random_params(seed)
        found = refined(CrfLayer(params, log_g.shape[1], COVERING), log_g, occupancy)
        for Q, scores, values in zip(found, log_g.numpy(), occupancy.numpy(), strict=True):
            expected = mean_field_naive(-scores, values, params)
            np.testing.assert_allclose(Q, expected, atol=1e-12, err_msg=f"seed {seed}")


def test_in_single_precision_too():
    log_g, occupancy = random_grids(0, batch=1, classes=5, shape=(12, 9))
    expected = mean_field_naive(-log_g[0].numpy(), occupancy[0].numpy(), CrfParams())
    found = refined(CrfLayer(CrfParams(), 5, radius=12).float(), log_g.float(), occupancy.float())
    np.testing.assert_allclose(found[0], expected, atol=1e-5)


def test_an_impossible_class_stays_impossible():
    log_g, occupancy = random_grids(1, batch=1, classes=3, shape=(4, 5))
    log_g[0, 1, 2] = -np.inf
    found = refined(CrfLayer(CrfParams(), 3, COVERING), log_g, occupancy)
    np.testing.assert_allclose(
        found[0], mean_field_naive(-log_g[0].numpy(), occupancy[0].numpy(), CrfParams()), atol=1e-12
    )
    assert (found[0, 1, 2] == 0).all()


@pytest.mark.parametrize(("height", "width", "radius"), [(1, 1, 1), (1, 6, 2), (5, 1, 9), (4, 7, 3), (6, 5, 1)])
def test_a_window_holds_each_near_pair_once(height, width, radius):
    """Against a matrix of all pairs: the sums, and the squared distances that make the weights."""
    rng, window = np.random.default_rng(0), PairWindow(height, width, radius)
    features, x = torch.from_numpy(rng.random((2, 2, 3, height, width)))
    squared = window.squared_distances(features)
    place = np.indices((height, width)).reshape(2, -1)
    near = np.abs(place[:, :, None] - place[:, None]).max(axis=0) <= radius
    np.fill_diagonal(near, val=False)
    vectors, values = features.flatten(2), x.flatten(2)
    distances = (vectors[..., None] - vectors[..., None, :]).square().sum(dim=1)
    expected = torch.einsum("bij,bkj->bki", (-distances).exp() * torch.from_numpy(near), values)
    found = PairSum.apply((-squared).exp(), x, window)
    torch.testing.assert_close(found.flatten(2), expected)


def test_the_gradients_of_pair_sums_are_differences():
    window, rng = PairWindow(3, 4, 2), torch.Generator().manual_seed(0)
    pairs = torch.rand(2, len(window.shifts), 3 * (4 + window.margin), generator=rng, requires_grad=True)
    x = torch.randn(2, 3, 3, 4, generator=rng, requires_grad=True)
    assert torch.autograd.gradcheck(lambda pairs, x: PairSum.apply(pairs, x, window), (pairs, x))


@pytest.mark.parametrize("normalization", ["symmetric", "none"])
@pytest.mark.parametrize("radius", [2, COVERING])
def test_the_gradients_of_weights_widths_costs_and_scores_are_differences(normalization, radius):
    """With costs off the Potts model, at which the largest eigenvalue is a kink of the step size."""
    log_g, occupancy = random_grids(3, batch=1, classes=3, shape=(3, 4))
    layer = CrfLayer(CrfParams(1.5, 0.7, 1.5, 0.6, 1.2, normalization), 3, radius, 3, learn_compatibility=True)
    layer.label_costs.data += 0.5 * random_costs(0, 3)
    names, parameters = zip(*layer.named_parameters(), strict=True)
    assert set(names) == {"log_weights", "log_sigmas", "label_costs"}

    def loss(log_g, *parameters):
        return torch.func.functional_call(layer, dict(zip(names, parameters, strict=True)), (log_g, occupancy))

    assert torch.autograd.gradcheck(loss, (log_g.requires_grad_(), *parameters))


def general_free_energy(Q, scores, values, params, costs):
    """E_Q[E] - H(Q), each pair once, with a cost for any two labels."""
    q = Q.reshape(len(Q), -1)
    cost = np.einsum("li,lm,mj->ij", q, costs, q)
    return -(q * scores.reshape(q.shape)).sum() + np.triu(pair_weights(values, params) * cost).sum() + xlogy(q, q).sum()


def test_with_any_costs_of_labels_the_free_energy_never_rises(monkeypatch):
    before = []  # log Q before each update

    def recorded(log_Q, *rest):
        before.append(log_Q)
        return mean_field_update(log_Q, *rest)

    monkeypatch.setattr(layer_module, "mean_field_update", recorded)
    for seed in range(150):
        (log_g, occupancy), params = random_grids(seed, batch=1), random_params(seed)
        layer = CrfLayer(params, log_g.shape[1], COVERING, 11, learn_compatibility=True)
        layer.label_costs.data = random_costs(seed, log_g.shape[1])
        before.clear()
        Qs = [refined(layer, log_g, occupancy), *(log_Q.exp().numpy() for log_Q in before)]
        case = log_g[0].numpy(), occupancy[0].numpy(), params, layer.compatibility.detach()
        last, *found = (general_free_energy(Q[0], *case) for Q in Qs)
        found = np.array([*found, last])
        assert len(found) == 12
        assert (np.diff(found) <= 1e-12 * (1 + np.abs(found).max())).all(), seed


def test_for_the_potts_model_the_step_is_the_damping():
    _, occupancy = random_grids(5, classes=4, shape=(5, 6))
    layer = CrfLayer(CrfParams(), 4, COVERING)
    step = step_size(layer.pairs(occupancy), layer.compatibility)
    for found, values in zip(step.detach().numpy(), occupancy.numpy(), strict=True):
        expected = damping(np.diag(gram_matrix(values, CrfParams())))
        np.testing.assert_allclose(found.ravel(), expected, atol=1e-12)


def test_weights_and_widths_come_out_as_they_went_in_and_serve_the_fast_code():
    params = CrfParams(2.5, 0.0, 3.2, 0.3, 1.2)
    layer = CrfLayer(params, 14)
    out = layer.params()
    assert out.normalization == params.normalization
    for name in ("w_bilateral", "w_spatial", "sigma_alpha", "sigma_beta", "sigma_gamma"):
        assert getattr(out, name) == pytest.approx(getattr(params, name), rel=1e-12)
    log_g, occupancy = random_grids(2, batch=1, classes=14, shape=(30, 20))
    exact = refined(layer, log_g, occupancy)[0]
    fast = mean_field(unary_from_log_probability(log_g[0].numpy()), occupancy[0].numpy(), out)
    assert (exact.argmax(axis=0) == fast.argmax(axis=0)).mean() >= 0.985


def test_a_learnt_compatibility_does_not_pass_for_the_potts_model():
    layer = CrfLayer(CrfParams(), 3, learn_compatibility=True)
    layer.params()
    layer.label_costs.data[0, 1] = 0.5
    with pytest.raises(ArgumentError, match="Potts"):
        layer.params()


def test_weights_can_be_learnt_back():
    """The layer finds the weights and widths that made the maps it sees."""
    log_g, occupancy = random_grids(4, classes=3, shape=(7, 7))
    truth = refined(CrfLayer(CrfParams(2, 1, 2, 0.5, 1.2), 3, COVERING, 3), log_g, occupancy)
    layer = CrfLayer(CrfParams(3, 0.7, 3, 0.4, 0.9), 3, COVERING, 3)
    optimiser = torch.optim.LBFGS(layer.parameters(), max_iter=100, line_search_fn="strong_wolfe")

    def divergence():
        optimiser.zero_grad()
        loss = -(torch.from_numpy(truth) * layer(log_g, occupancy)).sum() / 98
        loss.backward()
        return loss

    optimiser.step(divergence)
    found = layer.params()
    assert (found.w_bilateral, found.w_spatial) == pytest.approx((2, 1), rel=0.02)
    assert (found.sigma_alpha, found.sigma_beta, found.sigma_gamma) == pytest.approx((2, 0.5, 1.2), rel=0.02)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda g, o: (g[0], o), "log_g"),
        (lambda g, o: (g[:, :2], o), "log_g"),
        (lambda g, o: (g, o[:, :3]), "occupancy"),
        (lambda g, o: (g * np.nan, o), "log_g"),
        (lambda g, o: (g - np.inf, o), "log_g"),
        (lambda g, o: (g, 2 * o), "occupancy"),
    ],
)
def test_what_does_not_fit_is_refused(change, message):
    log_g, occupancy = random_grids(0, classes=3, shape=(3, 4))
    with pytest.raises(ArgumentError, match=message):
        CrfLayer(CrfParams(), 3)(*change(log_g, occupancy))


@pytest.mark.parametrize(
    "numbers", [{"n_classes": 0}, {"n_classes": 2, "radius": 0}, {"n_classes": 2, "iterations": -1}]
)
def test_impossible_numbers_are_refused(numbers):
    with pytest.raises(ArgumentError, match=list(numbers)[-1]):
        CrfLayer(CrfParams(), **numbers)


def test_the_crf_without_its_layer_loads_neither_torch_nor_what_draws():
    code = "import sys, semgrid_edu.crf; print(*{'torch', 'matplotlib', 'scipy.stats'} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True).stdout.split() == []
