"""The dense CRF on a few cells: its distribution, and how far approximations are from it as cells couple."""

import numpy as np
import pytest
from worlds.lecture_10_crf import crf_stage, sampled_marginals, two_classes

from semgrid_edu.crf import CrfParams, exact_marginals, pair_weights
from semgrid_edu.graphical import d_separated


@pytest.mark.parametrize("shape", [(3, 3), (2, 2)])
def test_every_pair_has_a_line_of_its_own(shape):
    stage = crf_stage(unary=two_classes(np.full(shape, 0.6)))
    cells = shape[0] * shape[1]
    assert len(stage.model.factors) == cells + cells * (cells - 1) // 2
    assert len({tuple(np.round(place, 6)) for place in stage.positions.values()}) == len(stage.positions)
    assert not d_separated(stage.model, "x1", "x2", given=[f"x{k}" for k in range(3, cells + 1)])
    stage.draw()


def test_gibbs_sampling_tends_to_the_exact_marginals():
    rng = np.random.default_rng(1)
    unary, values = rng.normal(size=(3, 2, 2)), rng.dirichlet(np.ones(4), (2, 2)).transpose(2, 0, 1)
    params = CrfParams(w_bilateral=1.0, w_spatial=0.5)
    prices = pair_weights(values, params)
    drawn = sampled_marginals(unary.reshape(3, 4), prices, np.zeros(4, dtype=int), sweeps=6000)
    np.testing.assert_allclose(drawn.reshape(3, 2, 2), exact_marginals(unary, values, params), atol=0.015)
