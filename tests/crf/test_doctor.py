"""Each fault put into correct input is found and named first; correct input is left alone."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter
from scipy.special import log_softmax, softmax

from semgrid_edu.crf import CrfParams, Finding, check, mean_field, unary_from_probability
from semgrid_edu.crf.doctor.distributions import scale_of
from semgrid_edu.crf.doctor.finding import PHRASES
from semgrid_edu.datasets.samples import sample_drive, sample_weights, trained_segmenters
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import build_net, load_net
from semgrid_edu.pipeline import run_pipeline

FRAMES = 2


@dataclass(frozen=True)
class Case:
    """Correct input: scores of a network, states, and the size of a cell."""

    scores: np.ndarray
    values: np.ndarray
    cell: float

    @property
    def g(self):
        return softmax(self.scores, axis=0)

    @property
    def unary(self):
        return -log_softmax(self.scores, axis=0)

    @property
    def params(self):
        return CrfParams.for_cells(self.cell)

    @property
    def grid(self):
        return self.values.shape[1:]


def patches(shape, count, rng):
    return np.argmax([gaussian_filter(rng.normal(size=shape), 4) for _ in range(count)], axis=0)


def street(seed=0, shape=(142, 62), n_classes=14, cell=0.5):
    """Classes and states in patches; scores like a network's, in which the right class stands out."""
    rng = np.random.default_rng(seed)
    scores = 4 * np.eye(n_classes)[patches(shape, n_classes, rng)] + rng.normal(size=(*shape, n_classes))
    values = softmax(5 * np.eye(4)[patches(shape, 4, rng)] + 0.5 * rng.normal(size=(*shape, 4)), axis=-1)
    level = 5 * rng.normal(size=shape)  # a network's scores have one; the soft-max doesn't see it
    return Case(scores.transpose(2, 0, 1) + level, values.transpose(2, 0, 1), cell)


def results(segmenter, grid, frames):
    drive = sample_drive()
    net = load_net(sample_weights(segmenter), drive[0].camera)
    if grid != net.need_architecture().grid:
        trained, net = net, build_net(replace(net.need_architecture(), grid=grid), drive[0].camera)
        net.load_state_dict(trained.state_dict())
    return list(run_pipeline([drive[k] for k in range(frames)], net.eval()))


@pytest.fixture(scope="module")
def sample():
    """A frame of the shipped drive, as the shipped network sees it."""
    shown = results("segnet", GridSpec.compact(), FRAMES)[-1]
    level = 5 * np.random.default_rng(0).normal(size=shown.grid.shape[1:])
    return Case(np.log(shown.grid) + level, shown.belief.probability, 0.5)


@pytest.fixture(params=["sample", "street", "three classes"])
def case(request):
    if request.param == "sample":
        return request.getfixturevalue("sample")
    return street() if request.param == "street" else street(1, (50, 40), 3, 0.2)


# --- correct input -------------------------------------------------------------------------------


@pytest.mark.parametrize("grid", [GridSpec.compact(), GridSpec.paper()], ids=["compact", "paper"])
@pytest.mark.parametrize("segmenter", trained_segmenters())
def test_the_shipped_networks_on_the_shipped_drive_are_healthy(segmenter, grid):
    for result in results(segmenter, grid, FRAMES if grid == GridSpec.compact() else 1):
        params = CrfParams.for_cells(grid.cell)
        unary, o = -np.log(result.grid), result.belief.probability
        for cell, refined in product([None, grid.cell], [None, result.refined, result.refined.argmax(axis=0)]):
            assert check(unary, o, params, refined, cell) == []


@pytest.mark.parametrize("n_classes", [2, 3, 14, 40])
@pytest.mark.parametrize("shape", [(142, 62), (30, 30), (4, 60), (60, 4), (4, 4), (1, 40), (40, 1), (2, 2), (1, 1)])
def test_simulated_input_is_healthy(shape, n_classes):
    case = street(n_classes, shape, n_classes)
    for unary in (case.unary, case.unary.astype(np.float32), case.unary.astype(np.float16)):
        assert check(unary, case.values, case.params) == []
    refined = mean_field(case.unary, case.values, case.params)
    one = np.ptp(refined.argmax(axis=0)) == 0 and refined[0].size >= 100
    assert names(check(case.unary, case.values, case.params, refined)) == ["one label"] * int(one)


