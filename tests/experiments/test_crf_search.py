"""The search for the CRF's parameters on two tiny data sets, with a network whose weights are random."""

import json
from itertools import count

import numpy as np
import pytest
from tiny_drive import DATE, write_tiny_dataset, write_tiny_drive

from semgrid_edu.datasets import KittiRawDrive, training_cache
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.metrics import pixel_accuracy
from semgrid_edu.networks import Architecture, build_net, save_net
from semgrid_edu.workshop.scoring.evaluate import evaluate
from semgrid_edu.workshop.scoring.statistics import paired_interval
from semgrid_edu.workshop.studies.crf import crf_search
from semgrid_edu.workshop.studies.crf import search_point as rules
from semgrid_edu.workshop.studies.crf.crf_scores import gains_by_metric, gains_text
from semgrid_edu.workshop.studies.crf.crf_search import objective_values

TRIALS = 6


def write_validation(root, drives):
    """A data set of drives for validation; a drive is the same as that of the same number elsewhere."""
    for drive in drives:
        write_tiny_drive(root, drive)
    splits = {"validation": [{"date": DATE, "drive": drive, "frame": 2} for drive in drives]}
    (root / "dataset.json").write_text(json.dumps({"name": "held-out", "label_set": "KITTI-14", "splits": splits}))
    return root


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Validation drives, a data set with train and test drives, and a network."""
    folder = tmp_path_factory.mktemp("search")
    dataset = write_tiny_dataset(folder / "tiny")
    net = build_net(Architecture(), KittiRawDrive(dataset, DATE, "0001").camera)
    save_net(net, folder / "net" / "weights.safetensors")
    return write_validation(folder / "held-out", ["0004", "0005"]), dataset, folder / "net" / "weights.safetensors"


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Refine after three trials; run the occupancy filter in this process, since workers take seconds to start."""

    monkeypatch.setattr(training_cache, "WORKERS", 1)
    monkeypatch.setattr(rules, "EXPLORED", 3)
    monkeypatch.setattr("semgrid_edu.workshop.studies.crf.crf_search.perf_counter", count().__next__)


@pytest.fixture(scope="module")
def results():
    """What was found already, so that tests can share it."""
    return {}


@pytest.fixture
def found(inputs, results, tmp_path):
    if not results:
        results.update(crf_search.search_crf(*inputs, tmp_path / "whole.json", n_trials=TRIALS))
    return results


def test_each_choice_is_the_best_of_the_trials(found):
    trials, chosen, unrefined = found["trials"], found["chosen"], found["unrefined"]["all"]
    assert len(trials) == TRIALS
    accuracies = [[trial["scores"]["all"][name] for name in ("pixel accuracy", "class accuracy")] for trial in trials]
    for column, name in enumerate(("pixel accuracy", "class accuracy")):
        assert chosen[name]["scores"]["all"][name] == max(row[column] for row in accuracies)
        assert trials[chosen[name]["trial"]]["params"] == chosen[name]["params"]
    kept = [pixel for pixel, by_class in accuracies if by_class >= unrefined["class accuracy"]]
    if kept:
        assert chosen["pixel accuracy, class accuracy kept"]["scores"]["all"]["pixel accuracy"] == max(kept)
    assert {chosen["pixel accuracy"]["trial"], chosen["class accuracy"]["trial"]} & set(found["pareto"])


def test_the_table_says_when_no_trial_kept_class_accuracy(found):
    lossless = {cells: dict.fromkeys(scores, 0.0) for cells, scores in found["unrefined"].items()}
    assert "none of the trials" not in crf_search.search_table(found | {"unrefined": lossless})
    perfect = {cells: dict.fromkeys(scores, 1.0) for cells, scores in found["unrefined"].items()}
    assert crf_search.search_table(found | {"unrefined": perfect}).count("none of the trials kept class accuracy") == 1


def test_network_and_default_crf_score_on_the_test_split_as_in_the_evaluation(found, inputs):
    _, dataset, weights = inputs
    expected = evaluate(dataset, weights)["scores"]
    test = found["test"]["scores"]
    assert test["network"] == expected["network"]
    assert test["CRF"] == expected["network + CRF"]


def test_the_temperature_lowers_the_loss_on_the_validation_split(found):
    assert found["calibration"]["after"]["NLL"] < found["calibration"]["before"]["NLL"]
    assert found["calibration"]["before"]["reliability"]["accuracy"] != [0.0] * 15


