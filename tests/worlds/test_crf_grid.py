"""The dense CRF on a few cells: its distribution, and how far approximations are from it as cells couple."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from worlds.lecture_10_crf import UNDECIDED, all_free, coupled, crf_stage, sampled_marginals, two_classes

from semgrid_edu.crf import CrfParams, crf_model, exact_marginals, mean_field_naive, pair_weights
from semgrid_edu.graphical import d_separated, mean_field_graph


def test_at_the_default_weights_mean_field_picks_a_side_while_the_exact_marginals_stay_undecided():
    assert coupled(4.0) == CrfParams()
    world = two_classes(UNDECIDED), all_free((3, 3)), coupled(4.0)
    np.testing.assert_allclose(exact_marginals(*world)[0], 0.52, atol=0.002)
    assert mean_field_naive(*world)[0, 1, 1] == pytest.approx(0.998, abs=5e-4)


def test_strongly_coupled_cells_vote():
    # All nine agree; four votes of 0.6 against four, and the centre's 0.52 decides.
    marginals = exact_marginals(two_classes(UNDECIDED), all_free((3, 3)), coupled(40.0))
    np.testing.assert_allclose(marginals[0], 0.52, atol=1e-9)


@pytest.mark.parametrize("coupling", [1.0, 3.0])
def test_the_packages_mean_field_settles_where_updates_of_single_cells_do(coupling):
    unary, values = two_classes(UNDECIDED), all_free((3, 3))
    found = mean_field_graph(crf_model(unary, values, coupled(coupling)), iterations=200)
    naive = mean_field_naive(unary, values, coupled(coupling), iterations=200).reshape(2, -1)
    np.testing.assert_allclose(np.stack(list(found.marginals.values()), axis=1), naive, atol=1e-6)


@pytest.mark.parametrize("shape", [(3, 3), (2, 2)])
def test_every_pair_has_a_line_of_its_own(shape):
    stage = crf_stage(unary=two_classes(np.full(shape, 0.6)))
    cells = shape[0] * shape[1]
    assert len(stage.model.factors) == cells + cells * (cells - 1) // 2
    assert len({tuple(np.round(place, 6)) for place in stage.positions.values()}) == len(stage.positions)
    assert not d_separated(stage.model, "x1", "x2", given=[f"x{k}" for k in range(3, cells + 1)])
    plt.close(stage.draw().figure)


def test_gibbs_sampling_tends_to_the_exact_marginals():
    rng = np.random.default_rng(1)
    unary, values = rng.normal(size=(3, 2, 2)), rng.dirichlet(np.ones(4), (2, 2)).transpose(2, 0, 1)
    params = CrfParams(w_bilateral=1.0, w_spatial=0.5)
    prices = pair_weights(values, params)
    drawn = sampled_marginals(unary.reshape(3, 4), prices, np.zeros(4, dtype=int), sweeps=6000)
    np.testing.assert_allclose(drawn.reshape(3, 2, 2), exact_marginals(unary, values, params), atol=0.015)