def test_what_is_unusual_but_right_is_left_alone():
    case = street()
    impossible = case.g.copy()
    impossible[3] = 0
    impossible /= impossible.sum(axis=0)
    certain = np.eye(14)[patches(case.grid, 13, np.random.default_rng(2))].transpose(2, 0, 1)  # one class is nowhere
    labels = 0.9 * certain + 0.1 / 14
    raised = case.g + 1e-3
    for g in (impossible, certain, labels, raised / raised.sum(axis=0)):
        assert check(unary_from_probability(g), case.values, case.params, cell=0.5) == []
    assert check(-np.log(raised), case.values, case.params) == []
    assert check(case.unary, np.full_like(case.values, 0.25), case.params) == []  # nothing observed yet
    assert check(case.unary, np.eye(4)[case.values.argmax(axis=0)].transpose(2, 0, 1), case.params) == []
    assert check(torch.tensor(case.unary), torch.tensor(case.values), case.params) == []
    assert check(np.asfortranarray(case.unary), case.values[:, ::-1][:, ::-1], case.params) == []
    assert check(np.ma.masked_array(case.unary), case.values.tolist(), case.params) == []


# --- faults, one by one --------------------------------------------------------------------------


def unary_faults(case):
    g, phi, (height, width) = case.g, case.unary, case.grid
    last, hole = np.moveaxis(g, 0, -1), np.zeros(case.grid, bool)
    hole[3, 4] = True
    whole = np.rint(255 * g)
    yield "scores", case.scores
    yield "log probabilities", -phi
    yield "log probabilities", logarithm(np.where(hole, np.eye(len(g))[0][:, None, None], g))
    yield "probabilities", g
    yield "probabilities", 100 * g
    yield "probabilities", (whole + (np.arange(len(g))[:, None, None] == g.argmax(axis=0)) * (255 - whole.sum(axis=0)))
    yield "classes on the wrong axis", np.moveaxis(phi, 0, -1)
    yield "classes on the wrong axis", np.moveaxis(phi, 0, 1)
    yield "classes on the wrong axis", phi.transpose(2, 1, 0)
    yield "rows and columns swapped", phi.transpose(0, 2, 1)
    yield "unary reshaped, not transposed", -np.log(last.reshape(g.shape))
    yield "batch axis", phi[None]
    yield "cells in one row", phi.reshape(len(phi), -1)
    yield "cells in one row", phi.reshape(len(phi), -1).T
    yield "grids differ", phi[:, :-2]
    yield "grids differ", phi[None, None]
    yield "labels for costs", g.argmax(axis=0)
    yield "labels for costs", np.where(hole, 255, g.argmax(axis=0)).astype(np.uint8)
    yield "labels for costs", np.where(hole, -1, g.argmax(axis=0))[None]
    yield "one class", -np.log(g[:1])
    yield "soft-max over the wrong axis", -log_softmax(case.scores, axis=1)
    yield "soft-max over the wrong axis", -log_softmax(case.scores, axis=2)
    yield "soft-max over the wrong axis", -log_softmax(case.scores, axis=(1, 2))
    yield "ignore label", np.concatenate([phi, np.zeros((1, height, width))])
    yield "ignore label", np.concatenate([np.full((1, height, width), -1.0), phi])
    yield "ignore label", -np.log(0.9 * np.eye(256)[g.argmax(axis=0)].transpose(2, 0, 1) + 0.1 / 256)
    yield "undecided network", -log_softmax(1e-3 * case.scores, axis=0)
    yield "undecided network", np.zeros_like(phi)
    yield "scaled costs", -np.log10(g)
    yield "scaled costs", -np.log2(g)
    yield "scaled costs", phi / 3
    yield "no distribution", phi - case.scores.mean(axis=0)
    yield "no distribution", -case.scores
    yield "no distribution", np.where(hole, 0, phi)
    yield "no distribution", np.rint(phi).astype(np.int64)
    yield "NaN in the unary", np.where(hole, np.nan, phi)
    yield "infinite costs", np.where(hole, np.inf, phi)
    yield "infinite costs", np.where(hole & (np.arange(len(g)) == 1)[:, None, None], -np.inf, phi)
    yield "float16 overflow", unary_of_half(case.scores)
    yield "empty array", phi[:, :0]
    yield "empty array", []
    yield "masked cells", np.ma.masked_array(phi, np.broadcast_to(hole, phi.shape))
    yield "no array of numbers", torch.tensor(phi, requires_grad=True)
    yield "no array of numbers", None
    yield "no array of numbers", "unary.npy"
    yield "no array of numbers", phi.astype(complex)
    yield "no array of numbers", [[1.0], [1.0, 2.0]]


