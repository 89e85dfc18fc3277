import json
from dataclasses import asdict, replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from tiny_streets import CAMERA
from typer.testing import CliRunner

from semgrid_edu.datasets.label_policies import POLICIES, LidarTruth
from semgrid_edu.datasets.samples import sample_frames
from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import KITTI_14, SYNTHIA_10
from semgrid_edu.networks import Architecture, build_net, load_net, save_net
from semgrid_edu.networks.fcn import Fcn
from semgrid_edu.storage.files import sha256, write_text
from semgrid_edu.storage.provenance import provenance_problems
from semgrid_edu.training.log import LOG, Step, append_step, begin_log
from semgrid_edu.workshop import training_run as experiment
from semgrid_edu.workshop.commands import main
from semgrid_edu.workshop.commands.main import app
from semgrid_edu.workshop.flaws import TruthFlaws


class _Frames(list):
    """The six shipped frames, in the place of a data set on disk."""

    label_set = KITTI_14
    camera = CAMERA.resized(Architecture().image_size)

    def __init__(self, dataset_dir, split, spec, image_size, truth):
        assert split == "train"
        super().__init__(sample_frames())
        self.truth = truth
        self.gaps_filled = False

    def with_gaps_filled(self):
        self.gaps_filled = True
        return self


@pytest.fixture(autouse=True)
def in_the_place_of_a_data_set(monkeypatch):
    """Frames of which no doubt can be told."""
    monkeypatch.setattr(experiment.TrainingSet, "by_camera", lambda *args, **named: [_Frames(*args, **named)])
    monkeypatch.setattr(main, "dataset_doubts", lambda *_: [])


@pytest.fixture
def data(tmp_path):
    frames = [{"date": "2026_01_01", "drive": f"{k:04d}", "frame": 0} for k in range(6)]
    index = {"name": "tiny", "label_set": "KITTI-14", "splits": {"train": frames}}
    write_text(tmp_path / "minikitti" / "dataset.json", json.dumps(index))
    return tmp_path / "minikitti"


def test_gaps_need_unknown_classes_which_is_said_before_the_arrays_are_made(data):
    index = json.loads((data / "dataset.json").read_text())
    write_text(data / "dataset.json", json.dumps(index | {"label_set": "SYNTHIA-10"}))
    command = ["train", "--data", str(data), "--out", str(data.parent / "out"), "--fill-gaps"]
    with pytest.raises(ArgumentError, match=r"^fill_gaps: expected the classes of KITTI-14, found SYNTHIA-10"):
        CliRunner().invoke(app, command, catch_exceptions=False)


