"""A student's stages beside the package's own: the example file, and the page that shows both."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from read_page import Page, decode
from tiny_drive import DATE, write_tiny_drive
from typer.testing import CliRunner

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.samples import real_drive, sample_drive, sample_weights
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import load_net
from semgrid_edu.occupancy import State
from semgrid_edu.pipeline import StageError, Stages
from semgrid_edu.workshop.commands.main import app
from semgrid_edu.workshop.demo import example_stages, write_demo
from semgrid_edu.workshop.demo.run import run_side_by_side
from semgrid_edu.workshop.demo.stages_file import Comparison, load_stages

EXAMPLE = Path(example_stages.__file__)

pytestmark = pytest.mark.usefixtures("few_stories")


@pytest.fixture(scope="module")
def out(drive, tmp_path_factory):
    """The page of the tiny drive with the example under a student's name, made by the command line."""
    folder = tmp_path_factory.mktemp("student")
    shutil.copy(EXAMPLE, folder / "my_stages.py")
    arguments = [str(drive.folder), "--stages", str(folder / "my_stages.py")]
    arguments += ["--weights", str(sample_weights())]
    result = CliRunner().invoke(app, ["demo", *arguments, "--out", str(folder / "out")])
    assert result.exit_code == 0, result.exception
    return folder / "out"


@pytest.fixture(scope="module")
def alone(drive, tmp_path_factory):
    """The page of the package's own stages."""
    return write_demo(drive, sample_weights(), tmp_path_factory.mktemp("alone")).parent