def unary_of_half(scores):
    """The soft-max in half precision, then its logarithm: what is unlikely has probability 0."""
    return -logarithm(softmax(4 * scores, axis=0).astype(np.float16))


def logarithm(probability):
    with np.errstate(divide="ignore"):
        return np.log(probability)


def values_faults(case):
    o, hole = case.values.astype(np.float64), np.zeros(case.grid, bool)
    hole[3, 4] = True
    log_o = logarithm(o)
    rng = np.random.default_rng(0)
    yield "states on the wrong axis", np.moveaxis(o, 0, -1)
    yield "states on the wrong axis", np.moveaxis(o, 0, 1)
    yield "batch axis", o[None]
    yield "not four states", o[:3]
    yield "not four states", o.argmax(axis=0)
    yield "not four states", o.reshape(4, -1)
    yield "not four states", 1 - o[:1]
    yield "values reshaped, not transposed", np.moveaxis(o, 0, -1).reshape(o.shape)
    yield "states in other units", 100 * o
    yield "states in other units", np.rint(100 * o).astype(int)
    yield "states in other units", (255 * o).astype(np.uint8)
    yield "counts of states", rng.poisson(3 * o) + (np.arange(4) == 0)[:, None, None] * rng.integers(0, 5, case.grid)
    yield "cells without a state", np.where(hole, 0, o)
    yield "logarithms of states", np.maximum(log_o, -1e9)
    yield "logarithms of states", np.minimum(-log_o, 1e9)
    yield "NaN in the states", np.where(hole, np.nan, o)
    yield "states don't sum to one", np.where(hole, 0.3, o)
    yield "states don't sum to one", o / 2
    yield "states don't sum to one", np.where(hole, np.reshape([2, -1, 0, 0], (4, 1, 1)), o)
    yield "no array of numbers", None


def params_faults(case):
    right = case.params
    yield "no parameters", None
    yield "no parameters", CrfParams
    yield "no parameters", {"w_bilateral": 4}
    yield "weights zero", replace(right, w_bilateral=0, w_spatial=0)
    yield "widths in metres", replace(right, sigma_alpha=1.6, sigma_gamma=0.6)
    yield "widths in metres", replace(right, sigma_gamma=0.6)
    yield "widths in metres", replace(right, sigma_alpha=1.6)
    yield "narrow kernel", replace(right, sigma_alpha=0.3)
    yield "narrow kernel", replace(right, sigma_gamma=0.015)
    yield "wide kernel", replace(right, sigma_gamma=1000)
    yield "wide kernel", replace(right, sigma_alpha=160, w_spatial=0)
    yield "blind to occupancy", replace(right, sigma_beta=13)
    yield "pairs outweigh the network", replace(right, normalization="none")
    yield "pairs outweigh the network", replace(right, w_bilateral=1000)


def refined_faults(case):
    Q = mean_field(case.unary, case.values, case.params)
    labels, hole = Q.argmax(axis=0), np.zeros(case.grid, bool)
    hole[3, 4] = True
    opposite = mean_field(case.unary.max(axis=0) - case.unary, case.values, case.params)
    yield "one label", np.zeros_like(labels)
    yield "one label", np.broadcast_to(Q[:, :1, :1], Q.shape)
    yield "ignore label", np.where(hole, 255, labels)
    yield "ignore label", np.where(hole, -1, labels)
    yield "refined prefers what costs most", opposite
    yield "refined prefers what costs most", opposite.argmax(axis=0)
    yield "refinement without effect", case.g
    yield "refinement without effect", mean_field(case.unary, case.values, case.params, 0)
    yield "refined has another shape", np.moveaxis(Q, 0, -1)
    yield "refined has another shape", labels.T
    yield "refined holds no probabilities", np.where(hole, np.nan, Q)
    yield "refined holds no probabilities", np.log(Q + 1e-9)
    yield "refined holds no probabilities", np.full_like(Q, np.nan)
    yield "empty array", Q[:0]
    yield "no array of numbers", "Q"


def names(findings):
    return [finding.name for finding in findings]


def test_a_fault_of_the_unary_term_is_named_and_nothing_else(case):
    for expected, unary in unary_faults(case):
        assert names(check(unary, case.values, case.params)) == [expected]


