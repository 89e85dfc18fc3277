import json
from dataclasses import asdict, replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.label_policies import POLICIES, LidarTruth
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.labels import KITTI_14, SYNTHIA_10
from semgrid_edu.networks import SEGMENTERS, Architecture, build_net, load_net, save_net
from semgrid_edu.networks.fcn import Fcn
from semgrid_edu.storage.files import sha256, write_text
from semgrid_edu.storage.provenance import provenance_problems
from semgrid_edu.training.log import LOG, Step, append_step, begin_log
from semgrid_edu.workshop import training_run as experiment
from semgrid_edu.workshop.commands import main
from semgrid_edu.workshop.commands.main import app
from semgrid_edu.workshop.flaws import TruthFlaws


class _Noise:
    """Six frames of noise, in the place of a data set on disk."""

    label_set = KITTI_14
    camera = Camera(
        np.array([[186, 0, 157], [0, 184, 44], [0, 0, 1.0]]),
        np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]]),
        Architecture().image_size,
    )

    def __init__(self, dataset_dir, split, spec, image_size, truth):
        assert split == "train"
        self.truth = truth
        self.gaps_filled = False
        self.rng = torch.Generator().manual_seed(0)

    def with_gaps_filled(self):
        self.gaps_filled = True
        return self

    def __len__(self):
        return 6

    def __getitem__(self, k):
        if k >= len(self):
            raise IndexError(k)
        size, shape = Architecture().image_size, Architecture().grid.shape
        image, labels = (
            torch.randint(high, (*channels, *size), generator=self.rng) for high, channels in ((256, (3,)), (10, ()))
        )
        occupancy = torch.rand(4, *shape, generator=self.rng).softmax(0)
        truth = torch.randint(14, shape, generator=self.rng)
        return Sample(image.to(torch.uint8), labels.to(torch.uint8), occupancy, truth.to(torch.uint8))


def one_camera(*arguments, **named):
    return [_Noise(*arguments, **named)]


@pytest.fixture(autouse=True)
def data_without_doubts(monkeypatch):
    """The data set isn't on disk, so nothing can be asked of it."""
    monkeypatch.setattr(main, "dataset_doubts", lambda *_: [])


class _Net:
    segmenter = object()


def test_the_command_leaves_weights_log_and_provenance(monkeypatch, tmp_path):
    monkeypatch.setattr(experiment.TrainingSet, "by_camera", one_camera)
    data, out = tmp_path / "minikitti", tmp_path / "compact"
    write_text(data / "dataset.json", "{}")
    options = ["--segmenter", "fcn", "--seed", "3", "--iterations", "1"]
    result = CliRunner().invoke(app, ["train", "--data", str(data), "--out", str(out), *options])
    assert result.exit_code == 0, result.output
    names = {"weights.safetensors", "image_stage.safetensors", "log.csv", "provenance.json"}
    assert {path.name for path in out.iterdir()} == names
    assert not provenance_problems(out)
    provenance = json.loads((out / "provenance.json").read_text())
    options = "--data minikitti --out compact --segmenter fcn --seed 3 --iterations 1"
    assert provenance["command"] == f"semgrid-edu train {options}"
    assert provenance["seed"] == 3
    assert provenance["params"]["batch_size"] == 6
    assert provenance["dataset"] == sha256(data / "dataset.json")
    assert "truth" not in provenance
    assert len((out / "log.csv").read_text().splitlines()) == 3
    assert isinstance(load_net(out / "weights.safetensors", _Noise.camera).segmenter, Fcn)


def test_a_network_gets_the_classes_of_its_data(monkeypatch, tmp_path):
    """minisynthia has ten classes and no unknown ones; networks have KITTI-14 by default."""
    built = {}
    monkeypatch.setattr(_Noise, "label_set", SYNTHIA_10)
    monkeypatch.setattr(experiment.TrainingSet, "by_camera", one_camera)
    monkeypatch.setattr(experiment, "build_net", lambda description, *_: built.update(net=description) or _Net)
    monkeypatch.setattr(experiment, "train", lambda *_: None)
    write_text(tmp_path / "minisynthia" / "dataset.json", "{}")
    params = experiment.training_params("compact", 1)
    experiment.train_network(tmp_path / "minisynthia", tmp_path / "out", "segnet", params)
    assert built["net"].label_set == SYNTHIA_10.name


