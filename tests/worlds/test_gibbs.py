"""Gibbs sampling draws each label as often as the CRF's own probabilities say."""

import numpy as np
from worlds.lecture_11_gibbs import frequencies

from semgrid_edu.crf import CrfParams, exact_marginals, pair_weights


def test_labels_are_drawn_as_often_as_the_exact_marginals_say():
    rng = np.random.default_rng(1)
    unary, values = rng.normal(size=(3, 2, 2)), rng.dirichlet(np.ones(4), (2, 2)).transpose(2, 0, 1)
    params = CrfParams(w_bilateral=1.0, w_spatial=0.5)
    drawn = frequencies(unary, pair_weights(values, params), sweeps=6000, burn_in=100)
    np.testing.assert_allclose(drawn, exact_marginals(unary, values, params), atol=0.03)