def test_a_fault_of_the_states_is_named_and_nothing_else(case):
    for expected, values in values_faults(case):
        assert names(check(case.unary, values, case.params)) == [expected]


def test_a_fault_of_the_parameters_is_named_first(case):
    for expected, params in params_faults(case):
        assert names(check(case.unary, case.values, params, cell=case.cell))[:1] == [expected]


def test_a_fault_of_the_refined_map_is_named_and_nothing_else(case):
    for expected, refined in refined_faults(case):
        assert names(check(case.unary, case.values, case.params, refined)) == [expected]


# --- what one fault hides, and what one can't see ------------------------------------------------


def test_behind_a_wrong_axis_the_next_fault_is_found():
    case = street()
    scores, values = np.moveaxis(case.scores, 0, -1), np.moveaxis(case.values, 0, -1)
    expected = ["states on the wrong axis", "classes on the wrong axis", "scores"]
    assert names(check(scores, values, case.params)) == expected
    assert names(check(case.scores[None], case.values, CrfParams(0, 0))) == ["batch axis", "scores", "weights zero"]


def test_arguments_in_the_wrong_order_are_told_apart():
    case = street()
    assert names(check(case.values, case.unary, case.params)) == ["arguments swapped"]
    assert names(check(case.values, case.g, case.params)) == ["arguments swapped", "probabilities"]
    four = street(0, (60, 40), 4)
    assert check(four.unary, four.values, four.params) == []
    assert names(check(four.values, four.unary, four.params))[0] == "probabilities"


def test_axes_of_equal_length_are_told_apart_by_the_numbers():
    case = street(0, (14, 14), 14)
    assert check(case.unary, case.values, case.params) == []
    for axis in (1, 2):
        found = check(np.moveaxis(case.unary, 0, axis), case.values, case.params)
        assert names(found) == ["soft-max over the wrong axis"]
    case = street(0, (4, 60), 3)
    found = check(case.unary, np.moveaxis(case.values, 0, 1), case.params)
    assert names(found) == ["states on the wrong axis"]


def test_an_impossible_class_is_no_score_that_stands_out():
    case = street()
    unary = 1 + case.unary
    unary[3] = np.inf
    assert names(check(unary, case.values, case.params)) == ["no distribution"]


def test_of_two_classes_scores_look_like_costs():
    case = street(0, (60, 40), 2)
    for scores in (case.scores, -case.scores):
        found = check(scores, case.values, case.params)
        assert names(found) == ["no distribution"]
        assert "scores, with or without a minus sign" in found[0].cause


@pytest.mark.parametrize("factor", [np.log(10), np.log(2), 0.3, 3.0, 20.0])
def test_the_factor_of_scaled_costs_is_found(factor):
    unary = street(0, (60, 40)).unary
    assert scale_of(unary / factor) == pytest.approx(factor, rel=1e-6)
    assert scale_of(-street(0, (60, 40)).scores) is None


def test_a_refined_map_is_judged_beside_the_fault_that_made_it():
    case = street()
    everything = mean_field(case.g, case.values, CrfParams(40, 40)).argmax(axis=0)
    found = names(check(case.g, case.values, CrfParams(40, 40), everything))
    assert found[0] == "probabilities"


# --- widths ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("spec", [GridSpec.compact(), GridSpec.paper()], ids=["compact", "paper"])
def test_the_defaults_in_metres_are_suspected_on_both_grids(spec):
    case = street(0, spec.shape, 3, spec.cell)
    metres = CrfParams(sigma_alpha=8 * 0.2, sigma_gamma=3 * 0.2)
    for cell in (None, spec.cell):
        found = check(case.unary, case.values, metres, cell=cell)
        assert names(found) == ["widths in metres"]
    assert f"CrfParams.for_cells({spec.cell})" in found[0].remedy


def test_the_same_widths_are_right_for_cells_of_a_metre():
    case = street(0, (71, 31), 3, 1.0)
    for cell in (None, 1.0):
        assert check(case.unary, case.values, CrfParams.for_cells(1.0), cell=cell) == []


def test_widths_for_the_papers_cells_are_noticed_where_cells_are_known_to_be_others():
    case = street()
    assert check(case.unary, case.values, CrfParams()) == []
    assert names(check(case.unary, case.values, CrfParams(), cell=0.5)) == ["widths for another grid"]
    assert check(case.unary, case.values, CrfParams(sigma_alpha=6), cell=0.5) == []
    assert check(case.unary, case.values, CrfParams(), cell=0.2) == []


