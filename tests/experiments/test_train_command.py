import json

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from semgrid_edu.camera import Camera
from semgrid_edu.cli import app
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.experiments import train as experiment
from semgrid_edu.files import sha256, write_text
from semgrid_edu.networks import Architecture, Fcn, load_net
from semgrid_edu.provenance import provenance_problems


class _Noise:
    """Six frames of noise, in the place of a data set on disk."""

    camera = Camera(
        np.array([[186, 0, 157], [0, 184, 44], [0, 0, 1.0]]),
        np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]]),
        Architecture().image_size,
    )

    def __init__(self, dataset_dir, split, spec, image_size):
        assert split == "train"
        self.rng = torch.Generator().manual_seed(0)

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


def test_the_command_leaves_weights_log_and_provenance(monkeypatch, tmp_path):
    monkeypatch.setattr(experiment, "TrainingSet", _Noise)
    data, out = tmp_path / "minikitti", tmp_path / "compact"
    write_text(data / "dataset.json", "{}")
    arguments = [
        "train",
        "--data",
        str(data),
        "--out",
        str(out),
        "--segmenter",
        "fcn",
        "--seed",
        "3",
        "--iterations",
        "1",
    ]
    result = CliRunner().invoke(app, arguments)
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
    assert len((out / "log.csv").read_text().splitlines()) == 3
    assert isinstance(load_net(out / "weights.safetensors", _Noise.camera).segmenter, Fcn)


def test_the_command_names_what_is_missing(tmp_path):
    arguments = ["train", "--data", str(tmp_path / "nowhere"), "--out", str(tmp_path / "out")]
    with pytest.raises(ValueError, match=r"nowhere.dataset.json"):
        CliRunner().invoke(app, arguments, catch_exceptions=False)
