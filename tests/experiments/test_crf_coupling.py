"""Exact inference by visiting every labelling, and what is compared with it."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pytest
from worlds.lecture_10_crf import all_free, coupled, two_classes
from worlds.lecture_11_charts import coupling_errors

from semgrid_edu.crf import crf_model, exact_marginals, mean_field_naive, most_likely
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.graphical import sum_product
from semgrid_edu.workshop.commands.main import run
from semgrid_edu.workshop.studies.crf import crf_coupling as study
from semgrid_edu.workshop.studies.crf.other_ways import potts_messages, visit_labellings

QUICK = {"GRIDS": [(1, 2), (2, 2)], "CLASSES": [2], "COUPLINGS": [0.0, 2.0]}


@pytest.fixture(scope="module", autouse=True)
def quick():
    """Tiny grids, two classes, two couplings."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in QUICK.items():
            patch.setattr(study, name, value)
        yield


@pytest.mark.parametrize("shape", [(2, 1, 1), (3, 1, 2), (2, 3, 3), (3, 2, 3), (4, 2, 2), (1, 2, 2)])
def test_every_labelling_says_what_elimination_says(shape):
    crf = *study.random_crf(shape, 0), coupled(3.0)
    marginals, labels = visit_labellings(*crf)
    np.testing.assert_allclose(marginals, exact_marginals(*crf), atol=1e-12)
    np.testing.assert_array_equal(labels, most_likely(*crf))


@pytest.mark.parametrize(
    ("shape", "coupling"), [((2, 2, 2), 0.0), ((3, 2, 2), 1.0), ((2, 2, 3), 1.0), ((3, 1, 2), 4.0)]
)
def test_messages_from_cell_to_cell_are_those_through_factors(shape, coupling):
    crf = *study.random_crf(shape, 1), coupled(coupling)
    model = crf_model(*crf)
    beliefs = sum_product(model, iterations=200, damping=0.5).marginals
    found = np.stack([beliefs[name] for name in model.names], axis=1).reshape(shape)
    np.testing.assert_allclose(potts_messages(*crf, best=False), found, atol=1e-6)


def test_too_many_labellings_and_impossible_classes_are_refused():
    with pytest.raises(ArgumentError, match="labellings"):
        visit_labellings(np.zeros((2, 5, 6)), all_free((5, 6)), coupled(1.0))
    with pytest.raises(ArgumentError, match="finite"):
        visit_labellings(np.array([[[0.0]], [[np.inf]]]), all_free((1, 1)), coupled(1.0))


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    log = tmp_path_factory.mktemp("coupling") / "coupling.json"
    found = study.crf_coupling(log, draws=2)
    log.write_text(json.dumps(found))
    return log, json.loads(log.read_text())


def test_without_pairs_nobody_errs_and_two_cells_are_a_tree(result):
    for name, case in result[1]["cases"].items():
        for part in case.values():
            assert all(np.shape(errors) == (2, 2) for errors in part.values())
            assert max(np.max(errors[0]) for errors in part.values()) < 1e-5
        tree = max(case["variation"]["loopy sum-product"][1])
        assert tree < 1e-6 if name.startswith("1 x 2") else tree > 1e-6
        assert max(case["labels"]["loopy max-product"][1]) == 0 or not name.startswith("1 x 2")


def test_errors_are_total_variations_and_labels_those_of_the_best_labelling():
    found = study.measure_coupling((2, 2, 2), [4.0], 1, seed=7)
    crf = *study.random_crf((2, 2, 2), 7), coupled(4.0)
    Q, exact = mean_field_naive(*crf), exact_marginals(*crf)
    assert found["variation"]["mean field, 10 updates"][0][0] == pytest.approx(np.abs(Q - exact)[0].mean())
    differ = (Q.argmax(axis=0) != most_likely(*crf)).mean()
    assert found["labels"]["mean field, 10 updates"][0][0] == pytest.approx(differ)


def test_what_is_done_is_not_measured_again_and_another_log_is_refused(result, monkeypatch):
    log, before = result
    monkeypatch.setattr(study, "measure_coupling", lambda *_: pytest.fail("measured again"))
    assert study.crf_coupling(log, draws=2)["cases"] == before["cases"]
    with pytest.raises(DataError, match="choose another file"):
        study.crf_coupling(log, seed=1, draws=2)
    log.with_name("other.json").write_text("[]")
    with pytest.raises(DataError, match=r"other\.json: expected a JSON object"):
        study.crf_coupling(log.with_name("other.json"), draws=2)


def test_mean_field_picks_a_side_where_the_exact_marginal_stays_undecided():
    for p, sure in ((0.501, 0.99), (0.499, 0.01)):
        for coupling, side in ((0.5, 0.5), (4.0, sure)):
            crf = two_classes(np.full((3, 3), p)), all_free((3, 3)), coupled(coupling)
            assert visit_labellings(*crf)[0][0, 1, 1] == pytest.approx(0.5, abs=0.01)
            assert study.WAYS["mean field, converged"](*crf)[0, 1, 1] == pytest.approx(side, abs=0.01)
    undecided, _ = visit_labellings(two_classes(np.full((3, 3), 0.5)), all_free((3, 3)), coupled(4.0))
    np.testing.assert_allclose(undecided, 0.5, atol=1e-12)


def test_the_figures_show_each_way_once_per_size(result):
    figure = coupling_errors(result[1])
    above, below = (figure.axes[row * 2] for row in (0, 1))
    assert [len(ax.get_lines()) for ax in (above, below)] == [4, 6]
    assert len(figure.axes) == 4
    plt.close("all")


def test_the_command_writes_the_result_and_prints_its_tables(tmp_path, monkeypatch, capsys, result):
    monkeypatch.setattr(study, "crf_coupling", lambda log, seed, draws: result[1])
    monkeypatch.setattr("sys.argv", ["semgrid-edu", "reproduce", "crf-coupling", "--out", str(tmp_path / "c.json")])
    with pytest.raises(SystemExit, match="0"):
        run()
    assert json.loads((tmp_path / "c.json").read_text()) == result[1]
    assert "2 x 2 cells, 2 classes, mean total variation, per cent" in capsys.readouterr().out


@pytest.mark.parametrize("bad", [{"seed": -1}, {"draws": 0}])
def test_nothing_to_do_is_refused_by_name(bad, tmp_path):
    with pytest.raises(ArgumentError, match=next(iter(bad))):
        study.crf_coupling(tmp_path / "log.json", **bad)