def test_the_parameters_of_another_package_for_photographs_are_noticed():
    case = street()
    photograph = CrfParams(w_bilateral=10, w_spatial=3, sigma_alpha=80, sigma_beta=13, sigma_gamma=3)
    assert names(check(case.unary, case.values, photograph)) == ["blind to occupancy"]


@pytest.mark.parametrize("cell", [0.1, 0.2, 0.25, 0.5, 1.0])
@pytest.mark.parametrize("w", [(4, 3), (0.1, 0.1), (10, 3), (0, 3), (4, 0)])
def test_reasonable_parameters_are_left_alone(cell, w):
    case = street(0, (60, 40), 5, cell)
    for sigma_beta in (0.05, 0.2, 1.0):
        params = replace(case.params, w_bilateral=w[0], w_spatial=w[1], sigma_beta=sigma_beta)
        assert check(case.unary, case.values, params, cell=cell) == []


# --- symptoms -------------------------------------------------------------------------------------


def test_a_symptom_is_what_one_sees():
    case = street(0, (60, 40))
    right, before = mean_field(case.unary, case.values, case.params).argmax(axis=0), case.g.argmax(axis=0)
    for name, unary in unary_faults(case):
        finding = check(unary, case.values, case.params)[0]
        if name in ("scores", "log probabilities", "probabilities") and np.isfinite(unary).all():
            assert PHRASES["worse"] in finding.symptom
            labels = mean_field(unary, case.values, case.params).argmax(axis=0)
            assert (labels == right).mean() < 0.2 < (before == right).mean()
        if finding.symptom == PHRASES["shape_error"] and np.ndim(unary) != 3:
            with pytest.raises(ArgumentError, match="shape"):
                mean_field(unary, case.values, case.params)
    for _, values in values_faults(case):
        if check(case.unary, values, case.params)[0].symptom == PHRASES["refused"]:
            with pytest.raises(ArgumentError, match=r"^values"):
                mean_field(case.unary, values, case.params)


def test_one_class_gives_a_map_of_zeros():
    case = street(0, (60, 40))
    assert not mean_field(-np.log(case.g[:1]), case.values, case.params).argmax(axis=0).any()


# --- whatever comes -------------------------------------------------------------------------------

JUNK = [
    None,
    "unary",
    3,
    np.nan,
    [],
    [[1, 2], [3]],
    {},
    np.zeros(()),
    np.zeros((0, 3, 3)),
    np.zeros((3, 3)),
    np.full((2, 4, 4), np.nan),
    np.full((2, 4, 4), np.inf),
    np.full((2, 4, 4), -np.inf),
    np.full((4, 4, 4), 1e308),
    np.full((4, 4, 4), -1e308),
    np.full((4, 4, 4), 0.25),
    np.ones((4, 4, 4), bool),
    np.arange(64, dtype=np.uint8).reshape(4, 4, 4),
    np.zeros((1, 4, 4, 4)),
    np.zeros((2, 2, 2, 2, 2)),
    np.zeros((4, 4, 4), complex),
    np.zeros((4, 4, 4), object),
    np.zeros((4, 4, 4), "datetime64[s]"),
    torch.zeros((4, 4, 4), requires_grad=True),
    np.ma.masked_all((4, 4, 4)),
]


@pytest.mark.parametrize("first", range(len(JUNK)))
def test_nothing_raises_an_error(first):
    right = street(0, (4, 4), 4)
    for second, params in product([*JUNK, right.values], [CrfParams(), None]):
        for unary, values in ((JUNK[first], second), (right.unary, JUNK[first])):
            for finding in check(unary, values, params, JUNK[first]):
                assert isinstance(finding, Finding)
                assert all(len(text) > 5 for text in vars(finding).values())


def test_findings_can_be_read():
    case = street(0, (60, 40))
    found = check(-case.unary, 100 * case.values, case.params)
    text = str(found)
    assert repr(found) == text
    assert names(found) == ["log probabilities", "states in other units"]
    assert text.count("symptom") == text.count("remedy") == 2
    assert max(map(len, text.splitlines())) <= 110
    assert str(check(case.unary, case.values, case.params)).startswith("Nothing wrong was found")


def test_arrays_are_left_as_they_were():
    case = street(0, (60, 40))
    unary, values = case.scores.copy(), case.values.copy()
    check(unary, values, case.params, unary)
    np.testing.assert_array_equal(unary, case.scores)
    np.testing.assert_array_equal(values, case.values)