@pytest.mark.parametrize("option", ["--seed=-1", "--iterations=0"])
def test_numbers_that_cannot_be_are_refused(tmp_path, option):
    result = CliRunner().invoke(app, ["train", "--data", str(tmp_path), "--out", str(tmp_path / "out"), option])
    assert result.exit_code == 2
    assert f"Invalid value for '{option.split('=')[0]}'" in result.output
    assert not (tmp_path / "out").exists()


def test_the_command_names_what_is_missing(tmp_path):
    arguments = ["train", "--data", str(tmp_path / "nowhere"), "--out", str(tmp_path / "out")]
    with pytest.raises(ValueError, match=r"nowhere.dataset.json"):
        CliRunner().invoke(app, arguments, catch_exceptions=False)


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
def test_the_options_reach_the_training(monkeypatch, tmp_path, truth):
    """The paper's networks don't fit a test: what trains them is looked at instead."""
    given = {}
    monkeypatch.setattr(experiment.TrainingSet, "by_camera", one_camera)
    monkeypatch.setattr(experiment, "build_net", lambda description, *_: given.update(net=description) or _Net)
    monkeypatch.setattr(experiment, "load_imagenet", lambda segmenter, path: given.update(imagenet=(segmenter, path)))
    monkeypatch.setattr(experiment, "train", lambda *args: given.update(train=args))
    data, imagenet, out = tmp_path / "minikitti", tmp_path / "vgg16.safetensors", tmp_path / "out"
    write_text(data / "dataset.json", "{}")
    write_text(imagenet, "{}")
    options = ["--preset", "paper", "--imagenet", str(imagenet), "--seed", "2", "--iterations", "7", "--two-stage"]
    options += ["--truth", truth, "--resume", "--return-heights", "--image-size", "192x640", "--fill-gaps"]
    result = CliRunner().invoke(app, ["train", "--data", str(data), "--out", str(out), *options, "--device", "cpu"])
    assert result.exit_code == 0, result.output
    usual = experiment.architecture("segnet", "paper")
    assert given["net"] == replace(usual, uses_return_heights=True, image_size=(192, 640))
    assert given["imagenet"] == (_Net.segmenter, str(imagenet))
    net, dataset, folder, params, seed, resume, fabric = given["train"]
    assert dataset.truth == LidarTruth(POLICIES[truth], TruthFlaws())
    assert dataset.gaps_filled
    assert (net, folder, seed, resume, fabric.device) == (_Net, out, 2, True, torch.device("cpu"))
    assert params == experiment.training_params("paper", 7, end_to_end=False, from_imagenet=True)
    provenance = json.loads((out / "provenance.json").read_text())
    written = "--segmenter segnet --preset paper --return-heights --image-size 192x640 --imagenet vgg16.safetensors"
    written += f" --seed 2 --iterations 7 --two-stage --truth {truth} --fill-gaps"
    assert provenance["command"] == f"semgrid-edu train --data minikitti --out out {written}"
    assert provenance["resumed"] is False  # there was nothing to resume
    assert provenance["truth"] == asdict(dataset.truth)
    assert provenance["params"]["weight_limit"] == "inf"
    assert provenance["imagenet"] == sha256(imagenet)


@pytest.mark.parametrize("members", [1, 2])
def test_a_network_starts_from_another_and_says_so(monkeypatch, tmp_path, members):
    monkeypatch.setattr(experiment.TrainingSet, "by_camera", one_camera)
    data, first = tmp_path / "minikitti", tmp_path / "first.safetensors"
    write_text(data / "dataset.json", "{}")
    save_net(start := build_net(Architecture(n_segmenters=members), _Noise.camera, seed=5), first)
    monkeypatch.setattr(experiment, "train", lambda net, *_: built.update(net.state_dict()))
    built = {}
    options = ["--data", str(data), "--data", str(data), "--from", str(first), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, ["train", *options])
    assert result.exit_code == 0, result.output
    assert all(torch.equal(tensor, built[name]) for name, tensor in start.state_dict().items())
    provenance = json.loads((tmp_path / "out" / "provenance.json").read_text())
    said = f"--data minikitti --data minikitti --out out --segmenter segnet --from {tmp_path.name}/first.safetensors"
    assert said in provenance["command"]
    assert provenance["from"] == [sha256(first)]
    assert provenance["dataset"] == 2 * [sha256(data / "dataset.json")]


