"""A backbone is one class and one line in the registry: its name stands wherever those of the package's own do.

Table 1 trains, saves and loads such a backbone in `tests/experiments/test_own_backbone.py`.
"""

from dataclasses import replace
from typing import ClassVar

import pytest
from tiny_streets import CAMERA, SMALL
from torch import nn
from typer.testing import CliRunner

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import SEGMENTERS, build_net, load_imagenet
from semgrid_edu.networks.segmenter import Segmenter
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


def test_the_command_line_names_it(tiny):
    shown = "".join(CliRunner().invoke(app, ["train", "--help"]).output.split())  # lines may break at a hyphen
    assert all(name in shown for name in SEGMENTERS)
    assert "two-layers" in shown


def test_refusals_name_it(tiny, tmp_path):
    with pytest.raises(ArgumentError, match=r"name: expected one of .*two-layers.*, found 'one-layer'"):
        build_net(replace(tiny, segmenter="one-layer"), CAMERA)
    with pytest.raises(ArgumentError, match=r"published ImageNet weights: .*, found TwoLayers"):
        load_imagenet(build_net(tiny, CAMERA).segmenter, tmp_path / "weights.safetensors")