def trained(data, *options):
    """Train by the command; return its provenance."""
    out = data.parent / "out"
    command = ["train", "--data", str(data), "--out", str(out), *map(str, options)]
    result = CliRunner().invoke(app, command, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads((out / "provenance.json").read_text())


class _Net:
    segmenter = object()


def test_the_command_leaves_weights_log_and_provenance(data):
    provenance, out = trained(data, "--segmenter", "fcn", "--seed", 3, "--iterations", 1), data.parent / "out"
    names = {"weights.safetensors", "image_stage.safetensors", "log.csv", "provenance.json"}
    assert {path.name for path in out.iterdir()} == names
    assert not provenance_problems(out)
    options = "--data minikitti --out out --segmenter fcn --seed 3 --iterations 1"
    assert provenance["command"] == f"semgrid-edu train {options}"
    assert provenance["seed"] == 3
    assert provenance["params"]["batch_size"] == 6
    assert provenance["dataset"] == sha256(data / "dataset.json")
    assert "truth" not in provenance
    assert len((out / "log.csv").read_text().splitlines()) == 3
    assert isinstance(load_net(out / "weights.safetensors", _Frames.camera).segmenter, Fcn)


def test_a_network_gets_the_classes_of_its_data(monkeypatch, data):
    """minisynthia has ten classes and no unknown ones; networks have KITTI-14 by default."""
    built = {}
    monkeypatch.setattr(_Frames, "label_set", SYNTHIA_10)
    monkeypatch.setattr(experiment, "build_net", lambda description, *_: built.update(net=description) or _Net)
    monkeypatch.setattr(experiment, "train", lambda *_: None)
    trained(data, "--iterations", 1)
    assert built["net"].label_set == SYNTHIA_10.name


def test_a_paper_preset_is_the_papers():
    """Section 4.1: KITTI's images, 31 m x 71 m in 0.2 m cells, 20 planes, batch 6, rate 1e-3, momentum 0.9."""
    description = experiment.architecture("deeplab", "paper")
    assert (description.image_size, description.grid.shape, len(description.heights)) == ((375, 1242), (355, 155), 20)
    params = experiment.training_params("paper", 2000, from_imagenet=True)
    assert (params.batch_size, params.learning_rate, params.momentum) == (6, 1e-3, 0.9)
    assert (params.image_iterations, params.grid_iterations, params.weight_limit) == (0, 2000, np.inf)
    assert experiment.training_params("paper", 5).image_iterations == 5
    assert experiment.training_params("paper", 5, end_to_end=False, from_imagenet=True).image_iterations == 5


@pytest.mark.parametrize("truth", ["lidar", "camera-mask"])
def test_the_options_reach_the_training(monkeypatch, data, truth):
    """The paper's networks don't fit a test: what trains them is looked at instead."""
    given = {}
    monkeypatch.setattr(experiment, "build_net", lambda description, *_: given.update(net=description) or _Net)
    monkeypatch.setattr(experiment, "load_imagenet", lambda segmenter, path: given.update(imagenet=(segmenter, path)))
    monkeypatch.setattr(experiment, "train", lambda *args: given.update(train=args))
    imagenet = data.parent / "vgg16.safetensors"
    write_text(imagenet, "{}")
    options = ["--preset", "paper", "--imagenet", imagenet, "--seed", 2, "--iterations", 7, "--two-stage"]
    options += ["--truth", truth, "--resume", "--return-heights", "--image-size", "192x640", "--fill-gaps"]
    provenance = trained(data, *options, "--device", "cpu")
    usual = experiment.architecture("segnet", "paper")
    assert given["net"] == replace(usual, uses_return_heights=True, image_size=(192, 640))
    assert given["imagenet"] == (_Net.segmenter, str(imagenet))
    net, dataset, folder, params, seed, resume, fabric = given["train"]
    assert dataset.truth == LidarTruth(POLICIES[truth], TruthFlaws())
    assert dataset.gaps_filled
    assert (net, folder, seed, resume, fabric.device) == (_Net, data.parent / "out", 2, True, torch.device("cpu"))
    assert params == experiment.training_params("paper", 7, end_to_end=False, from_imagenet=True)
    written = "--segmenter segnet --preset paper --return-heights --image-size 192x640 --imagenet vgg16.safetensors"
    written += f" --seed 2 --iterations 7 --two-stage --truth {truth} --fill-gaps"
    assert provenance["command"] == f"semgrid-edu train --data minikitti --out out {written}"
    assert provenance["resumed"] is False  # there was nothing to resume
    assert provenance["truth"] == asdict(dataset.truth)
    assert provenance["params"]["weight_limit"] == "inf"
    assert provenance["imagenet"] == sha256(imagenet)


@pytest.mark.parametrize("members", [1, 2])
def test_a_network_starts_from_another_and_says_so(monkeypatch, data, tmp_path, members):
    first = tmp_path / "first.safetensors"
    save_net(start := build_net(Architecture(n_segmenters=members), _Frames.camera, seed=5), first)
    monkeypatch.setattr(experiment, "train", lambda net, *_: built.update(net.state_dict()))
    built = {}
    provenance = trained(data, "--data", data, "--from", first)
    assert all(torch.equal(tensor, built[name]) for name, tensor in start.state_dict().items())
    said = f"--data minikitti --data minikitti --out out --segmenter segnet --from {tmp_path.name}/first.safetensors"
    assert said in provenance["command"]
    assert provenance["from"] == [sha256(first)]
    assert provenance["dataset"] == 2 * [sha256(data / "dataset.json")]


def test_the_mean_of_several_networks_starts_from_them_and_only_its_fusion_learns(monkeypatch, data, tmp_path):
    files = [tmp_path / f"{seed}.safetensors" for seed in (5, 6)]
    starts = [build_net(Architecture(), _Frames.camera, seed=seed).eval() for seed in (5, 6)]
    for start, file in zip(starts, files, strict=True):
        save_net(start, file)
    given = {}
    monkeypatch.setattr(experiment, "train", lambda net, *others: given.update(net=net.eval(), params=others[2]))
    options = ["--from", files[0], "--from", files[1]]
    with pytest.raises(ArgumentError, match=r"--from: expected one network, or --two-stage .* 2 networks without"):
        trained(data, *options)
    with pytest.raises(ArgumentError, match=r"--from: expected at most 9 image networks together, found 10 files"):
        trained(data, *5 * options, "--two-stage")
    provenance = trained(data, *options, "--two-stage")
    image = torch.rand(1, 3, *Architecture().image_size)
    with torch.no_grad():
        mean = (starts[0].segmenter(image) + starts[1].segmenter(image)) / 2
        torch.testing.assert_close(given["net"].segmenter(image), mean)
    learned = given["net"].fusion.state_dict()
    assert all(torch.equal(tensor, learned[name]) for name, tensor in starts[0].fusion.state_dict().items())
    assert (given["params"].image_iterations, given["params"].end_to_end) == (0, False)
    assert "".join(f" --from {tmp_path.name}/{file.name}" for file in files) in provenance["command"]
    assert provenance["from"] == [sha256(file) for file in files]


def test_a_network_starts_from_one_kind_of_weights(tmp_path):
    params = experiment.training_params("compact", iterations=1)
    with pytest.raises(ArgumentError, match="--from: expected no network beside the ImageNet weights"):
        experiment.train_network(tmp_path, tmp_path, "segnet", params, imagenet=tmp_path / "a", start=tmp_path / "b")


def test_curves_of_several_runs_are_in_one_picture(tmp_path):
    for run in ("a/run", "b/run", "c"):
        begin_log(tmp_path / run / LOG, 0)
        append_step(tmp_path / run / LOG, Step(0, "image", 0.1, 3.0))
    for runs in (["a/run"], ["a/run", "c"], ["a/run", "b/run"]):
        out = tmp_path / f"{len(runs)}.png"
        result = CliRunner().invoke(app, ["curves", *(str(tmp_path / run) for run in runs), "--out", str(out)])
        assert result.exit_code == 0, result.output
        assert plt.imread(out).shape == (600, 1200, 4)
    plt.close("all")
