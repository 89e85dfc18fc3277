import pytest
import torch
from sklearn.metrics import accuracy_score
from tiny_drive import write_tiny_dataset

from semgrid_edu.datasets import training_cache
from semgrid_edu.labels import IGNORE
from semgrid_edu.networks import IMAGE_STAGE, WEIGHTS, load_net
from semgrid_edu.training import CHECKPOINT, TrainingParams
from semgrid_edu.workshop.studies.training import two_stage

QUICK = TrainingParams(image_iterations=1, grid_iterations=1, batch_size=2)


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    root = write_tiny_dataset(tmp_path_factory.mktemp("tiny"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training_cache, "WORKERS", 1)  # three drives of three frames aren't worth a process
        return root, two_stage.compare_training(root, root / "runs", 1, QUICK)


def test_both_start_from_the_same_image_network_and_one_keeps_it(compared):
    root, result = compared
    assert len(set(result["image stages"].values())) == 1
    assert len(set(result["weights"].values())) == 2
    camera = two_stage.TrainingSet(root, "test").camera
    stage, apart, together = (
        load_net(root / "runs" / name, camera).segmenter.state_dict()
        for name in (
            f"two-stage-0/{IMAGE_STAGE}",
            f"two-stage-0/{WEIGHTS}",
            f"end-to-end-0/{WEIGHTS}",
        )
    )
    assert all(stage[name].equal(apart[name]) for name in stage)
    assert not any(stage[name].equal(together[name]) for name in stage if name.endswith("weight"))


def test_what_has_ended_is_not_trained_again(compared, monkeypatch):
    root, result = compared

    def fail(*_):
        raise AssertionError("trained again")

    monkeypatch.setattr(two_stage, "train_network", fail)
    assert two_stage.compare_training(root, root / "runs", 1, QUICK)["scores"] == result["scores"]


def test_what_was_interrupted_goes_on(compared, monkeypatch):
    root, _ = compared
    resumed = {}
    for folder in ("end-to-end-0", "two-stage-0"):
        (root / "runs" / folder / WEIGHTS).rename(root / folder)
    (root / "runs" / "two-stage-0" / CHECKPOINT).touch()

    def ended(_data, folder, _segmenter, params, _seed, resume):
        resumed[folder.name] = params.end_to_end, resume
        (root / folder.name).rename(folder / WEIGHTS)
        (folder / CHECKPOINT).unlink(missing_ok=True)

    monkeypatch.setattr(two_stage, "train_network", ended)
    two_stage.compare_training(root, root / "runs", 1, QUICK)
    assert resumed == {"end-to-end-0": (True, True), "two-stage-0": (False, True)}


def test_scores_are_those_of_the_grid_and_of_the_image(compared):
    root, result = compared
    sample, camera = two_stage.TrainingSet(root, "test")[0], two_stage.TrainingSet(root, "test").camera
    for method in two_stage.METHODS:
        net = load_net(root / "runs" / f"{method}-0" / WEIGHTS, camera)
        with torch.no_grad():
            stages = net.stages(sample.image[None] / 255, sample.occupancy[None])
        for name, scores, truth in (("grid", stages.logits, sample.truth), ("image", stages.scores, sample.labels)):
            labelled = truth != IGNORE
            accuracy = accuracy_score(truth[labelled], scores[0].argmax(0)[labelled])
            assert result["scores"][method][0][name]["all"]["pixel accuracy"] == pytest.approx(accuracy)


def test_the_table_gives_mean_and_range_in_per_cent():
    def run(accuracy):
        metrics = dict.fromkeys(two_stage.METRICS, accuracy)
        return {"grid": {"all": metrics, "semantic": metrics}, "image": {"all": metrics}}

    lines = two_stage.two_stage_table({"end-to-end": [run(0.5), run(0.7)]}).splitlines()
    assert len(lines) == 5
    assert all(line.count("60.0 (50.0-70.0)") == 3 for line in lines[2:])
