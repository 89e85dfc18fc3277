"""Results computed again without their runs, from the counts beside them, at the tiniest scale."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from itertools import product, starmap
from pathlib import Path

import numpy as np
import pytest
import typer
from tiny_notes import Note
from tiny_runs import HandMadeData

import semgrid_edu
from semgrid_edu.errors import DataError
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.tensors import read_arrays, write_arrays
from semgrid_edu.workshop.commands.experiments import check
from semgrid_edu.workshop.paper import ablations, training_runs
from semgrid_edu.workshop.paper import reproduce as reports
from semgrid_edu.workshop.paper.data_runs import RECIPE_OF, DataRun
from semgrid_edu.workshop.paper.experiments import EXPERIMENTS
from semgrid_edu.workshop.paper.other_runs import FRAME, OVERTURNED, STEP, TIMES, UPRIGHT, OverturnedRun, TimeRun
from semgrid_edu.workshop.paper.recompute import check_results
from semgrid_edu.workshop.paper.run import ENDED, with_needs
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import SCALES, Scale
from semgrid_edu.workshop.paper.score_runs import BASELINES, CONFUSIONS, WITH_CRF, BaselineRun, CountingRun
from semgrid_edu.workshop.paper.variants import Variant
from semgrid_edu.workshop.scoring.confusions import (
    FrameConfusions,
    confusion_key,
    distance_band_names,
    save_confusions,
)
from semgrid_edu.workshop.scoring.grids import NETWORK
from semgrid_edu.workshop.workplace import Workplace

TINY = Scale(
    name="tiny",
    kitti="tinytested",
    image_iterations=1,
    grid_iterations=1,
    table1_seeds=2,
    networks=("segnet",),
    policies=("no-cleanup",),
)
MADE = ("table1", "truth-costs")
COMMITTED = Path(semgrid_edu.__file__).parents[1] / "docs" / "results"


@pytest.fixture(autouse=True)
def _known(monkeypatch):
    monkeypatch.setitem(SCALES, "tiny", TINY)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Table 1 and the costs of labels, of runs that are gone."""
    folder = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SCALES, "tiny", TINY)
        patch.setattr(DataRun, "work", HandMadeData.work)
        patch.setattr(training_runs, "seconds_per_step", lambda *_: 1.0)  # tried in test_own_backbone
        patch.setattr(reports, "workplace", lambda *_: nullcontext(Workplace(ThreadPoolExecutor(1), 1)))
        for name in MADE:
            places = {"runs": folder / "runs", "out": folder / "out"}
            assert reports.reproduce(reports.Request(experiment=name, scale="tiny", seeds=2, **places), print) == ""
    shutil.rmtree(folder / "runs")
    return folder / "out"


@pytest.fixture
def results(made, tmp_path):
    return Path(shutil.copytree(made, tmp_path / "results"))


def found(folder):
    """Whether all is as written, and what the command says."""
    told = []
    return check_results(folder, told.append), "\n".join(told)


def test_results_are_computed_again_without_their_runs(results):
    same, said = found(results)
    assert same, said
    assert said.splitlines() == [f"{name}, computed again from {name}_counts.npz: as written" for name in MADE]
    check(results)


def test_one_changed_count_is_named_wherever_it_counts(results):
    path = results / "table1_counts.npz"
    arrays = read_arrays(path)
    key = next(
        key for key in arrays if "baselines" in key and key.endswith("majority class, true labels, all distances")
    )
    truth, called = np.argwhere(arrays[key][0])[0]
    arrays[key][0, truth, called] += 1
    write_arrays(path, arrays)
    same, said = found(results)
    assert not same
    assert f"table1.json, baselines, 0, confusion, true, {truth}, {called}: " in said
    assert "table1.json, differences, SegNet - majority class, scores, true, all, pixel accuracy, mean: " in said
    assert "rows" not in said  # no network's score
    assert "truth-costs, computed again from truth-costs_counts.npz: as written" in said
    with pytest.raises(typer.Exit):
        check(results)


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("table1.json", '"seeds": 2', '"seeds": 2, "more": 1', "table1.json, more: 1 is written, nothing is computed"),
        ("table1.json", '"CRF": true', '"CRF": false', "table1.json, rows, 1, CRF: False is written, True is computed"),
        ("truth-costs.json", '"mean": 0.', '"mean": 1.', "truth-costs.json, rows, 0, "),
        ("table1.md", "Scale tiny", "Scale huge", "table1.md, line 3"),
        ("table1_times.json", '"hours": ', '"hours": 9', "table1_times.json, hours: "),
    ],
)
def test_a_changed_file_is_named(name, old, new, said, results):
    text = (results / name).read_text()
    assert old in text
    (results / name).write_text(text.replace(old, new, 1))
    same, told = found(results)
    assert not same
    assert said in told


def test_numbers_that_another_machine_rounds_otherwise_are_the_same(results):
    path = results / "table1.json"
    result = json.loads(path.read_text())
    scores = result["rows"][0]["scores"]["true"]["all"]["pixel accuracy"]
    scores["mean"] = float(np.nextafter(scores["mean"], 1))
    path.write_text(json.dumps(result | {"versions": {"python": "4.0"}}))
    assert found(results)[0]


def without(arrays, word):
    return {key: array for key, array in arrays.items() if word not in key}


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda arrays: without(arrays, "majority class, lidar"), "expected the array '.*majority class, lidar labels"),
        (
            lambda arrays: {key: array[:1] if array.ndim == 3 else array for key, array in arrays.items()},
            r"\(F, C, C\)",
        ),
        (lambda arrays: {key: array / 2 if array.ndim == 3 else array for key, array in arrays.items()}, "numbers of"),
    ],
)
def test_counts_that_are_something_else_are_refused(spoil, says, results):
    path = results / "table1_counts.npz"
    write_arrays(path, spoil(read_arrays(path)))
    with pytest.raises(DataError, match=rf"table1_counts.npz: .*{says}"):
        found(results)


