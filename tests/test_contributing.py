"""The code in CONTRIBUTING.md does what is said of it."""

import re
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import Segmenter
from semgrid_edu.occupancy import CmcdotParams, Evidence, State, track_drive

TEXT = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")


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
    for block in re.findall(r"^ *```python\n(.*?)^ *```", TEXT, flags=re.DOTALL | re.MULTILINE):
        exec(re.sub(rf"^{re.match(' *', block)[0]}", "", block, flags=re.MULTILINE), names)
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


def test_the_backbone_is_a_segmenter(written):
    net = written["TwoLayers"](n_classes=5, seed=1)
    assert net(torch.rand(2, 3, 12, 20)).shape == (2, 5, 12, 20)