@pytest.fixture(scope="module")
def page(out):
    return Page((out / "index.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def words(out):
    """What the page says, without its tags."""
    return re.sub(r"<[^>]*>", "", (out / "index.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def frames(page):
    return json.loads(page.text["frames"])


@pytest.fixture(scope="module")
def results(drive):
    own = Stages.fast(load_net(sample_weights(), drive.camera))
    return list(run_side_by_side(drive, own, load_stages(EXAMPLE).over(own)))


class TestExample:
    def test_a_wall_is_static_what_lies_before_it_free_and_what_lies_behind_it_unknown(self, drive):
        x, y = np.meshgrid(np.arange(3, 19, 0.2), np.arange(-4, 4, 0.1))
        ground = np.stack([x, y, np.full_like(x, -1.73), np.ones_like(x)], axis=-1).reshape(-1, 4)
        wall = np.array([[20.25, y, -0.7, 1] for y in np.arange(-4, 4, 0.05)])
        points = np.concatenate([ground, wall]).astype(np.float32)
        spec = GridSpec(0, 40, -4, 4, 0.5)
        (o,) = example_stages.track([Frame(None, points, drive.camera, np.eye(4), 0.0)], spec)
        rows, cols, _ = spec.cells(np.array([[20.25, 0.25], [10.25, 0.25], [30.25, 0.25]]))
        assert o[:, rows, cols].argmax(axis=0).tolist() == [State.STATIC, State.FREE, State.UNKNOWN]
        np.testing.assert_allclose(o.sum(axis=0), 1, rtol=1e-6)

    def test_the_blur_leaves_a_lone_cell_the_middle_of_a_gaussian(self):
        g = np.zeros((14, 41, 41))
        g[0] = 1
        g[:, 20, 20] = np.eye(14)[3]
        with np.errstate(divide="ignore"):
            refined = example_stages.refine(np.log(g), None)
        assert refined[3, 20, 20] == pytest.approx(1 / (2 * np.pi * example_stages.WIDTH**2), rel=0.01)
        assert refined[3].sum() == pytest.approx(1)
        np.testing.assert_allclose(refined.sum(axis=0), 1)

    def test_runs_on_the_first_frames_of_the_shipped_drive(self):
        shipped = sample_drive()
        own = Stages.fast(load_net(sample_weights(), shipped.camera))
        (before, _), (package, yours) = run_side_by_side(shipped[:2], own, load_stages(EXAMPLE).over(own))
        assert before.belief.probability.shape == yours.belief.probability.shape
        np.testing.assert_array_equal(package.scores, yours.scores)
        assert (package.grid != yours.grid).any()
        assert (yours.belief.probability[State.DYNAMIC] < 0.5).all()  # one scan doesn't tell what moves


SAMPLE = """
import numpy as np

def sample(s):
    assert s.shape == (14, 96, 320)
    return np.zeros((14, 20, 142, 62), np.float32)
"""
REFINE = "import numpy as np\n\ndef refine(log_g, o):\n    return np.exp(log_g)\n"


@pytest.mark.parametrize(("code", "size"), [(SAMPLE, "320 × 96"), (REFINE, "480 × 144")], ids=["sample", "refine"])
def test_a_stage_of_the_papers_system_gets_that_system_on_a_real_drive(tmp_path, code, size):
    (tmp_path / "my_stages.py").write_text(code)
    page = write_demo(real_drive(), None, tmp_path / "out", tmp_path / "my_stages.py", frames="0:1")
    assert f"sees the image at {size} pixels" in page.read_text(encoding="utf-8")


def test_the_page_shows_the_packages_picture_and_yours_side_by_side(page, frames, results):
    assert [a.get("class") for a in page.all("div")].count("pair") == 3
    assert len(page.all("figure")) == len(page.all("figcaption")) == 9
    for frame, (package, yours) in zip(frames, results, strict=True):
        for name in ("grid", "refined"):
            ours, theirs = (np.array(decode(frame["images"][prefix + name])) for prefix in ("", "your_"))
            np.testing.assert_array_equal(ours, getattr(package, name).argmax(axis=0))
            np.testing.assert_array_equal(theirs, getattr(yours, name).argmax(axis=0))
        assert frame["images"]["occupancy"] != frame["images"]["your_occupancy"]
        assert "your_scores" not in frame["images"]  # the same network made them


def test_every_picture_has_its_words_and_yours_say_so(words, frames):
    for frame in frames:
        assert set(frame["texts"]) == set(frame["images"]) - {"photo"}
        for name, text in frame["texts"].items():
            assert text.startswith("my_stages.py: ") == name.startswith("your_")
    assert words.count("Made with track of my_stages.py") == 2
    assert words.count("Made with track and refine of my_stages.py") == 1


def test_each_occupancy_grid_has_its_arrows(page, frames):
    arrows = [a["data-arrows"] for _, a in page.elements if "data-arrows" in a]
    assert arrows == ["occupancy", "your_occupancy"] == list(frames[0]["arrows"])


def test_the_page_opens_with_whose_stages_they_are(words):
    assert "In the second, track (l → o) and refine (g → g) come from my_stages.py, and the other stages are" in words


def test_tables_hold_both(out, results):
    html = (out / "index.html").read_text(encoding="utf-8").replace("<wbr>", "")
    rows = re.findall(r"<tr><th>(?:all|semantic) cells, (.*?)</th>", html)
    names = [
        f"{grid}, {whose}"
        for whose in ("the package&#x27;s", "my_stages.py")
        for grid in ("semantic grid", "refined grid")
    ]
    assert rows == 2 * names
    times = re.findall(r'<tr class="stage">.*?</tr>', html)
    assert len(times) == 5
    assert all(len(re.findall(r"<td>[\d.]+</td>", row)) == 2 for row in times)
    assert ["replaced by" in row for row in times] == [True, False, False, False, True]


def test_yours_are_scored_against_the_truth_of_the_packages_filter(out, results):
    html = (out / "index.html").read_text(encoding="utf-8").replace("<wbr>", "")
    right = [
        yours.refined.argmax(axis=0) == grid_truth(package.frame.labels, package.belief.probability, GridSpec.compact())
        for package, yours in results[1:]
    ]
    row = re.search(r"<tr><th>all cells, refined grid, my_stages.py</th><td>([\d.]+)</td>", html)
    assert float(row[1]) == pytest.approx(100 * np.mean(right), abs=0.051)


def test_the_package_alone_gives_the_same_pictures(frames, alone):
    alone = Page((alone / "index.html").read_text(encoding="utf-8"))
    for both, one in zip(frames, json.loads(alone.text["frames"]), strict=True):
        assert both["images"].items() >= one["images"].items()


def test_the_overview_has_a_second_row(out, alone):
    with Image.open(out / "overview.png") as both, Image.open(alone / "overview.png") as one:
        assert both.width == one.width
        assert both.height > 1.5 * one.height


class TestComparison:
    @pytest.mark.parametrize(
        ("stages", "memory", "changed"),
        [
            (("refine",), False, ("refined",)),
            (("sample",), False, ("grid", "refined")),
            (("segment", "fuse"), False, ("scores", "grid", "refined")),
            (("track",), False, ("occupancy", "grid", "refined")),
            (("fuse",), True, ("grid", "refined", "remembered")),
            (("remember",), True, ("remembered",)),
        ],
    )
    def test_only_what_can_differ_is_shown_twice(self, stages, memory, changed):
        assert Comparison("my_stages.py", stages, memory).changed == changed


def write(folder, text):
    path = folder / "my_stages.py"
    path.write_text(f"import numpy as np\n{text}")
    return path


@pytest.mark.usefixtures("no_overview")
def test_an_image_network_of_ones_own_is_shown_too_and_its_classes_are_in_the_legend(drive, tmp_path):
    signage = KITTI_14.index("signage")
    scores = f"np.eye(14)[np.full((96, 320), {signage})].transpose(2, 0, 1)"
    page = write_demo(drive, sample_weights(), tmp_path, write(tmp_path, f"def segment(image): return {scores}\n"))
    html = page.read_text(encoding="utf-8")
    elements = Page(html)
    assert "your_scores" in json.loads(elements.text["frames"])[0]["images"]
    assert [a["data-image"] for a in elements.all("img")].count("your_scores") == 1
    assert re.search(r'<b>Classes</b>.*?">signage</span>', html)


@pytest.mark.usefixtures("no_overview")
def test_a_memory_of_ones_own_is_shown_beside_the_packages(drive, tmp_path):
    stages = write(
        tmp_path, "def remember(views, spec):\n    for view in views: yield np.full_like(view.grid, 1 / 14)\n"
    )
    html = write_demo(drive, sample_weights(), tmp_path, stages).read_text(encoding="utf-8")
    page = Page(html)
    assert [a.get("class") for a in page.all("div")].count("pair") == 1
    for frame in json.loads(page.text["frames"]):
        assert (np.array(decode(frame["images"]["your_remembered"])) == 0).all()
        assert frame["images"]["remembered"] != frame["images"]["grid"]
    assert "Made with <b>remember</b> of my_stages.py" in html
    assert re.search(r"<tr><th>all cells, grid with memory, my_<wbr>stages.py</th>", html)
    assert len(re.findall(r'<tr class="stage">', html)) == 6


@pytest.mark.usefixtures("no_overview")
def test_without_truth_both_are_shown_and_neither_is_scored(tmp_path):
    write_tiny_drive(tmp_path, n_frames=1, labelled=())
    page = write_demo(KittiRawDrive(tmp_path, DATE, "0001"), sample_weights(), tmp_path / "out", EXAMPLE)
    html = page.read_text(encoding="utf-8")
    assert "Expect poor semantics" in html
    assert len(Page(html).all("figure")) == 2 + 2 * 3
    assert "FmIoU" not in html


class TestMistakes:
    def test_a_stage_that_fails_leaves_no_page(self, drive, tmp_path):
        stages = write(tmp_path, "def refine(log_g, o): return log_g[14]\n")
        with pytest.raises(StageError, match=r"^refine \(my_stages.py, line 2\), frame 0: .* IndexError"):
            write_demo(drive, sample_weights(), tmp_path / "out", stages)
        assert not (tmp_path / "out").exists()

    def test_names_are_escaped(self):
        comparison = Comparison("<b>.py", ("track",))
        assert "<b>.py" not in comparison.lead() + comparison.made_with("grid")
