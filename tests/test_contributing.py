"""The code in CONTRIBUTING.md does what is said of it."""

import importlib
import re
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
import torch
from npz_drive import CAMERA, write_npz_drives
from torch import Tensor, nn

from semgrid_edu.datasets import training_cache
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import Segmenter
from semgrid_edu.occupancy import CmcdotParams, Evidence, State, track_drive

TEXT = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")

BLOCKS = [
    re.sub(rf"^{re.match(' *', block)[0]}", "", block, flags=re.MULTILINE)
    for block in re.findall(r"^ *```python\n(.*?)^ *```", TEXT, flags=re.DOTALL | re.MULTILINE)
]
"""The document's Python code."""


@pytest.fixture(scope="module")
def written():
    """What the document's Python code defines, by name."""
    names = {
        "np": np,
        "nn": nn,
        "Tensor": Tensor,
        "ClassVar": ClassVar,
        "Segmenter": Segmenter,
        "Evidence": Evidence,
        "CmcdotParams": CmcdotParams,
        "track_drive": track_drive,
    }
    for block in BLOCKS:
        exec(block, names)
    return names


def test_the_sensor_model_makes_what_it_hits_occupied_and_leaves_the_rest_unknown(written):
    frame = sample_drive()[0]
    (belief,) = written["track"]([frame], GridSpec.compact())
    hits = frame.points_grid[frame.points_grid[:, 2] > 0.3]
    rows, cols, inside = GridSpec.compact().cells(hits[:, :2])
    hit = np.zeros(GridSpec.compact().shape, bool)
    hit[rows[inside], cols[inside]] = True
    occupied = belief.probability[[State.STATIC, State.DYNAMIC]].sum(axis=0)
    assert hit.any()
    free, *prior = CmcdotParams().first_sight
    expected = 0.8 * sum(prior) / (0.8 * sum(prior) + 0.05 * free)
    np.testing.assert_allclose(occupied[hit], expected, atol=1e-5)
    assert (belief.probability[State.UNKNOWN][~hit] > 0.99).all()


def test_the_reader_makes_a_training_set(tmp_path, monkeypatch):
    blocks = [block for block in BLOCKS if "class NpzDrive" in block]
    if not blocks:
        pytest.skip("CONTRIBUTING.md has no reader yet")
    (tmp_path / "contributed_reader.py").write_text(blocks[0])
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(training_cache, "WORKERS", 1)
    reader = importlib.import_module("contributed_reader").NpzDrive
    reader.camera = CAMERA
    frames = TrainingSet(replace(write_npz_drives(tmp_path), reader=reader), "train", image_size=(24, 80))
    assert (len(frames), frames.drives) == (2, ("a", "b"))
    assert {KITTI_14.index("road"), KITTI_14.index("building")} < set(frames[1].truth.unique().tolist())


def test_the_resampling_tracks_a_drive(written):
    frames, spec = sample_drive()[:2], GridSpec.compact()
    own, again = ([b.probability for b in written["track_by_independent_draws"](frames, spec)] for _ in range(2))
    usual = [belief.probability for belief in track_drive(frames, spec)]
    assert np.array_equal(own, again)
    assert not np.array_equal(own, usual)
    assert np.abs(np.subtract(own, usual)).mean() < 0.02


def test_the_backbone_is_a_segmenter(written):
    net = written["TwoLayers"](n_classes=5, seed=1)
    assert net(torch.rand(2, 3, 12, 20)).shape == (2, 5, 12, 20)
