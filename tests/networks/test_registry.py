"""A backbone is one class and one line in the registry: a tiny one does everything that the package's own do."""

from dataclasses import replace
from typing import ClassVar

import pytest
import torch
from safetensors.torch import load_file
from tiny_streets import CAMERA, SMALL, tiny_streets
from torch import nn
from typer.testing import CliRunner

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import SEGMENTERS, build_net, load_imagenet, load_net, save_net
from semgrid_edu.networks.segmenter import Segmenter
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.workshop.commands.main import app


class TwoLayers(Segmenter):
    """Score each pixel by two convolutions."""

    PRESETS: ClassVar = {"compact": {"width": 4}, "paper": {"width": 64}}

    def build(self, n_classes, width):
        self.layers = nn.Sequential(nn.Conv2d(3, width, 3, padding=1), nn.ReLU(), nn.Conv2d(width, n_classes, 1))

    def scores(self, x):
        return self.layers(x)


@pytest.fixture
def tiny(monkeypatch):
    """An architecture with the tiny backbone, which is in the registry for the length of a test."""
    monkeypatch.setitem(SEGMENTERS, "two-layers", TwoLayers)
    return replace(SMALL, segmenter="two-layers")


def test_it_is_built_saved_and_loaded(tiny, tmp_path):
    net = build_net(tiny, CAMERA, seed=1).eval()
    image, occupancy = torch.rand(2, 3, *tiny.image_size), torch.rand(2, 4, *tiny.grid.shape)
    save_net(net, tmp_path / "net.safetensors")
    loaded = load_net(tmp_path / "net.safetensors", CAMERA)
    assert loaded.architecture == tiny
    assert torch.equal(loaded(image, occupancy), net(image, occupancy))


def test_it_learns_in_both_stages(tiny, tmp_path):
    net = build_net(tiny, CAMERA)
    first = net.segmenter.layers[0].weight.detach().clone()
    train(net, tiny_streets(), tmp_path, TrainingParams(image_iterations=1, grid_iterations=1, batch_size=2))
    weights = [load_file(tmp_path / file) for file in ("image_stage.safetensors", "weights.safetensors")]
    image_stage, trained = (tensors["segmenter.layers.0.weight"] for tensors in weights)
    assert not torch.equal(first, image_stage)
    assert not torch.equal(image_stage, trained)


def test_the_command_line_names_it(tiny):
    shown = "".join(CliRunner().invoke(app, ["train", "--help"]).output.split())  # lines may break at a hyphen
    assert all(name in shown for name in SEGMENTERS)
    assert "two-layers" in shown


def test_refusals_name_it(tiny, tmp_path):
    with pytest.raises(ArgumentError, match=r"name: expected one of .*two-layers.*, found 'one-layer'"):
        build_net(replace(tiny, segmenter="one-layer"), CAMERA)
    with pytest.raises(ArgumentError, match=r"published ImageNet weights: .*, found TwoLayers"):
        load_imagenet(build_net(tiny, CAMERA).segmenter, tmp_path / "weights.safetensors")
