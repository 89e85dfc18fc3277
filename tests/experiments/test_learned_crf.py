"""A CRF learnt on tiny data sets, with a network whose weights are random."""

import json
from dataclasses import replace

import numpy as np
import pytest
from test_crf_search import write_validation
from tiny_drive import DATE, write_tiny_dataset
from typer.testing import CliRunner

from semgrid_edu.crf.layer import load_crf
from semgrid_edu.datasets import KittiRawDrive, training_cache
from semgrid_edu.errors import DataError
from semgrid_edu.networks import WEIGHTS, Architecture, build_net, save_net
from semgrid_edu.storage.provenance import provenance_problems
from semgrid_edu.training.crf import CRF_TRAINING
from semgrid_edu.workshop.commands.main import app
from semgrid_edu.workshop.scoring.evaluate import evaluate
from semgrid_edu.workshop.studies.crf import learned_crf

EVERY = learned_crf.VARIANTS
QUICK = replace(CRF_TRAINING, grid_iterations=1)


@pytest.fixture(scope="module", autouse=True)
def quick():
    """Small windows, two ways to learn; the occupancy filter in this process, since workers take seconds to start."""

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training_cache, "WORKERS", 1)
        patch.setattr("semgrid_edu.crf.layer.REACH", 0.5)
        patch.setattr(learned_crf, "VARIANTS", EVERY[:2])
        yield


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A data set with train and test drives, one with validation drives, and a network."""
    folder = tmp_path_factory.mktemp("learn")
    dataset = write_tiny_dataset(folder / "tiny")
    net = build_net(Architecture(), KittiRawDrive(dataset, DATE, "0001").camera)
    save_net(net, folder / "net" / WEIGHTS)
    return dataset, write_validation(folder / "held-out", ["0004", "0005"]), folder / "net" / WEIGHTS


@pytest.fixture(scope="module")
def compared(inputs, tmp_path_factory):
    runs = tmp_path_factory.mktemp("runs")
    return runs, learned_crf.compare_learned_crfs(*inputs, runs, params=QUICK)


def test_each_way_to_learn_has_a_name_and_a_folder_of_its_own():
    assert len({variant.name for variant in EVERY}) == 8
    assert {variant.folder for variant in EVERY} >= {"learnt-weights-balanced-loss-new-drives"}


def test_network_and_default_crf_score_as_in_every_other_table(compared, inputs):
    _, result = compared
    expected = evaluate(inputs[0], inputs[2])["confusion"]
    for method in ("network", "network + CRF"):
        assert result["confusion"][method] == expected[method]
    assert np.sum(result["confusion"]["untrained layer"]) == np.sum(expected["network"])


def test_only_what_learns_changes(compared):
    runs, result = compared
    only_weights, costs_too = (load_crf(runs / variant.folder / WEIGHTS) for variant in EVERY[:2])
    assert only_weights.params().w_bilateral != 4
    assert not costs_too.label_costs.equal(only_weights.label_costs)
    (weights, costs) = result["learnt"].values()
    assert weights["w1"] == pytest.approx(only_weights.params().w_bilateral)
    assert costs["compatibility"] == costs_too.compatibility.tolist()


def test_the_result_can_be_kept_and_names_what_made_it(compared, inputs):
    _, result = compared
    kept = json.loads(json.dumps(result))
    assert {"scores", "gains", "confusion", "learnt", "command", "seed", "versions", "date"} <= kept.keys()
    assert kept["command"].startswith("semgrid-edu reproduce learned-crf --data tiny --validation held-out")
    assert "learnt weights, balanced loss, new drives: w1" in learned_crf.learned_crf_table(result)
    assert str(inputs[0]) not in json.dumps(result)


def test_what_has_ended_is_not_trained_again(compared, inputs, monkeypatch):
    runs, result = compared

    def fail(*_, **__):
        raise AssertionError("trained again")

    monkeypatch.setattr(learned_crf, "train_crf_on", fail)
    assert learned_crf.compare_learned_crfs(*inputs, runs, params=QUICK)["scores"] == result["scores"]


def test_drives_that_the_network_knows_do_not_pass_for_new_ones(inputs, tmp_path):
    dataset, _, weights = inputs
    known = write_validation(tmp_path / "known", ["0001"])
    with pytest.raises(DataError, match="0001 of train"):
        learned_crf.compare_learned_crfs(dataset, known, weights, tmp_path, params=QUICK)


def test_the_command_leaves_weights_log_and_provenance(inputs, tmp_path):
    _, held_out, weights = inputs
    options = [
        "--data",
        str(held_out),
        "--weights",
        str(weights),
        "--out",
        str(tmp_path / "crf"),
        "--weight-limit",
        "1",
    ]
    result = CliRunner().invoke(app, ["train-crf", *options, "--label-costs", "--seed", "2", "--iterations", "1"])
    assert result.exit_code == 0, result.output
    assert not provenance_problems(tmp_path / "crf")
    assert {path.name for path in (tmp_path / "crf").iterdir()} == {WEIGHTS, "log.csv", "provenance.json"}
    provenance = json.loads((tmp_path / "crf" / "provenance.json").read_text())
    assert provenance["command"] == (
        "semgrid-edu train-crf --data held-out --split validation --weights net/weights.safetensors --out crf "
        "--label-costs --weight-limit 1 --seed 2 --iterations 1"
    )
    assert provenance["params"]["weight_limit"] == 1
