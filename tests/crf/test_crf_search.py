"""The search for the CRF's weights and widths, which made docs/results/crf_search*.json."""

import numpy as np
from worlds.lecture_11_search import EXPLORED, next_point, params_at


def test_a_search_fills_the_box_and_then_comes_close_to_the_optimum_of_each_objective():
    assert params_at(np.array([0.5, 0.5, 0.5, 0.0, 1.0]), cell=0.2).sigma_beta == 0.05
    optimum, points, values = np.array([0.2, 0.9, 0.5, 0.35, 0.0]), [], []
    for _ in range(260):
        points.append(next_point(points, values, seed=0))
        values.append(-np.linalg.norm([points[-1] - optimum, points[-1] - (1 - optimum)], axis=1))
    quarters = [np.bincount((4 * axis).astype(int), minlength=4) for axis in np.array(points[:EXPLORED]).T]
    assert np.min(quarters) >= 12  # of 64 points, in each quarter of each axis
    assert (np.max(values, axis=0) > -0.06).all()
