"""What few long runs do to an interval, from counts made by hand and from committed ones; the figures' parts."""

import json
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from worlds.lecture_12_structure import DATA, structure, structure_runs

from semgrid_edu.grid import GridSpec
from semgrid_edu.storage.tensors import write_arrays
from semgrid_edu.workshop.paper.data_runs import frame_counts
from semgrid_edu.workshop.paper.figures import (
    GRIDS,
    KEPT,
    PARTS,
    figure_runs,
    figures_markdown,
    figures_picture,
    shown_frames,
)
from semgrid_edu.workshop.paper.recompute import differences
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import SCALES
from semgrid_edu.workshop.scoring.confusions import FrameConfusions

RESULTS = Path(__file__).parents[2] / "docs" / "results" / "reduced"


class Counted:
    """A run on 120 frames of 100 cells in some drives, on which so many cells are right; drives differ."""

    def __init__(self, right, n_drives, seed=0):
        self.right, self.n_drives, self.seed = right, n_drives, seed

    def confusions(self, _root, method, _truth, _band=None):
        rng, counts = np.random.default_rng(self.n_drives), np.zeros((120, 14, 14), int)
        drives = np.repeat(np.arange(self.n_drives), 120 // self.n_drives)
        counts[:, 0, 0] = self.right + self.seed + rng.integers(-8, 9, self.n_drives)[drives]
        counts[:, 0, 1] = 100 - counts[:, 0, 0]
        return FrameConfusions(tuple(map(str, drives)), {method: counts})

    def frame_confusions(self, _counted, method, truth):
        return self.confusions(_counted, method, truth).counts[method]


@pytest.fixture
def rows():
    """Streets are 120 drives of a frame each, long runs four of thirty."""
    n_drives = {"minikitti": 120, "kittiruns": 4}
    pairs = {pair: [Counted(80, n_drives[pair[1]], seed) for seed in range(3)] for pair in product(DATA, DATA)}
    return {(row["learned"], row["tested"]): row for row in structure(pairs, None)}


def test_few_runs_have_no_interval_and_frames_would_promise_too_much(rows):
    assert len(rows) == 4
    streets, runs = rows["minikitti", "minikitti"], rows["minikitti", "kittiruns"]
    assert streets["scores"]["all"]["pixel accuracy"]["low"] is not None
    assert runs["scores"]["all"]["pixel accuracy"]["low"] is None
    assert streets["half-width"]["drives"] == pytest.approx(streets["half-width"]["frames"])  # a frame is a drive there
    assert runs["half-width"]["drives"] > 2 * runs["half-width"]["frames"]
    assert runs["drives"][0] < runs["scores"]["all"]["pixel accuracy"]["mean"] < runs["drives"][1]


def test_the_committed_counts_give_the_committed_rows():
    committed = json.loads((RESULTS / "structure.json").read_text())
    pairs = structure_runs(SCALES["reduced"], committed["seeds"])
    computed = structure(pairs, RunCounts(RESULTS / "structure_counts.npz"))
    assert not list(differences(committed["rows"], json.loads(json.dumps(computed)), "structure.json"))


def test_few_runs_have_as_many_frames_as_there_are_streets():
    counts = frame_counts("kittiruns")
    assert {split: frames for split, (frames, _) in counts.items()} == {
        split: frames for split, (frames, _) in frame_counts("minikitti").items()
    }
    assert [n_drives for _, n_drives in counts.values()] == [4, 4]


def test_figure_6_has_a_scene_of_every_data_set_it_has_in_the_paper(tmp_path):
    scale, grid = SCALES["reduced"], np.zeros((1, *GridSpec.compact().shape), np.uint8)
    kept = dict.fromkeys(KEPT, grid) | {"frame": np.array([3]), "image": np.zeros((1, 3, 8, 16))}
    for run in figure_runs(scale, 1):
        run.folder(tmp_path).mkdir()
        write_arrays(run.folder(tmp_path) / GRIDS, kept)
    counted = RunCounts(tmp_path)
    result = {"scale": scale.name, "seeds": 1, **shown_frames(scale, 1, counted)}
    assert list(PARTS) == list(result["figures"]) == ["Figure 6", "Figure 6, INRIA-Chroma", "Figure 7"]
    figure = figures_picture(result, counted)
    assert len(figure.subfigs) == 3
    assert all(name in figures_markdown(result) for name in PARTS)
    plt.close(figure)
