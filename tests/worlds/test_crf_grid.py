"""The dense CRF on a few cells: its distribution, and how far approximations are from it as cells couple."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from worlds.lecture_10_crf import (
    UNDECIDED,
    all_free,
    coupled,
    coupling_sweep,
    crf_stage,
    critical_coupling,
    two_classes,
)  # fmt: skip

from semgrid_edu.crf import CrfParams, crf_model, exact_marginals, mean_field_naive
from semgrid_edu.graphical import d_separated, mean_field_graph


@pytest.fixture(scope="module")
def sweep():
    return coupling_sweep([0.0, 1.0, 1.5, 4.0, 2.0])


def test_without_coupling_every_method_is_exact(sweep):
    assert all(errors[0] < 1e-6 for errors in sweep.errors.values())
    np.testing.assert_allclose(sweep.marginals["exact"][0, 0], UNDECIDED.ravel(), atol=1e-12)


def test_below_the_transition_loopy_sum_product_errs_about_half_as_much_as_mean_field(sweep):
    errors = {method: error[1] for method, error in sweep.errors.items()}
    assert 0.010 < errors["mean field"] < 0.016
    assert 0.4 < errors["loopy"] / errors["mean field"] < 0.6
    assert errors["naive"] == pytest.approx(errors["mean field"], rel=0.1)


def test_just_above_it_converged_mean_field_errs_most_and_ten_updates_least(sweep):
    errors = {method: error[2] for method, error in sweep.errors.items()}
    assert errors["mean field"] > 0.25
    assert errors["naive"] < errors["loopy"] < errors["mean field"]
    assert errors["naive"] == pytest.approx(0.049, abs=5e-4)


def test_the_fast_filter_errs_like_the_naive_one(sweep):
    np.testing.assert_allclose(sweep.marginals["fast"], sweep.marginals["naive"], atol=0.005)


def test_at_the_default_weights_all_pick_a_side_while_the_exact_marginals_stay_undecided(sweep):
    assert coupled(4.0) == CrfParams()
    np.testing.assert_allclose(sweep.marginals["exact"][:, 0, 4], 0.52, atol=0.002)
    np.testing.assert_allclose(sweep.marginals["exact"][3, 0], 0.52, atol=0.002)
    for method in ("mean field", "naive", "fast", "loopy"):
        assert sweep.marginals[method][3, 0, 4] == pytest.approx(0.998, abs=5e-4)
        assert sweep.errors[method][3] == pytest.approx(0.478, abs=1e-3)
    assert all(wrong[3] == 0 for wrong in sweep.wrong_labels.values())


def test_between_the_two_the_most_probable_class_of_a_cell_is_not_that_of_the_best_labelling(sweep):
    assert sweep.labelling[1].tolist() == [0] * 9
    assert sweep.wrong_labels["exact"][1] == 4


def test_the_numbers_of_the_docstring(sweep):
    """The centre at couplings of 1, 2 and 4."""
    centre = {method: found[[1, 4, 3], 0, 4] for method, found in sweep.marginals.items()}
    np.testing.assert_allclose(centre["exact"], 0.52, atol=0.005)
    np.testing.assert_allclose(centre["mean field"], [0.52, 0.94, 0.998], atol=0.005)
    np.testing.assert_allclose(centre["loopy"], [0.52, 0.92, 0.998], atol=0.005)
    assert sweep.converged[[1, 4, 3]].all()


def test_sixteen_cells_have_their_transition_too():
    """A chequerboard of 0.4 and 0.6 with one cell of 0.64, below and above the coupling of 1.23."""
    values = all_free((4, 4))
    board = np.where(np.indices((4, 4)).sum(axis=0) % 2, 0.4, 0.6)
    board[1, 1] = 0.64
    assert 1.0 < critical_coupling(2, values) < 1.5
    errors = coupling_sweep([1.0, 1.5], two_classes(board)).errors
    below, above = ({method: error[k] for method, error in errors.items()} for k in (0, 1))
    assert below["loopy"] < below["mean field"] < 0.02
    assert above["naive"] < above["loopy"] < above["mean field"]
    assert above["mean field"] > 0.25
    assert above["fast"] == pytest.approx(above["naive"], abs=0.005)


def test_strongly_coupled_cells_vote():
    # All nine agree; four votes of 0.6 against four, and the centre's 0.52 decides.
    marginals = exact_marginals(two_classes(UNDECIDED), all_free((3, 3)), coupled(40.0))
    np.testing.assert_allclose(marginals[0], 0.52, atol=1e-9)


@pytest.mark.parametrize(("share", "undecided"), [(0.9, True), (1.1, False)])
def test_mean_field_leaves_the_uniform_distribution_at_the_critical_coupling(share, undecided):
    values = all_free((3, 3))
    critical = critical_coupling(2, values)
    assert critical == pytest.approx(1.298, abs=5e-4)
    world = two_classes(np.full((3, 3), 0.5)), values, coupled(share * critical)
    np.testing.assert_allclose(exact_marginals(*world), 0.5, atol=1e-12)
    model = crf_model(*world)
    largest = max(p.max() for p in mean_field_graph(model, iterations=300, seed=0).marginals.values())
    assert (largest < 0.51) == undecided
    assert undecided or largest > 0.7


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
