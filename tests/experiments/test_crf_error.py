"""What a result of the error study means: its ways, its three errors, and that it goes on where it was."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.special import softmax
from sklearn.kernel_approximation import Nystroem
from worlds.lecture_11_charts import error_against_time

from semgrid_edu.crf import CrfParams, gram_matrix, mean_field_naive, unary_from_probability
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.workshop.commands.main import run
from semgrid_edu.workshop.studies.crf import crf_error as study
from semgrid_edu.workshop.studies.crf.crf_error import CROP, N_CROPS, CrfProblem, crops
from semgrid_edu.workshop.studies.crf.other_ways import LowRankGaussian, mean_field_low_rank


def problem(seed=0, shape=(6, 7)):
    rng = np.random.default_rng(seed)
    unary = unary_from_probability(softmax(rng.normal(size=(3, *shape)), axis=0))
    return CrfProblem(unary, np.moveaxis(rng.dirichlet(np.ones(4), shape), -1, 0), CrfParams(sigma_alpha=2))


@pytest.fixture(scope="module", autouse=True)
def tiny():
    """Two tiny grids in place of those of the shipped drive."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "crf_scenes", lambda seed: {"tiny": [problem(0), problem(1)]})
        yield


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    log = tmp_path_factory.mktemp("error") / "error.json"
    found = study.crf_error(log)
    return log, json.loads(json.dumps(found))


def test_the_reference_has_no_kernel_error_and_every_way_converges(result):
    scene = result[1]["scenes"]["tiny"]
    assert scene["reference"] == "naive"
    assert max(one["max"] for one in scene["ways"]["naive"]["kernel"]) == 0
    for way, found in scene["ways"].items():
        assert found["convergence"][-1]["max"] < 1e-3
        assert all(len(found[error]) == len(study.ITERATIONS) for error in (*study.ERRORS, "seconds"))
        if way in ("all pairs", "rank 64"):  # 64 landmarks are all of the 42 cells
            assert max(one["max"] for one in found["kernel"]) < 1e-4


def test_the_errors_are_those_of_the_definition(result):
    found, n = result[1]["scenes"]["tiny"]["ways"]["naive"], 3
    k, variations = study.ITERATIONS.index(n), []
    for seed in (0, 1):
        few, many = (mean_field_naive(*problem(seed), iterations) for iterations in (n, 1000))
        variations.append(np.abs(few - many).sum(axis=0) / 2)
    assert found["total"][k]["mean"] == pytest.approx(np.mean(variations), rel=1e-2)
    assert found["total"][k]["max"] == pytest.approx(np.max(variations), rel=1e-2)
    assert found["total"] == found["convergence"]


def test_distance_by_hand():
    one, other = np.array([[[0.8, 0.5]], [[0.2, 0.5]]]), np.array([[[0.4, 0.5]], [[0.6, 0.5]]])
    assert study.distance(one, other) == pytest.approx({"mean": 0.2, "max": 0.4, "labels": 0.5})


def test_a_scene_that_is_done_is_not_measured_again(result, monkeypatch):
    log, before = result
    monkeypatch.setattr(study, "measure_scene", lambda *_: pytest.fail("measured again"))
    assert study.crf_error(log)["scenes"] == before["scenes"]
    with pytest.raises(DataError, match="choose another file"):
        study.crf_error(log, seed=1)
    with pytest.raises(ArgumentError, match="seed"):
        study.crf_error(log, seed=-1)


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


def test_crops_lie_one_ahead_of_the_other_in_the_middle():
    row, column = np.indices((CROP * N_CROPS + 5, CROP + 10))
    found = crops(CrfProblem(np.stack([row, column]), np.stack([row] * 4), CrfParams()))
    assert len(found) == N_CROPS
    for k, crop in enumerate(found):
        assert crop.unary.shape[1:] == crop.values.shape[1:] == (CROP, CROP)
        assert crop.unary[0, -1, 0] == CROP * N_CROPS + 4 - k * CROP
        assert crop.unary[1, 0, 0] == 5


def test_the_figure_has_a_line_for_each_way_in_each_panel(result):
    figure = error_against_time(result[1], "tiny")
    assert [len(ax.get_lines()) for ax in figure.axes] == [len(study.crf_ways())] * 3
    line = figure.axes[0].get_lines()[0]
    np.testing.assert_allclose(line.get_xdata(), result[1]["scenes"]["tiny"]["ways"]["naive"]["seconds"])
    plt.close("all")


def test_the_command_writes_the_result_and_prints_its_tables(tmp_path, monkeypatch, capsys, result):
    monkeypatch.setattr(study, "crf_error", lambda log, seed: result[1])
    monkeypatch.setattr("sys.argv", ["semgrid-edu", "reproduce", "crf-error", "--out", str(tmp_path / "e.json")])
    with pytest.raises(SystemExit, match="0"):
        run()
    assert json.loads((tmp_path / "e.json").read_text()) == result[1]
    assert "tiny, 6 x 7 cells, 10 updates, against naive" in capsys.readouterr().out
