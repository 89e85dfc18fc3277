"""The code in CONTRIBUTING.md does what is said of it."""

import importlib
import pkgutil
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import test_house_rules as house_rules
import torch
from npz_drive import CAMERA, write_npz_drives
from typer.testing import CliRunner

from semgrid_edu.datasets import index, training_cache
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.fast import track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import SEGMENTERS
from semgrid_edu.occupancy import CmcdotParams, State
from semgrid_edu.workshop.commands.main import app
from semgrid_edu.workshop.paper import ablations, reproduce
from semgrid_edu.workshop.paper.variants import named_variants

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
FOLDERS = "semgrid_edu|tests|benchmarks|notebooks|data_samples|docs"
ROOMS = "|".join(path.stem for path in (ROOT / "semgrid_edu").iterdir() if path.name[0].isalpha())
BACKBONE = "semgrid_edu/networks/two_layers.py"  # the one that a contributor writes
REGISTER = "notebooks/worlds/lecture_00_equations.toml"

BLOCKS = [
    re.sub(rf"^{re.match(' *', block)[0]}", "", block, flags=re.MULTILINE)
    for block in re.findall(r"^ *```python\n(.*?)^ *```", TEXT, flags=re.DOTALL | re.MULTILINE)
]
"""The document's Python code."""


@pytest.fixture(scope="module")
def written():
    """What the document's Python code defines, by name."""
    names = {}
    for block in BLOCKS:
        if "npz_reader" not in block:  # that one is a script
            exec(block, names)
    return names


def test_the_sensor_model_makes_what_it_hits_occupied_and_leaves_the_rest_unknown(written):
    frame = sample_drive()[0]
    (belief,) = track_drive([frame], GridSpec.compact(), CmcdotParams(sensor=written["HitsOnly"]()))
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


def test_the_new_parts_run_alone_and_in_the_whole_system(written):
    first = next(written["results"]).belief.probability
    assert first.shape == written["belief"].probability.shape
    np.testing.assert_allclose(first, written["belief"].probability, atol=0.02)


def test_the_reader_makes_a_data_set_to_train_on_and_to_score(tmp_path, monkeypatch, capsys):
    """In the document's own words: its module, its dataset.json and its script, on drives written by hand."""
    reader, script = (block for block in BLOCKS if "NpzReader" in block)
    (listed,) = re.findall(r"```json\n(.*?)```", TEXT, flags=re.DOTALL)
    write_npz_drives(tmp_path / "mine")
    (tmp_path / "mine" / "dataset.json").write_text(listed)
    (tmp_path / "npz_reader.py").write_text(reader)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(index, "READERS", dict(index.READERS))
    monkeypatch.setattr(training_cache, "WORKERS", 1)
    monkeypatch.setattr(importlib.import_module("npz_reader").NpzReader, "camera", CAMERA)
    names = {"__name__": "__main__"}
    exec(script, names)
    frames = names["frames"]
    assert (len(frames), frames.drives) == (2, ("a", "b"))
    assert {KITTI_14.index("road"), KITTI_14.index("building")} < set(frames[1].truth.unique().tolist())
    assert len((tmp_path / "runs" / "mine" / "log.csv").read_text().splitlines()) == 3
    assert "network + CRF" in capsys.readouterr().out


@pytest.fixture
def plan_of(tmp_path, monkeypatch):
    """What `semgrid-edu reproduce ... --plan` prints; it doesn't try how long a step of each run takes."""
    monkeypatch.setattr(reproduce, "estimate", lambda plan, root: dict.fromkeys(plan, 1.0))

    def plan(*command):
        folders = ["--runs", str(tmp_path / "runs"), "--out", str(tmp_path)]
        shown = CliRunner().invoke(app, ["reproduce", *command, "--plan", *folders])
        assert shown.exit_code == 0, shown.output
        return shown.output

    return plan


def test_the_row_of_ablations_is_in_the_plan(plan_of, monkeypatch):
    (row,) = re.findall(r'`(".*?" = \{.*?\})`', TEXT)
    (options,) = re.findall(
        r"^ +semgrid-edu reproduce (ablations .*) --plan --runs RUNS --out OUT$", TEXT, re.MULTILINE
    )
    (tag,) = re.findall(r"tag, here `(.*?)`", TEXT)
    monkeypatch.setattr(ablations, "VARIANTS", {})
    assert tag not in plan_of(*options.split())
    monkeypatch.setattr(ablations, "VARIANTS", named_variants(tomllib.loads(row)))
    assert f"compact{tag}" in plan_of(*options.split())