def test_the_result_says_what_made_it_and_is_json(found):
    assert found["command"] == (
        "semgrid-edu search-crf --data held-out --test tiny --weights net/weights.safetensors --seed 0 --trials 6"
    )
    assert found["validation"]["name"] == "held-out"
    assert json.loads(json.dumps(found)) == found
    table = crf_search.search_table(found)
    assert f"temperature {found['temperature']:.3f}" in table
    assert table.count("calibrated, CRF for class accuracy") == 2


def test_interrupted_it_goes_on_to_the_same_result(found, inputs, tmp_path, monkeypatch):
    log, whole = tmp_path / "log.json", crf_search.run_trial

    def interrupted_in_the_fourth(*args):
        if log.exists() and len(json.loads(log.read_text())["trials"]) == 3:
            raise KeyboardInterrupt
        return whole(*args)

    with monkeypatch.context() as patch:
        patch.setattr(crf_search, "run_trial", interrupted_in_the_fourth)
        with pytest.raises(KeyboardInterrupt):
            crf_search.search_crf(*inputs, log, n_trials=TRIALS)
    resumed = crf_search.search_crf(*inputs, log, n_trials=TRIALS)
    assert resumed["trials"] == found["trials"]
    assert resumed["test"] == found["test"]
    with pytest.raises(DataError, match=r"log\.json: expected a result of .*choose another file"):
        crf_search.search_crf(*inputs, log, seed=1, n_trials=TRIALS)


def test_a_file_that_holds_something_else_is_not_overwritten(inputs, tmp_path):
    (tmp_path / "notes.json").write_text("{}")
    with pytest.raises(DataError, match="a result of this experiment"):
        crf_search.search_crf(*inputs, tmp_path / "notes.json", n_trials=1)
    assert (tmp_path / "notes.json").read_text() == "{}"


@pytest.mark.parametrize(("drive", "split"), [("0002", "train"), ("0003", "test")])
def test_a_drive_of_training_or_test_is_refused_by_name(inputs, tmp_path, drive, split):
    _, dataset, weights = inputs
    leaking = write_validation(tmp_path / "leaking", ["0004", drive])
    with pytest.raises(DataError, match=rf"drive_{drive}_sync: .*tiny.* found 2026_01_01 {drive} of {split}"):
        crf_search.search_crf(leaking, dataset, weights, tmp_path / "log.json", n_trials=1)


def test_a_data_set_without_validation_drives_is_refused(inputs, tmp_path):
    _, dataset, weights = inputs
    with pytest.raises(ArgumentError, match="split: expected one of train, test, found 'validation'"):
        crf_search.search_crf(dataset, dataset, weights, tmp_path / "log.json", n_trials=1)


def test_a_search_without_trials_is_refused(inputs, tmp_path):
    with pytest.raises(ArgumentError, match="n_trials"):
        crf_search.search_crf(*inputs, tmp_path / "log.json", n_trials=0)


def test_a_loss_of_class_accuracy_is_worth_less_than_any_gain_in_pixels():
    def trial(pixel, by_class):
        return {"scores": {"all": {"pixel accuracy": pixel, "class accuracy": by_class}}}

    trials, unrefined = [trial(0.9, 0.5), trial(0.8, 0.6), trial(0.7, 0.7)], {"all": {"class accuracy": 0.6}}
    expected = [[0.9, 0.5, -0.1], [0.8, 0.6, 0.8], [0.7, 0.7, 0.7]]
    np.testing.assert_allclose(objective_values(trials, unrefined), expected)


def test_gains_over_several_drives_have_intervals():
    right, half = np.diag([10, 0]), np.array([[5, 5], [0, 0]])
    a, b = np.stack([right, half, right] * 4), np.stack([half, half, half] * 4)
    gains = gains_by_metric(a, b)
    assert gains["pixel accuracy"] == list(paired_interval(a[None], b[None], pixel_accuracy))
    assert gains_by_metric(a[:1], b[:1])["pixel accuracy"] == [None, 0.5, None]
    text = gains_text({"CRF": gains, "one": gains_by_metric(a[:1], b[:1])})
    assert "CRF: pixel accuracy +33.33 (+17.69 to +48.98)" in text  # t of 11 degrees of freedom, 2.201, times 7.107
    assert "one: pixel accuracy +50.00, class" in text
