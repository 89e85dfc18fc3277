from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict

import numpy as np
import pytest
from tiny_runs import HandMadeData
from worlds.lecture_09_policies import TRIALS

from semgrid_edu.datasets.label_policies import POLICIES, LidarTruth
from semgrid_edu.labels import UNKNOWN_OF_STATE
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.workshop.flaws import TruthFlaws
from semgrid_edu.workshop.paper import truth_costs as costs
from semgrid_edu.workshop.paper.data_runs import ArraysRun, DataRun
from semgrid_edu.workshop.paper.experiments import EXPERIMENTS
from semgrid_edu.workshop.paper.run import execute_plan, with_needs
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import SCALES
from semgrid_edu.workshop.paper.score_runs import LABELS, LabelsRun
from semgrid_edu.workshop.paper.truth_costs import LEARNED_FROM
from semgrid_edu.workshop.scoring.confusions import FrameConfusions
from semgrid_edu.workshop.training_run import chosen_truth
from semgrid_edu.workshop.workplace import Workplace

REDUCED = SCALES["reduced"]
LABORATORY = {
    "lidar": "one scan (our reading)",
    "no-cleanup": "one scan, no clean-up",
    "camera-mask": "one scan, visible to camera",
    "de-skewed": "one scan, de-skewed",
    "accumulated-smeared": "9 scans before, movers smeared",
    "accumulated-carved": "9 scans before, movers carved",
    "accumulated-carried": "9 scans before, movers carried",
}


def test_each_policy_is_one_whose_errors_the_laboratory_measures():
    assert {name: TRIALS[trial].policy for name, trial in LABORATORY.items()} == POLICIES
    assert LEARNED_FROM.keys() == POLICIES.keys() | {"true"}


def test_the_usual_truth_is_the_one_without_a_choice():
    assert repr(chosen_truth("lidar")) == repr(LidarTruth(flaws=TruthFlaws()))  # kept grids are named by it
    assert chosen_truth("true") is None


def test_runs_on_the_usual_and_the_true_labels_keep_their_folders_and_settings():
    """Computations are under way in such folders."""
    arrays = ArraysRun(DataRun("minikitti"), "train", "lidar")
    assert (arrays.name, arrays.settings()) == (
        "arrays-minikitti-train-lidar",
        {"kind": "ArraysRun", "data": {"kind": "DataRun", "data": "minikitti"}, "split": "train", "truth": "lidar"},
    )
    usual, true = (costs.taught_runs(REDUCED, 1)[truth][0].network for truth in ("lidar", "true"))
    assert usual.name == "grid-minikitti-segnet-lidar-500+500-seed0"
    assert true.name == "grid-minikitti-segnet-true-500+500-seed0"
    assert usual.image_stage == true.image_stage


@pytest.mark.parametrize(("scale", "policies", "seeds"), [("quick", 2, 2), ("reduced", 6, 3)])
def test_only_the_second_stage_is_trained_anew(scale, policies, seeds):
    """At quick scale all experiments together must take minutes; at reduced scale a grid stage takes four."""
    plans = {name: with_needs(one.runs(SCALES[scale], seeds)) for name, one in EXPERIMENTS.items()}
    added = set(plans.pop("truth-costs")).difference(*plans.values())
    kinds = [run.name.split("-")[0] for run in added]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "arrays": policies,
        "labels": policies + 2,
        "grid": policies * seeds,
        "score": policies * seeds,
    }


def test_all_networks_are_scored_on_the_same_frames():
    runs = costs.taught_runs(REDUCED, 2)
    assert list(runs) == ["lidar", "true", *REDUCED.policies]
    assert {run.frames for alike in runs.values() for run in alike} == {
        ArraysRun(DataRun("minikitti"), "test", "lidar")
    }
    assert [run.network.image_stage.seed for run in runs["camera-mask"]] == [0, 1]


@pytest.fixture(scope="module")
def counted(tmp_path_factory):
    """Labels of six tiny drives, made in the usual way and without clean-up, and counted."""
    root = tmp_path_factory.mktemp("runs")
    usual, bare = (ArraysRun(HandMadeData(), "train", truth) for truth in ("lidar", "no-cleanup"))
    run, here = LabelsRun(bare, usual), Workplace(ThreadPoolExecutor(1), 1)
    assert execute_plan(with_needs([run]), root, here) == {}
    return root, run


def test_labels_are_counted_against_the_true_and_the_usual_ones(counted):
    root, run = counted
    bare, usual = run.labels.frames(root).arrays, run.usual.frames(root).arrays
    for against, truth in (("true", usual["true"]), ("lidar", usual["truth"])):
        expected = [confusion_matrix(one, other, 14) for one, other in zip(truth, bare["truth"], strict=True)]
        np.testing.assert_array_equal(run.confusions(RunCounts(root), LABELS, against).counts[LABELS], expected)


def test_without_clean_up_fewer_cells_have_a_label(counted):
    root, run = counted
    n_labelled = [
        np.isin(arrays.frames(root).arrays["truth"], UNKNOWN_OF_STATE, invert=True).sum()
        for arrays in (run.labels, run.usual)
    ]
    assert 0 < n_labelled[0] < n_labelled[1]


class Counted:
    """A run on ten drives, in each of which 100 cells of road and 10 of car lie nearby; so many are called right."""

    def __init__(self, road, car):
        self.right = road, car

    def confusions(self, _root, method, _truth, band=None):
        matrices = np.zeros((10, 14, 14), int)
        if band in (None, "0-10 m"):
            for c, cells, right in zip((0, 3), (100, 10), self.right, strict=True):
                matrices[:, c, c], matrices[:, c, 13] = right, cells - right
        return FrameConfusions(tuple("abcdefghij"), {method: matrices})


@pytest.fixture
def result(monkeypatch):
    """Usual networks of two seeds, and others that know roads worse and cars better; labels of which half are right."""
    runs = {truth: [Counted(70, 2), Counted(80, 4)] for truth in ("true", "no-cleanup")}
    runs = {"lidar": [Counted(80, 1), Counted(90, 3)]} | runs
    monkeypatch.setattr(costs, "taught_runs", lambda *_: runs)
    monkeypatch.setattr(costs, "label_runs", lambda _: dict.fromkeys(runs, Counted(50, 5)))
    return costs.truth_costs(REDUCED, 2, None)


def test_costs_computed_by_hand(result):
    usual, _, bare = result["rows"]
    assert bare["policy"] == asdict(POLICIES["no-cleanup"])
    assert bare["labels"]["all"]["pixel accuracy"]["mean"] == pytest.approx(55 / 110)
    assert bare["changed"] == pytest.approx(55 / 110)
    accuracy = bare["differences"]["true"]["all"]["pixel accuracy"]
    assert accuracy["seeds"] == pytest.approx([-9 / 110] * 2)
    assert [accuracy[end] for end in ("low", "high")] == pytest.approx([-9 / 110] * 2)  # drives and seeds agree
    assert bare["classes"]["road"]["difference"]["mean"] == pytest.approx(-0.1)
    assert bare["classes"]["car"]["networks"]["seeds"] == pytest.approx([0.2, 0.4])
    assert bare["classes"]["fence"]["networks"]["mean"] is None
    assert bare["distances"]["0-10 m"]["difference"]["mean"] == pytest.approx(-9 / 110)
    assert usual["differences"]["true"]["all"]["FmIoU"]["mean"] == 0
