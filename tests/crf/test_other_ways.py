"""What companion 11 measures the CRF against: every labelling, messages, low-rank kernels; and its errors."""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from enumeration import enumerated
from scipy.special import softmax
from sklearn.kernel_approximation import Nystroem
from worlds import lecture_11_coupling as coupling_study
from worlds import lecture_11_error as error_study
from worlds.lecture_10_crf import all_free, coupled, two_classes
from worlds.lecture_11_charts import coupling_errors, error_against_time
from worlds.lecture_11_coupling import random_crf
from worlds.lecture_11_error import CROP, N_CROPS, CrfProblem, crops
from worlds.lecture_11_other_ways import LowRankGaussian, mean_field_low_rank, potts_messages, visit_labellings
from worlds.lecture_11_search import EXPLORED, next_point, params_at

from semgrid_edu.crf import (
    CrfParams,
    crf_model,
    exact_marginals,
    gram_matrix,
    mean_field_naive,
    most_likely,
    unary_from_probability,
)
from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import sum_product

RESULTS = Path(__file__).parents[2] / "docs" / "results"


def problem(seed=0, shape=(6, 7)):
    rng = np.random.default_rng(seed)
    unary = unary_from_probability(softmax(rng.normal(size=(3, *shape)), axis=0))
    return CrfProblem(unary, np.moveaxis(rng.dirichlet(np.ones(4), shape), -1, 0), CrfParams(sigma_alpha=2))


@pytest.mark.parametrize("shape", [(2, 1, 1), (3, 1, 2), (2, 3, 3), (3, 2, 3), (4, 2, 2), (1, 2, 2)])
def test_every_labelling_gives_what_elimination_gives(shape):
    crf = *random_crf(shape, 0), coupled(3.0)
    marginals, labels = visit_labellings(*crf)
    np.testing.assert_allclose(marginals, exact_marginals(*crf), atol=1e-12)
    np.testing.assert_array_equal(labels, most_likely(*crf))


@pytest.mark.parametrize(("shape", "coupling"), [((2, 2, 2), 0.0), ((3, 2, 2), 1.0), ((3, 1, 2), 4.0)])
def test_messages_from_cell_to_cell_are_those_through_factors(shape, coupling):
    crf = *random_crf(shape, 1), coupled(coupling)
    model = crf_model(*crf)
    beliefs = sum_product(model, iterations=200, damping=0.5).marginals
    found = np.stack([beliefs[name] for name in model.names], axis=1).reshape(shape)
    np.testing.assert_allclose(potts_messages(*crf), found, atol=1e-6)


def test_between_two_cells_the_best_messages_give_max_marginals():
    crf = *random_crf((3, 1, 2), 1), coupled(4.0)
    labellings, energies = enumerated(*crf)
    best = [[np.exp(-energies[labellings[:, 0, i] == label].min()) for i in (0, 1)] for label in range(3)]
    np.testing.assert_allclose(potts_messages(*crf, best=True)[:, 0], best / np.sum(best, axis=0), atol=1e-9)


def test_too_many_labellings_and_impossible_classes_are_errors():
    with pytest.raises(ArgumentError, match="labellings"):
        visit_labellings(np.zeros((2, 5, 6)), all_free((5, 6)), coupled(1.0))
    with pytest.raises(ArgumentError, match="finite"):
        visit_labellings(np.array([[[0.0]], [[np.inf]]]), all_free((1, 1)), coupled(1.0))


def test_errors_are_total_variations_and_labels_those_of_the_best_labelling():
    found = coupling_study.measure_coupling((2, 2, 2), [0.0, 4.0], 1, seed=7)
    crf = *random_crf((2, 2, 2), 7), coupled(4.0)
    Q, exact = mean_field_naive(*crf), exact_marginals(*crf)
    way = "mean field, 10 updates"
    assert found["variation"][way][1][0] == pytest.approx(np.abs(Q - exact)[0].mean())
    assert found["labels"][way][1][0] == pytest.approx((Q.argmax(axis=0) != most_likely(*crf)).mean())
    assert max(errors[0][0] for part in found.values() for errors in part.values()) < 1e-5  # without pairs


def test_mean_field_picks_a_side_where_the_exact_marginal_stays_undecided():
    for p, sure in ((0.501, 0.99), (0.499, 0.01)):
        for coupling, side in ((0.5, 0.5), (4.0, sure)):
            crf = two_classes(np.full((3, 3), p)), all_free((3, 3)), coupled(coupling)
            assert visit_labellings(*crf)[0][0, 1, 1] == pytest.approx(0.5, abs=0.01)
            converged = coupling_study.WAYS["mean field, converged"](*crf)
            assert converged[0, 1, 1] == pytest.approx(side, abs=0.01)