def test_the_mean_of_several_networks_starts_from_them_and_only_its_fusion_learns(monkeypatch, tmp_path):
    monkeypatch.setattr(experiment.TrainingSet, "by_camera", one_camera)
    data, files = tmp_path / "minikitti", [tmp_path / f"{seed}.safetensors" for seed in (5, 6)]
    write_text(data / "dataset.json", "{}")
    starts = [build_net(Architecture(), _Noise.camera, seed=seed).eval() for seed in (5, 6)]
    for start, file in zip(starts, files, strict=True):
        save_net(start, file)
    given = {}
    monkeypatch.setattr(experiment, "train", lambda net, *others: given.update(net=net.eval(), params=others[2]))
    options = ["--data", str(data), "--from", str(files[0]), "--from", str(files[1]), "--out", str(tmp_path / "out")]
    with pytest.raises(
        ArgumentError, match=r"--from: expected one network, or --two-stage .* found 2 networks without"
    ):
        CliRunner().invoke(app, ["train", *options], catch_exceptions=False)
    with pytest.raises(ArgumentError, match=r"--from: expected at most 9 image networks together, found 10 files"):
        CliRunner().invoke(
            app, ["train", *options, *8 * ["--from", str(files[0])], "--two-stage"], catch_exceptions=False
        )
    result = CliRunner().invoke(app, ["train", *options, "--two-stage"])
    assert result.exit_code == 0, result.output
    image = torch.rand(1, 3, *Architecture().image_size)
    with torch.no_grad():
        mean = (starts[0].segmenter(image) + starts[1].segmenter(image)) / 2
        torch.testing.assert_close(given["net"].segmenter(image), mean)
    learned = given["net"].fusion.state_dict()
    assert all(torch.equal(tensor, learned[name]) for name, tensor in starts[0].fusion.state_dict().items())
    assert (given["params"].image_iterations, given["params"].end_to_end) == (0, False)
    provenance = json.loads((tmp_path / "out" / "provenance.json").read_text())
    assert "".join(f" --from {tmp_path.name}/{file.name}" for file in files) in provenance["command"]
    assert provenance["from"] == [sha256(file) for file in files]


def test_a_network_of_another_kind_is_no_start(monkeypatch, tmp_path):
    monkeypatch.setattr(experiment.TrainingSet, "by_camera", one_camera)
    save_net(build_net(Architecture("fcn"), _Noise.camera), tmp_path / "fcn.safetensors")
    options = ["--data", str(tmp_path), "--out", str(tmp_path / "out"), "--from", str(tmp_path / "fcn.safetensors")]
    with pytest.raises(DataError, match=r"fcn.safetensors: expected a network like the one to train"):
        CliRunner().invoke(app, ["train", *options], catch_exceptions=False)


def test_a_network_starts_from_one_kind_of_weights(tmp_path):
    params = experiment.training_params("compact", iterations=1)
    with pytest.raises(ArgumentError, match="--from: expected no network beside the ImageNet weights"):
        experiment.train_network(tmp_path, tmp_path, "segnet", params, imagenet=tmp_path / "a", start=tmp_path / "b")


@pytest.mark.parametrize("name", ["weights.safetensors", "log.csv", "image_stage.safetensors"])
def test_what_would_be_lost_is_refused_before_the_data_are_prepared(monkeypatch, tmp_path, name):
    def prepared(*_, **__):
        raise AssertionError("the data were prepared")

    monkeypatch.setattr(experiment.TrainingSet, "by_camera", prepared)
    write_text(tmp_path / "out" / name, "mine")
    with pytest.raises(DataError, match="which would be lost"):
        experiment.train_network(tmp_path, tmp_path / "out", "segnet", experiment.training_params("compact", 1))


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--device", "cuda:99"], "--device: expected cpu or one of the"),
        (["--truth", "guessed"], "--truth: expected one of true, lidar, no-cleanup"),
        (["--preset", "huge"], "--preset: expected compact or paper, found 'huge'"),
        (["--segmenter", "unknown"], f"name: expected one of {', '.join(SEGMENTERS)}"),
        (["--imagenet", "nowhere.safetensors"], "nowhere.safetensors: expected a safetensors file"),
    ],
)
def test_an_option_that_cannot_be_is_named(monkeypatch, tmp_path, option, message):
    monkeypatch.setattr(experiment.TrainingSet, "by_camera", one_camera)
    with pytest.raises(ValueError, match=message):
        CliRunner().invoke(
            app, ["train", "--data", str(tmp_path), "--out", str(tmp_path / "out"), *option], catch_exceptions=False
        )
    assert not (tmp_path / "out").exists()


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
