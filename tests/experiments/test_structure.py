"""What few long runs do to an interval, the drop between tables, and the figures' parts, from counts made by hand."""

from itertools import product
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest

from semgrid_edu.grid import GridSpec
from semgrid_edu.storage.tensors import write_arrays
from semgrid_edu.workshop.paper.reports import structure
from semgrid_edu.workshop.paper.reports.drop import drop_between_tables
from semgrid_edu.workshop.paper.reports.pictures import PARTS, figures_markdown, figures_picture
from semgrid_edu.workshop.paper.runs.claim_runs import figure_runs, shown_frames, structure_runs
from semgrid_edu.workshop.paper.runs.other_runs import GRIDS, KEPT
from semgrid_edu.workshop.paper.runs.paper import TABLE_1_SCORES, TABLE_2_SCORES
from semgrid_edu.workshop.paper.runs.run_counts import RunCounts
from semgrid_edu.workshop.paper.runs.scales import SCALES
from semgrid_edu.workshop.scoring.confusions import FrameConfusions


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
def result(monkeypatch):
    """Streets are 120 drives of a frame each, long runs four of thirty."""
    scale, n_drives = SCALES["reduced"], {"minikitti": 120, "kittiruns": 4}
    made = {pair: [Counted(80, n_drives[pair[1]], seed) for seed in range(3)] for pair in structure_runs(scale, 1)}
    monkeypatch.setattr(structure, "structure_runs", lambda *_: made)
    return structure.structure(scale, 3, None)


def test_few_runs_have_no_interval_and_frames_would_promise_too_much(result):
    rows = {(row["learned"], row["tested"]): row for row in result["rows"]}
    assert len(rows) == 4
    streets, runs = rows["minikitti", "minikitti"], rows["minikitti", "kittiruns"]
    assert streets["scores"]["all"]["pixel accuracy"]["low"] is not None
    assert runs["scores"]["all"]["pixel accuracy"]["low"] is None
    assert streets["half-width"]["drives"] == pytest.approx(streets["half-width"]["frames"])  # a frame is a drive there
    assert runs["half-width"]["drives"] > 2 * runs["half-width"]["frames"]
    assert runs["drives"][0] < runs["scores"]["all"]["pixel accuracy"]["mean"] < runs["drives"][1]


def test_the_page_on_structure_has_every_pair(result):
    text = structure.structure_markdown(result)
    pairs = [tuple(cell.strip() for cell in line.split("|")[1:3]) for line in text.splitlines() if "|" in line]
    assert all(pairs.count(pair) == 2 for pair in product(("minikitti", "kittiruns"), repeat=2))
    assert "eight runs" in text
    plt.close(structure.structure_picture(result))


def test_the_drop_is_table_2_minus_table_1():
    runs = SimpleNamespace(usual=[Counted(80, 12)], table2=[Counted(60, 12)], new_routes=[Counted(70, 12)])
    found = drop_between_tables(runs, None)
    assert found["ours"]["pixel accuracy"] == pytest.approx(-0.2)
    assert found["ours, more routes"]["pixel accuracy"] == pytest.approx(-0.1)
    papers = TABLE_2_SCORES["segnet", False]["class accuracy"] - TABLE_1_SCORES["segnet", False]["class accuracy"]
    assert found["paper"]["class accuracy"] == papers == pytest.approx(-0.141)


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