def test_the_reference_has_no_kernel_error_and_errors_are_those_of_the_definition():
    scene = error_study.measure_scene([problem(0), problem(1)])
    assert max(one["max"] for one in scene["ways"]["naive"]["kernel"]) == 0
    for way, found in scene["ways"].items():
        assert found["convergence"][-1]["max"] < 1e-3
        if way in ("all pairs", "rank 64"):  # 64 landmarks are all of the 42 cells
            assert max(one["max"] for one in found["kernel"]) < 1e-4
    found, k = scene["ways"]["naive"], error_study.ITERATIONS.index(3)
    runs = [[mean_field_naive(*problem(seed), iterations) for iterations in (3, 1000)] for seed in (0, 1)]
    variations = [np.abs(few - many).sum(axis=0) / 2 for few, many in runs]
    assert found["total"][k]["mean"] == pytest.approx(np.mean(variations), rel=1e-2)
    assert found["total"][k]["max"] == pytest.approx(np.max(variations), rel=1e-2)
    assert found["total"] == found["convergence"]
    result = {"iterations": list(error_study.ITERATIONS), "scenes": {"tiny": scene}}
    assert "tiny, 6 x 7 cells, 10 updates, against naive" in error_study.crf_error_tables(result)


def test_distance_by_hand():
    one, other = np.array([[[0.8, 0.5]], [[0.2, 0.5]]]), np.array([[[0.4, 0.5]], [[0.6, 0.5]]])
    assert error_study.distance(one, other) == pytest.approx({"mean": 0.2, "max": 0.4, "labels": 0.5})


def test_the_low_rank_kernel_is_nystroems():
    _, values, params = problem()
    place = np.indices(values.shape[1:]) / params.sigma_alpha
    features = np.concatenate([place, values / params.sigma_beta]).reshape(6, -1).T
    oracle = Nystroem(gamma=0.5, n_components=12, random_state=0).fit(features)
    expected = oracle.transform(features) @ oracle.transform(features).T
    plain = CrfParams(w_bilateral=1, sigma_alpha=2, normalization="none")
    found = LowRankGaussian.build(values, plain, oracle.component_indices_)
    np.testing.assert_allclose(found(np.eye(42, dtype=np.float32)), expected, atol=1e-4)
    np.testing.assert_allclose(found.diagonal, np.diag(expected), atol=1e-4)


@pytest.mark.parametrize("normalization", ["symmetric", "none"])
def test_with_every_cell_a_landmark_it_is_the_naive_one(normalization):
    unary, values, _ = problem()
    params = CrfParams(1, 1, 2, 0.3, 2, normalization)
    kernel = LowRankGaussian.build(values, params, np.arange(42))
    spatial = gram_matrix(values, CrfParams(0, 1, 2, 0.3, 2, normalization))
    exact = gram_matrix(values, params) - spatial
    np.testing.assert_allclose(kernel(np.eye(42, dtype=np.float32)), exact, atol=1e-5)
    found = mean_field_low_rank(unary, values, params, 10, 0.0, rank=1000, seed=0)
    np.testing.assert_allclose(found, mean_field_naive(unary, values, params), atol=1e-4)


def test_crops_are_one_ahead_of_the_other_in_the_middle():
    row, column = np.indices((CROP * N_CROPS + 5, CROP + 10))
    found = crops(CrfProblem(np.stack([row, column]), np.stack([row] * 4), CrfParams()))
    assert len(found) == N_CROPS
    for k, crop in enumerate(found):
        assert crop.unary.shape[1:] == crop.values.shape[1:] == (CROP, CROP)
        assert crop.unary[0, -1, 0] == CROP * N_CROPS + 4 - k * CROP
        assert crop.unary[1, 0, 0] == 5


def test_figures_have_a_line_for_each_way():
    coupling, error = (json.loads((RESULTS / f"crf_{name}.json").read_text()) for name in ("coupling", "error"))
    assert [len(ax.get_lines()) for ax in coupling_errors(coupling).axes] == [4] * 4 + [6] * 4
    figure = error_against_time(error, "compact grid")
    assert [len(ax.get_lines()) for ax in figure.axes] == [len(error_study.crf_ways())] * 3
    plt.close("all")


def test_a_search_fills_the_box_and_then_comes_close_to_the_optimum_of_each_objective():
    assert params_at(np.array([0.5, 0.5, 0.5, 0.0, 1.0]), cell=0.2).sigma_beta == 0.05
    optimum, points, values = np.array([0.2, 0.9, 0.5, 0.35, 0.0]), [], []
    for _ in range(260):
        points.append(next_point(points, values, seed=0))
        values.append(-np.linalg.norm([points[-1] - optimum, points[-1] - (1 - optimum)], axis=1))
    quarters = [np.bincount((4 * axis).astype(int), minlength=4) for axis in np.array(points[:EXPLORED]).T]
    assert np.min(quarters) >= 12  # of 64 points, in each quarter of each axis
    assert (np.max(values, axis=0) > -0.06).all()
