"""A registered image network in Table 1, beside the paper's: data, training, scores and tables at the tiniest scale."""

import json
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext

import pytest
from tiny_runs import HandMadeData
from torch import nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import SEGMENTERS
from semgrid_edu.networks.segmenter import Segmenter
from semgrid_edu.workshop.paper import reproduce as reports
from semgrid_edu.workshop.paper import training_runs
from semgrid_edu.workshop.paper.data_runs import DataRun
from semgrid_edu.workshop.paper.scales import SCALES, Scale, scale_named
from semgrid_edu.workshop.workplace import Workplace


class OneLayer(Segmenter):
    """The smallest image network: each pixel's scores from its own colour."""

    PRESETS = {"compact": {}, "paper": {}}  # noqa: RUF012

    def build(self, n_classes):
        self.layer = nn.Conv2d(3, n_classes, 1)

    def scores(self, image):
        return self.layer(image)


OWN = "one-layer"


@pytest.fixture(autouse=True)
def here(monkeypatch):
    """Register the network; do all work in this process, which knows it, on drives written by hand.

    Only of this network are steps tried, to estimate the time.
    """
    monkeypatch.setitem(SEGMENTERS, OWN, OneLayer)
    tiny = Scale(name="tiny", kitti="tinytested", image_iterations=1, grid_iterations=1, networks=("segnet",))
    monkeypatch.setitem(SCALES, "tiny", tiny)
    monkeypatch.setattr(DataRun, "work", HandMadeData.work)
    tried = training_runs.seconds_per_step
    monkeypatch.setattr(training_runs, "TIMED_STEPS", 1)
    monkeypatch.setattr(
        training_runs, "seconds_per_step", lambda net, *others: tried(net, *others) if net.segmenter == OWN else 1.0
    )
    place = Workplace(ThreadPoolExecutor(1), 1)
    monkeypatch.setattr(reports, "workplace", lambda *_: nullcontext(place))


def table1(scale, folder):
    return reports.Request(experiment="table1", scale=scale, seeds=1, runs=folder / "runs", out=folder / "out")


def test_table_1_compares_it_with_the_papers_networks(tmp_path):
    told = []
    assert reports.reproduce(table1("tiny+one-layer", tmp_path), told.append) == ""
    result = json.loads((tmp_path / "out" / "table1.json").read_text())
    assert "--scale tiny+one-layer" in result["command"]
    assert [row["network"] for row in result["rows"]] == ["segnet"] * 2 + ["one-layer"] * 2
    own = result["rows"][-1]
    assert own["paper"] == dict.fromkeys(own["paper"])
    accuracy = own["scores"]["true"]["all"]["pixel accuracy"]
    assert 0 <= accuracy["mean"] <= 1
    assert accuracy["low"] is accuracy["high"] is None  # of two drives
    (row, *_) = (line for line in told[-1].splitlines() if line.startswith("| one-layer"))
    assert [cell.strip() for cell in row.split("|")][2:4] == ["no", "-"]
    printed = {path.parent.name: path.read_text() for path in (tmp_path / "runs").glob("score-*/output.txt")}
    left_out = {name for name, text in printed.items() if "'network + searched CRF' is left out" in text}
    assert {"one-layer" in name for name in left_out} == {True}


def test_what_is_not_registered_is_refused_before_anything_runs(tmp_path):
    with pytest.raises(ArgumentError, match=r"--scale: expected after a plus one of .*, one-layer, found 'vit'"):
        reports.reproduce(table1("quick+vit", tmp_path), print)
    assert scale_named("tiny+one-layer+segnet").networks == ("segnet", "one-layer")
