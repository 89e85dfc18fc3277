import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from tiny_notes import Note
from worlds.lecture_12_pictures import accuracy_picture, confusion_picture

import semgrid_edu
from semgrid_edu.labels import SYNTHIA_10
from semgrid_edu.workshop.paper.experiments import EXPERIMENTS, Experiment
from semgrid_edu.workshop.paper.published import TABLE_1_SCORES
from semgrid_edu.workshop.paper.reproduce import result_markdown, write_result
from semgrid_edu.workshop.paper.scales import SCALES
from semgrid_edu.workshop.paper.score_runs import FITTED_BASELINES, WITH_CRF
from semgrid_edu.workshop.paper.tables import (
    accuracy_markdown,
    accuracy_result,
    confusion_markdown,
    confusion_result,
)
from semgrid_edu.workshop.scoring.confusions import FrameConfusions


class Counted:
    """A run on ten drives of 100 cells each, of which so many are right by its seed; the CRF adds four.

    In every other drive one cell more is right.
    """

    def __init__(self, n_classes, right):
        self.n_classes, self.right = n_classes, right

    def confusions(self, _root, method, _truth, _band=None):
        matrices = np.zeros((10, self.n_classes, self.n_classes), int)
        for drive, matrix in enumerate(matrices):
            right = self.right + 4 * (method == WITH_CRF) + drive % 2
            matrix[0, :2] = right, 100 - right
        return FrameConfusions(tuple("abcdefghij"), {method: matrices})


@pytest.fixture
def table1():
    runs = {name: [Counted(14, right), Counted(14, right + 2)] for name, right in (("segnet", 80), ("fcn", 70))}
    return accuracy_result(runs, None, [Counted(14, 70)] * 2, TABLE_1_SCORES)


def test_rows_hold_mean_and_every_seed(table1):
    """SegNet is right in 80 and 81 of 100 cells with one seed, in 82 and 83 with the other."""
    first, with_crf, *_ = table1["rows"]
    accuracy = first["scores"]["lidar"]["all"]["pixel accuracy"]
    assert accuracy["seeds"] == pytest.approx([0.805, 0.825])
    assert accuracy["mean"] == pytest.approx(0.815)
    assert with_crf["scores"]["true"]["semantic"]["pixel accuracy"]["mean"] == pytest.approx(0.855)
    assert first["confusion"]["lidar"][0][:2] == [1630, 370]


def test_differences_are_paired(table1):
    """Every drive and seed differs by the same number of cells, so the interval is a point."""
    by_name = {row["what"]: row["scores"]["lidar"]["all"]["pixel accuracy"] for row in table1["differences"]}
    for what, expected in (("SegNet: with CRF - without", 0.04), ("SegNet - FCN", 0.1)):
        value = by_name[what]
        assert [value["low"], value["mean"], value["high"]] == pytest.approx([expected] * 3)


def test_the_table_shows_the_papers_values_beside_ours(table1):
    lines = accuracy_markdown(table1).splitlines()
    (first, *_) = (line for line in lines if line.startswith("| SegNet"))
    assert [cell.strip() for cell in first.split("|")][2:4] == ["no", "81.1"]
    assert "81.5 (" in first
    assert any("80.5, 82.5" in line for line in lines)
    plt.close(accuracy_picture(table1))


def test_table_3_is_in_per_cent_of_its_rows():
    result = confusion_result({"segnet": [Counted(10, 80), Counted(10, 90)]}, None, [Counted(10, 70)] * 2)
    assert result["ours"]["matrix"][0][:2] == [85.5, 14.5]
    assert result["ours"]["matrix"][1] == [None] * 10
    assert result["paper"]["matrix"][2][2] == 57.42
    text = confusion_markdown(json.loads(json.dumps(result)))
    assert all(f"| {name} " in text for name in SYNTHIA_10.names)
    plt.close(confusion_picture(result))


def test_table_3_has_its_baselines_with_paired_differences():
    """Ours is right in 80 and 81, then 90 and 91 of 100 cells, the baselines in 70 and 71 with both seeds."""
    result = confusion_result({"segnet": [Counted(10, 80), Counted(10, 90)]}, None, [Counted(10, 70)] * 2)
    assert list(result["baselines"]) == list(FITTED_BASELINES)
    for one in result["baselines"].values():
        assert one["scores"]["pixel accuracy"]["seeds"] == pytest.approx([0.705, 0.705])
        assert one["differences"]["pixel accuracy"]["seeds"] == pytest.approx([0.1, 0.2])
    first = [line.split("|")[1].strip() for line in confusion_markdown(result).splitlines() if line.startswith("|")]
    assert {name for one in FITTED_BASELINES for name in (one, f"ours - {one}, points")} < set(first)


def test_every_command_has_a_result():
    assert list(EXPERIMENTS) == [
        *("table1", "table2", "table3", "claims", "ablations", "truth-costs", "figures"),
    ]


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_committed_results_give_the_committed_text(name):
    folder = Path(semgrid_edu.__file__).parents[1] / "docs" / "results" / "reduced"
    result = json.loads((folder / f"{name}.json").read_text())
    assert result_markdown(result, EXPERIMENTS[name]) == (folder / f"{name}.md").read_text()


def test_a_result_is_written_with_all_that_made_it(tmp_path):
    runs, scale = [Note("a"), Note("b", (Note("a"),))], SCALES["quick"]
    for run, own in zip(runs, ({"seconds": 60}, {"seconds": 120, "device": "cuda"}), strict=True):
        run.folder(tmp_path).mkdir()
        ended = {"commit": "abc", "date": "2026-01-01", "device": "cpu", **own}
        (run.folder(tmp_path) / "ended.json").write_text(json.dumps(ended))
    shown = Experiment(
        title="A table",
        runs=lambda *_: runs,
        result=lambda *_: {"x": 1},
        markdown=lambda _: "of x",
        picture=lambda *_: plt.figure(),
        deviations=("No frame was seen by day.",),
    )
    text = write_result("table", shown, scale, 2, tmp_path, tmp_path / "out")
    content = json.loads((tmp_path / "out" / "table.json").read_text())
    assert content["x"] == 1
    assert content["commits"] == ["abc"]
    assert content["command"].startswith("semgrid-edu reproduce table --scale quick --seeds 2")
    assert content["command"].endswith(" --device cuda")
    assert any("bfloat16" in line for line in content["deviations"])
    assert all(line in text for line in content["deviations"])
    assert content["deviations"][-1] == "No frame was seen by day."
    times = json.loads((tmp_path / "out" / "table_times.json").read_text())
    assert times == {"hours": 0.05, "dates": ["2026-01-01"], "minutes": {"note-a": 1.0, "note-b": 2.0}}
    assert (tmp_path / "out" / "table.png").exists()