def test_what_is_kept_comes_back_as_it_was(tmp_path):
    run, counts = Note("a"), np.arange(18).reshape(2, 3, 3) * 1000
    run.folder(tmp_path).mkdir()
    (run.folder(tmp_path) / "ended.json").write_text('{"seconds": 3, "commit": "abc"}')
    arrays = {"sums": np.array([0.1, 1 / 3]), "signed": np.array([-1, 300]), "none": np.zeros((0, 2), int)}
    read = RunCounts(tmp_path)
    frames = FrameConfusions(("x", "y"), {"way": counts})
    kept = [read.confusions(run, "way", "way, true", lambda _: frames), read.of(run, tuple(arrays), lambda _: arrays)]
    record = read.record(run)
    for name in ("one.npz", "two.npz"):
        read.keep(tmp_path / name)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()

    back = RunCounts(tmp_path / "one.npz")
    assert back.arrays["note-a/way, true"].dtype == np.uint16
    assert back.arrays["note-a/signed"].dtype == np.int16
    confusions, others = back.confusions(run, "way", "way, true", None), back.of(run, tuple(arrays), None)
    assert confusions.drives == kept[0].drives == ("x", "y")
    assert confusions.counts["way"].dtype == np.int64
    np.testing.assert_array_equal(confusions.counts["way"], counts)
    for name, array in arrays.items():
        np.testing.assert_array_equal(others[name], kept[1][name])
        np.testing.assert_array_equal(others[name], array)
    assert back.record(run) == record
    with pytest.raises(DataError, match=r"one.npz: expected the array 'note-a/other'"):
        back.of(run, ("other",), None)


def count_by_hand(run, root, rng):
    """Write what a run leaves behind: two frames of each of ten drives, and numbers drawn by chance."""
    folder, drives = run.folder(root), tuple(f"2026_01_01 {k // 2:04d}" for k in range(20))
    write_json(folder / ENDED, {"seconds": 60, "commit": "abc", "date": "2026-01-01"})
    if isinstance(run, TimeRun):
        write_json(folder / TIMES, {what: rng.uniform(1, 2, (4, 2)).tolist() for what in (FRAME, STEP)})
    elif isinstance(run, (CountingRun, OverturnedRun)):
        n_classes = len(LABEL_SETS[RECIPE_OF[run.frames.data.data].label_set])
        methods = BASELINES if isinstance(run, BaselineRun) else (NETWORK, WITH_CRF)
        keys = [
            *starmap(confusion_key, product(methods, ("lidar", "true"), distance_band_names())),
            OVERTURNED,
            UPRIGHT,
        ]
        counts = {key: rng.integers(0, 9, (20, n_classes, n_classes)) for key in keys}
        save_confusions(folder / CONFUSIONS, FrameConfusions(drives, counts))


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """The claims, of runs whose counts are drawn by chance, and which are gone."""
    folder, rng, experiment = tmp_path_factory.mktemp("claims"), np.random.default_rng(0), EXPERIMENTS["claims"]
    root, out = folder / "runs", folder / "out"
    for run in with_needs(experiment.runs(SCALES["quick"], 3)):
        run.folder(root).mkdir(parents=True)
        count_by_hand(run, root, rng)
    out.mkdir()
    reports.write_result("claims", experiment, SCALES["quick"], 3, root, out)
    shutil.rmtree(root)
    return out


def test_claims_are_computed_again(computed):
    same, told = found(computed)
    assert same, told


@pytest.mark.parametrize(
    ("first", "last", "said"),
    [
        ("times-", "/seconds per training step", "share of the time of a training step saved, value, mean: "),
        ("overturned-", "/overturned cars", "called car: overturned cars - upright ones, value, mean: "),
        ("score-", "/network, true labels, 0-10 m", "0-20 m - 20-40 m, value, mean: "),
    ],
)
def test_changed_counts_of_claims_are_named(first, last, said, computed, tmp_path):
    out = Path(shutil.copytree(computed, tmp_path / "out"))
    path = out / "claims_counts.npz"
    arrays = read_arrays(path)
    key = next(key for key in arrays if key.startswith(first) and key.endswith(last))
    write_arrays(path, arrays | {key: arrays[key][::-1] ** 2})
    same, told = found(out)
    assert not same
    assert said in told


def test_a_row_without_runs_is_listed(tmp_path, monkeypatch):
    """A row was added to the ablations after their counts were kept; the other rows are computed again."""
    added = {"3 planes": Variant(n_planes=3), "4 planes": Variant(n_planes=4)}
    monkeypatch.setattr(ablations, "VARIANTS", ablations.VARIANTS | added)
    for file in reports.result_files(COMMITTED / "reduced", "ablations")[:4]:
        shutil.copy(file, tmp_path)
    same, said = found(tmp_path)
    assert same, said
    assert said.endswith("no runs yet (`semgrid-edu reproduce ablations` makes them): 3 planes, 4 planes")


@pytest.mark.parametrize(("scale", "name"), [*(("reduced", name) for name in EXPERIMENTS), ("long", "table1")])
def test_committed_counts_give_the_committed_numbers(scale, name, tmp_path):
    for file in reports.result_files(COMMITTED / scale, name)[:4]:
        shutil.copy(file, tmp_path)
    same, said = found(tmp_path)
    assert same, said