@pytest.mark.parametrize("fields", [{}, {"n_planes": 5}])
def test_a_variant_without_a_name_of_its_own_is_refused(fields):
    """Such as one with a new field that `Variant.name` doesn't show: its runs would be another row's."""
    with pytest.raises(ArgumentError, match=r"row 'new' of the ablations: expected .*Variant.name.*, found that of"):
        named_variants({"5 planes": {"n_planes": 5}, "new": fields})


def test_the_backbone_gets_a_row_of_table_1(written, plan_of, monkeypatch):
    (options,) = re.findall(
        r"^ +semgrid-edu reproduce table1 (.*) --runs DIR/runs --out DIR/results$", TEXT, re.MULTILINE
    )
    monkeypatch.setitem(SEGMENTERS, "two-layers", written["TwoLayers"])
    assert "score two-layers compact with CRF" in plan_of("table1", *options.split())


def test_the_backbone_is_documented_as_the_house_demands(monkeypatch):
    (module,) = (block for block in BLOCKS if "class TwoLayers" in block)
    monkeypatch.setitem(house_rules.SOURCES, "two_layers in CONTRIBUTING.md", module)
    assert house_rules.undescribed("two_layers in CONTRIBUTING.md") == []


def test_the_backbone_can_be_trained_by_the_command(monkeypatch, tmp_path):
    """All that the command lacks is the data set."""
    monkeypatch.chdir(tmp_path)
    (command,) = re.findall(r"^ +semgrid-edu (train .*)$", TEXT, re.MULTILINE)
    monkeypatch.setitem(SEGMENTERS, "two-layers", SEGMENTERS["segnet"])
    with pytest.raises(DataError, match=r"minikitti.*dataset\.json"):
        CliRunner().invoke(app, command.split(), catch_exceptions=False)


def test_the_register_finds_the_equation():
    registered = {entry["id"]: entry for entry in tomllib.loads((ROOT / REGISTER).read_text())["equation"]}
    literal = registered["eq-4"]["literal"]
    assert f"`{literal}`" in TEXT
    package, _, name = literal.rpartition(".")
    defined_in = getattr(importlib.import_module(package), name).__module__
    assert f"`{defined_in.replace('.', '/')}.py`" in TEXT


@pytest.mark.parametrize("folder", [".", "docs", "notebooks", "benchmarks", "data_samples"])
def test_what_the_documents_name_exists(folder):
    """Paths below the repository's folders, links, and dotted names of the package, but for patterns such as NAME."""
    for document in {*(ROOT / folder).glob("*.md")} - {ROOT / "CHANGELOG.md"}:  # which tells of the past
        text = document.read_text(encoding="utf-8")
        paths = {ROOT / path for path in re.findall(rf"(?<![\w/])(?:\.\./)?((?:{FOLDERS})/[\w./-]*\w)", text)}
        links = {document.parent / link for link in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text)}
        missing = [place for place in (paths | links) - {ROOT / BACKBONE} if not place.exists()]
        assert [place for place in missing if "NAME" not in str(place)] == []
        names = re.findall(rf"`(?:semgrid_edu\.)?((?:{ROOMS})(?:\.\w+)+)\b", text)
        assert [name for name in names if not resolves(name)] == []


def test_the_tests_that_hold_the_promises_exist():
    text = (ROOT / "tests" / "graders" / "README.md").read_text(encoding="utf-8")
    named = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", text)
    assert len(named) >= 38
    assert [name for name in named if f"def {name[1]}".rstrip() not in (ROOT / name[0]).read_text()] == []


def resolves(name):
    """Whether a dotted name below the package is a module's file, a module, or something in one."""
    try:
        pkgutil.resolve_name(f"semgrid_edu.{name.removesuffix('.py')}")
    except (ImportError, AttributeError):
        return False
    return True


def test_the_resampling_tracks_a_drive(written):
    frames, spec = sample_drive()[:2], GridSpec.compact()
    params = CmcdotParams(resampling=written["Multinomial"]())
    own, again = ([belief.probability for belief in track_drive(frames, spec, params)] for _ in range(2))
    usual = [belief.probability for belief in track_drive(frames, spec)]
    assert np.array_equal(own, again)
    assert not np.array_equal(own, usual)
    assert np.abs(np.subtract(own, usual)).mean() < 0.02


def test_the_backbone_is_a_segmenter(written):
    net = written["TwoLayers"](n_classes=5, seed=1)
    assert net(torch.rand(2, 3, 12, 20)).shape == (2, 5, 12, 20)
