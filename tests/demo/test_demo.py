"""The demo's page: whole, self-contained, and true to the pipeline's results."""

import json
import re
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from PIL import Image
from read_page import Page, decode
from tiny_drive import DATE, write_tiny_drive
from typer.testing import CliRunner

from semgrid_edu.camera import Camera
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.samples import sample_image_stage, sample_weights
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14, LabelSet
from semgrid_edu.metrics import METRICS, confusion_matrix
from semgrid_edu.networks import Architecture, build_net, load_net, save_net
from semgrid_edu.pipeline import STAGES, run_pipeline
from semgrid_edu.plotting import depth_colours
from semgrid_edu.workshop.commands.main import app
from semgrid_edu.workshop.demo import write_demo
from semgrid_edu.workshop.demo.page import _crf_costs, page_html
from semgrid_edu.workshop.demo.pictures import (
    arrows_path,
    classes_uri,
    grid_svg,
    points_layer,
    raster_uri,
    scores_layer,
)
from semgrid_edu.workshop.demo.record import FrameView, Record
from semgrid_edu.workshop.demo.run import ChosenFrames

pytestmark = pytest.mark.usefixtures("few_stories")


@pytest.fixture(scope="module")
def weights(drive, tmp_path_factory):
    path = tmp_path_factory.mktemp("weights") / "net.safetensors"
    save_net(build_net(Architecture(), drive.camera, seed=3), path)
    return path


@pytest.fixture(scope="module")
def out(drive, weights, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "new"
    assert write_demo(drive, weights, out) == out / "index.html"
    return out


@pytest.fixture(scope="module")
def html(out):
    return (out / "index.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(html):
    return Page(html)


@pytest.fixture(scope="module")
def frames(page):
    return json.loads(page.text["frames"])


@pytest.fixture(scope="module")
def results(drive, weights):
    return list(run_pipeline(drive, load_net(weights, drive.camera)))


@pytest.fixture(scope="module")
def blank(weights, tmp_path_factory):
    """The page of a frame without truth."""
    root = tmp_path_factory.mktemp("blank")
    write_tiny_drive(root, n_frames=1, labelled=())
    return write_demo(KittiRawDrive(root, DATE, "0001"), weights, root / "out").read_text(encoding="utf-8")


def test_the_page_refers_to_nothing_outside_itself(html, page):
    assert not re.search(r"(https?:)?//[a-z]", re.sub(r"base64,[\w+/=]+", "", html), re.IGNORECASE)
    sources = [a[k] for _, a in page.elements for k in ("src", "href", "data", "action") if a.get(k)]
    assert all(source.startswith("data:image/") for source in sources)
    assert "@import" not in html
    assert "url(" not in html.replace("url(#tip)", "")


def test_the_page_holds_every_frame_and_the_slider_reaches_each(page, frames, drive):
    (slider,) = page.all("input")
    assert (slider["min"], slider["max"], len(frames)) == ("0", str(len(drive) - 1), len(drive))


def test_every_picture_decodes_to_its_size(frames, drive):
    grid = GridSpec.compact().shape[::-1]
    sizes = {"photo": drive.camera.size[::-1], "points": drive.camera.size[::-1], "scores": (320, 96)}
    for frame in frames:
        for name, uri in frame["images"].items():
            assert decode(uri).size == sizes.get(name, grid)


def test_truth_is_shown_where_there_is_one(frames):
    assert ["truth" in frame["images"] for frame in frames] == [False, True, True]


def test_every_picture_has_words_beside_and_behind_it(page, frames):
    for frame in frames:
        shown = set(frame["images"]) - {"photo"}
        assert set(frame["texts"]) == shown
        assert all(len(text) > 20 for text in frame["texts"].values())
        dots = (np.array(decode(frame["images"]["points"]))[..., 3] > 0).sum()
        assert dots <= int(re.search(r"(\d+) LIDAR", frame["texts"]["points"])[1]) < 700
    captions = page.text["figcaption"]
    assert len(page.all("figure")) == len(page.all("figcaption")) == 6
    assert len(captions) > 200


def test_grids_hold_the_classes_of_the_pipeline(frames, results):
    for frame, result in zip(frames, results, strict=True):
        for name, grid in (("grid", result.grid), ("refined", result.refined)):
            np.testing.assert_array_equal(np.array(decode(frame["images"][name])), grid.argmax(axis=0))


def test_first_frame_shows_without_the_script(page, frames):
    shown = {a["data-image"]: a.get("src") or a.get("href") for _, a in page.elements if "data-image" in a}
    first = frames[0]["images"]
    assert {name: uri for name, uri in shown.items() if uri} == first


def test_script_finds_the_elements_that_it_changes(html, page):
    script = html[html.rindex("<script>") :]
    ids = {a["id"] for _, a in page.elements if "id" in a}
    assert set(re.findall(r'getElementById\("(\w+)"\)', script)) <= ids
    assert sum(a.get("class") == "arrows" for _, a in page.elements) == 1


def test_overview_is_a_picture(out):
    with Image.open(out / "overview.png") as image:
        assert min(image.size) > 500


def test_nothing_else_is_written(out):
    assert {path.name for path in out.iterdir()} == {"index.html", "overview.png"}


def test_metrics_are_those_of_the_results(results, html):
    truths, guesses = [], {"network": [], "network + CRF": []}
    for result in results[1:]:
        truths.append(grid_truth(result.frame.labels, result.belief.probability, GridSpec.compact()).ravel())
        guesses["network"].append(result.grid.argmax(axis=0).ravel())
        guesses["network + CRF"].append(result.refined.argmax(axis=0).ravel())
    truth = np.concatenate(truths)
    for name, parts in guesses.items():
        guess = np.concatenate(parts)
        for cells, kept in (("all cells", truth >= 0), ("semantic cells", truth < 10)):
            found = scores_in(html, f"{cells}, {name}")
            matrix = confusion_matrix(truth[kept], guess[kept], 14)
            expected = [100 * metric(matrix) for metric in METRICS.values()]
            np.testing.assert_allclose(found, expected, atol=0.051)


def scores_in(html, name):
    """The numbers in a row of the table."""
    cells = re.search(rf"<tr><th>{re.escape(name)}</th>(.*?)</tr>", html)[1]
    return [float(value) for value in re.findall(r"<td>([\d.]+)</td>", cells)]


def test_times_are_medians_of_the_stages():
    record = Record(GridSpec.compact(), KITTI_14)
    record._seconds[""] = [[5.0] * 5, [0.01] * 5, [0.03, 0.01, 0.01, 0.01, 0.01]]
    assert record.milliseconds() == pytest.approx(dict(zip(STAGES, [30, 10, 10, 10, 10], strict=True)))


@pytest.fixture(scope="module")
def remembering(drive, weights, tmp_path_factory):
    folder = tmp_path_factory.mktemp("memory")
    root = str(drive.folder.parents[1])
    arguments = ["--kitti", root, "--date", DATE, "--drive", "0001", "--weights", str(weights), "--memory"]
    result = CliRunner().invoke(app, ["demo", *arguments, "--out", str(folder)])
    assert result.exit_code == 0, result.exception
    return folder


def test_the_memory_of_the_pipeline_is_shown_beside_all_else(remembering, drive, weights, frames):
    own = run_pipeline(drive, load_net(weights, drive.camera), memory=True)
    shown = json.loads(Page((remembering / "index.html").read_text(encoding="utf-8")).text["frames"])
    for frame, without, result in zip(shown, frames, own, strict=True):
        picture = np.array(decode(frame["images"].pop("remembered")))
        np.testing.assert_array_equal(picture, result.remembered.argmax(axis=0))
        assert frame["images"] == without["images"]
        assert frame["texts"].pop("remembered").startswith("Map of classes seen from above")


def test_the_memory_is_scored_and_timed(remembering, html):
    with_memory = (remembering / "index.html").read_text(encoding="utf-8")
    for words in ("all cells, network + memory", "compare the semantic cells", "memory of classes"):
        assert words in with_memory
        assert words not in html


def test_the_memory_is_in_the_picture(remembering, out):
    with Image.open(remembering / "overview.png") as more, Image.open(out / "overview.png") as fewer:
        assert more.size == fewer.size
        assert more.tobytes() != fewer.tobytes()


def test_a_page_without_truth_says_what_to_expect_of_the_semantics(blank, html):
    assert "Expect poor semantics" in blank
    assert "can lose the ground" in blank
    assert "Expect poor semantics" not in html


def test_a_page_without_truth_shows_neither_truth_nor_metrics(blank):
    page = Page(blank)
    assert len(page.all("figure")) == 5
    assert len(page.all("table")) == 1
    assert "FmIoU" not in blank


@pytest.mark.usefixtures("no_overview")
class TestCard:
    def test_a_card_beside_the_weights_says_what_is_known_instead(self, weights, tmp_path):
        write_tiny_drive(tmp_path, n_frames=1, labelled=())
        shutil.copy(weights, tmp_path / "net.safetensors")
        words = "What is known of <other> streets. Half of it."
        (tmp_path / "card.json").write_text(json.dumps({"other_streets": words}))
        page = write_demo(KittiRawDrive(tmp_path, DATE, "0001"), tmp_path / "net.safetensors", tmp_path / "out")
        html = page.read_text(encoding="utf-8")
        assert "Expect poor semantics" not in html
        assert "<b>What is known of &lt;other&gt; streets.</b></summary><p>Half of it." in html
        assert "can lose the ground" in html

    def test_scores_of_a_drive_from_which_the_network_has_learned_are_called_so(self, weights, tmp_path):
        write_tiny_drive(tmp_path, n_frames=1, labelled=(0,))
        shutil.copy(weights, tmp_path / "net.safetensors")
        drive = KittiRawDrive(tmp_path, DATE, "0001")
        for learned in (["another"], ["another", drive.folder.name]):
            (tmp_path / "card.json").write_text(json.dumps({"learned_drives": learned}))
            page = write_demo(drive, tmp_path / "net.safetensors", tmp_path / "out").read_text(encoding="utf-8")
            assert ("How often it is right on frames from which it has learned</b>" in page) == (len(learned) == 2)

    def test_a_damaged_card_is_refused_before_the_work(self, weights, tmp_path):
        write_tiny_drive(tmp_path, n_frames=1, labelled=())
        shutil.copy(weights, tmp_path / "net.safetensors")
        (tmp_path / "card.json").write_text("{")
        with pytest.raises(DataError, match=r"card\.json"):
            write_demo(KittiRawDrive(tmp_path, DATE, "0001"), tmp_path / "net.safetensors", tmp_path / "out")
        assert not (tmp_path / "out").exists()


class TestBothStreets:
    """Without a drive the demo shows the shipped ones, the real street first."""

    @pytest.fixture(scope="class")
    @staticmethod
    def folder(tmp_path_factory):
        folder = tmp_path_factory.mktemp("both")
        result = CliRunner().invoke(app, ["demo", "--out", str(folder), "--frames", "3:4"])
        assert result.exit_code == 0, result.exception
        assert f"open {(folder / 'index.html').as_uri()}" in result.output
        return folder

    def test_each_page_leads_to_the_other(self, folder):
        for place, other in ((folder, folder / "simulated"), (folder / "simulated", folder)):
            (link,) = Page((place / "index.html").read_text(encoding="utf-8")).all("a")
            assert (place / link["href"]).resolve() == (other / "index.html").resolve()
            assert {path.name for path in place.iterdir()} >= {"index.html", "overview.png"}

    def test_the_real_street_comes_first_and_says_whose_it_is(self, folder):
        real, simulated = ((folder / name / "index.html").read_text(encoding="utf-8") for name in (".", "simulated"))
        assert "2019_05_11_drive_0002_sync" in real
        assert "2026_01_01_drive_0001_sync" in simulated
        assert "Data: PandaSet by Hesai and Scale AI, CC BY 4.0" in real
        assert "PandaSet" not in simulated
        assert '<details class="notice">' not in simulated

    def test_what_the_truth_leaves_out_is_white_and_explained(self, folder):
        real, simulated = ((folder / name / "index.html").read_text(encoding="utf-8") for name in (".", "simulated"))
        truth = np.array(decode(json.loads(Page(real).text["frames"])[0]["images"]["truth"]))
        assert (truth == 255).mean() > 0.03
        for words in ("White cells are left out", "left out</span>"):
            assert words in real
            assert words not in simulated

    def test_the_picture_of_a_real_street_has_words_below(self, folder):
        with Image.open(folder / "overview.png") as real, Image.open(folder / "simulated/overview.png") as simulated:
            assert real.size[0] == simulated.size[0]
            assert real.size[1] > simulated.size[1]


class TestPanels:
    SPEC = GridSpec(x_min=0, x_max=20, y_min=-5, y_max=5, cell=1)
    CAMERA = Camera(
        np.array([[10.0, 0, 9.5], [0, 10, 4.5], [0, 0, 1]]),
        np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]]),
        size=(10, 20),
    )

    def test_an_arrow_runs_from_its_cell_to_half_a_second_later_left_is_left(self):
        probability, velocity = np.zeros((4, 20, 10)), np.full((2, 20, 10), np.nan)
        probability[2, 9, 2] = 1
        velocity[:, 9, 2] = 4.0, 2.0
        path = arrows_path(self.SPEC, probability, velocity)
        assert path.startswith("M-2.50 -10.50L-3.50 -12.50M")

    def test_lines_of_sight_follow_eq_1(self):
        svg = grid_svg("grid", self.SPEC, self.CAMERA, "data:image/png;base64,", "")
        assert "data-arrows" not in svg
        left, right = re.findall(
            r"M-?0\.00 -?0\.00L(-?[\d.]+) (-?[\d.]+)", re.search(r'class="sight" d="([^"]+)"', svg)[1]
        )
        assert float(left[0]) / float(left[1]) == pytest.approx(1, abs=1e-3)
        assert float(right[0]) / float(right[1]) == pytest.approx(-1, abs=1e-3)

    @pytest.mark.parametrize(("scale", "side"), [(1, 1), (41, 2), (62, 3)])
    def test_returns_cover_their_pixel_and_near_ones_cover_far_ones(self, scale, side):
        camera = self.CAMERA.resized((10 * scale, 20 * scale))
        points = np.array([[20, 0.1, 0.1, 0], [5, 0, 0, 0], [20, -0.2, 0, 0], [-5, 0, 0, 0]], np.float32)
        layer = points_layer(Frame(None, points, camera, np.eye(4), 0.0))
        assert layer.shape == (10 * scale, 20 * scale, 4)
        near = np.argwhere((layer == [*depth_colours(np.array(5.0)), 255]).all(axis=-1))
        assert len(near) == side**2
        assert np.abs(near.mean(axis=0) - camera.K[[1, 0], 2]).max() <= 0.5

    def test_the_surer_the_more_opaque(self):
        scores = np.zeros((14, 1, 3), np.float32)
        scores[3, 0, 1:] = 2.0, 2000.0
        layer = scores_layer(scores, KITTI_14)
        assert (np.diff(layer[0, :, 3].astype(int)) > 0).all()
        np.testing.assert_array_equal(layer[0, 1:, :3], [KITTI_14.rgb[3]] * 2)

    def test_class_pictures_have_the_colours_of_the_label_set(self):
        labels = np.array([[0, 13, 255]], np.uint8)
        painted = np.array(decode(classes_uri(labels, KITTI_14)).convert("RGB"))
        np.testing.assert_array_equal(painted, KITTI_14.colours(labels))

    def test_names_are_escaped_and_frames_cannot_end_the_script(self):
        uri = raster_uri(np.zeros((2, 2, 3), np.uint8))
        names = ("photo", "points", "scores", "occupancy", "grid", "refined")
        texts = dict.fromkeys(names[1:], '</script><b a="')
        view = FrameView("</script>", dict.fromkeys(names, uri), texts, {"occupancy": ""})
        record = Record(self.SPEC, LabelSet("two", ("<u>", "car"), ((1, 2, 3), (4, 5, 6)), 2, ()))
        record.views.append(view)
        record._occurs[0] = True
        record._seconds[""] = [[0.1] * 5]
        html = page_html(record, "<i>&", self.CAMERA, (96, 320), {"uses_return_heights": False})
        page = Page(html)
        assert "<i>&" not in html
        assert "<u>" not in html
        assert json.loads(page.text["frames"])[0]["texts"] == texts


@pytest.mark.usefixtures("no_overview")
class TestMistakes:
    def test_a_failed_run_leaves_no_page(self, weights, tmp_path):
        folder = write_tiny_drive(tmp_path)
        (folder / "velodyne_points" / "data" / "0000000000.bin").write_bytes(b"\0" * 7)
        with pytest.raises(DataError, match=r"0000000000\.bin"):
            write_demo(KittiRawDrive(tmp_path, DATE, "0001"), weights, tmp_path / "out")
        assert not (tmp_path / "out").exists()

    def test_a_later_frame_that_cannot_be_read_ends_the_page(self, weights, tmp_path):
        folder = write_tiny_drive(tmp_path)
        (folder / "velodyne_points" / "data" / "0000000002.bin").write_bytes(b"\0" * 7)
        drive, saved = KittiRawDrive(tmp_path, DATE, "0001"), tmp_path / "saved"
        with pytest.raises(DataError, match=r"0000000002\.bin.*index.html shows the frames before it, as .*saved does"):
            write_demo(drive, weights, tmp_path / "out", save=saved)
        assert np.load(saved / "frames.npz")["frame"].tolist() == [0, 1]
        html = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
        assert len(json.loads(Page(html).text["frames"])) == 2
        assert "could not be read to its end" in html
        assert "0000000002.bin" in html

    def test_damaged_frames_are_left_out_on_request(self, weights, tmp_path):
        folder = write_tiny_drive(tmp_path, n_frames=5)
        (folder / "velodyne_points" / "data" / "0000000000.bin").write_bytes(b"\0")
        (folder / "image_02" / "data" / "0000000003.png").write_bytes(b"no image")
        told, out, saved = [], tmp_path / "out", tmp_path / "saved"
        drive = KittiRawDrive(tmp_path, DATE, "0001")
        html = write_demo(drive, weights, out, skipped=told.append, save=saved).read_text("utf-8")
        assert np.load(saved / "frames.npz")["frame"].tolist() == [1, 2, 4]
        shown = [frame["clock"] for frame in json.loads(Page(html).text["frames"])]
        assert shown == ["frame 1, 0.1 s", "frame 2, 0.2 s", "frame 4, 0.4 s"]
        assert [line.partition(": ")[0] for line in told] == ["frame 0", "frame 3"]
        assert "<b>Damaged frames were left out: 2.</b>" in html
        assert "0000000003.png: expected a sound PNG image" in html

    def test_a_gap_is_marked(self, weights, tmp_path):
        folder = write_tiny_drive(tmp_path)
        (folder / "velodyne_points" / "data" / "0000000001.bin").unlink()
        html = write_demo(KittiRawDrive(tmp_path, DATE, "0001"), weights, tmp_path / "out").read_text(encoding="utf-8")
        clocks = [frame["clock"] for frame in json.loads(Page(html).text["frames"])]
        assert clocks == ["frame 0, 0.0 s", "frame 1, 0.1 s, no scan: predicted", "frame 2, 0.2 s"]

    def test_a_folder_that_cannot_be_made_is_known_before_any_frame_is_read(self, weights, tmp_path):
        folder = write_tiny_drive(tmp_path)
        (folder / "velodyne_points" / "data" / "0000000000.bin").unlink()
        (tmp_path / "file").touch()
        with pytest.raises(DataError, match="expected a folder, found the file"):
            write_demo(KittiRawDrive(tmp_path, DATE, "0001"), weights, tmp_path / "file" / "out")


@pytest.mark.usefixtures("no_overview")
class TestChoice:
    """`--frames`, `--weights` and `--camera`."""

    def test_frames_are_those_of_a_slice_and_all_between_are_run(self, weights, tmp_path, monkeypatch):
        write_tiny_drive(tmp_path, n_frames=6)
        read, original = [], KittiRawDrive._points
        monkeypatch.setattr(KittiRawDrive, "_points", lambda drive, k: read.append(k) or original(drive, k))
        page = Page(
            write_demo(KittiRawDrive(tmp_path, DATE, "0001"), weights, tmp_path, frames="1:5:2").read_text("utf-8")
        )
        shown = [frame["clock"] for frame in json.loads(page.text["frames"])]
        assert shown == ["frame 1, 0.1 s", "frame 3, 0.3 s"]
        assert sorted(set(read)) == [1, 2, 3, 4]

    def test_the_page_says_which_frames_it_shows(self, weights, tmp_path):
        write_tiny_drive(tmp_path, n_frames=6)
        html = write_demo(KittiRawDrive(tmp_path, DATE, "0001"), weights, tmp_path, frames=":5:2").read_text("utf-8")
        assert "3 frames of the drive" in html
        assert "(one in 2 of frames 0 to 4; it has 6)" in html

    def test_another_network_is_taken_and_one_of_the_image_stage_refused(self, drive, tmp_path):
        root = str(drive.folder.parents[1])
        options = ["demo", "--kitti", root, "--date", DATE, "--drive", "0001", "--out", str(tmp_path), "--frames", ":1"]
        stage = CliRunner().invoke(app, [*options, "--weights", str(sample_image_stage("fcn"))])
        assert "image stage" in str(stage.exception)
        result = CliRunner().invoke(app, [*options, "--weights", str(sample_weights("fcn"))])
        assert result.exit_code == 0, result.output

    def test_the_shipped_drive_has_one_camera(self):
        result = CliRunner().invoke(app, ["demo", "--camera", "image_03"])
        assert "--camera" in str(result.exception)


@pytest.mark.parametrize("wanted", ["4", "a:b", "0:4:0", "9:", "3:2", "1:2:3:4", "-3:", "0:1000", ":7"])
def test_a_choice_of_no_frame_is_refused(wanted):
    with pytest.raises(ArgumentError, match=r"--frames.*0:6:2"):
        ChosenFrames.of(6, wanted)


@given(st.integers(1, 400), st.data())
def test_a_choice_is_what_python_slices(n_frames, data):
    first, last = (data.draw(st.none() | st.integers(0, n_frames)) for _ in range(2))
    step = data.draw(st.none() | st.integers(1, 9))
    numbers = list(range(n_frames))
    wanted = ":".join("" if part is None else str(part) for part in (first, last, step))
    assume(numbers[first:last])
    chosen = ChosenFrames.of(n_frames, wanted)
    assert list(chosen.run) == numbers[first:last]
    assert list(chosen.shown) == numbers[first:last][:: chosen.shown.step]
    assert chosen.shown.step == step or (step is None and len(chosen.shown) <= 40)
    assert (chosen.told(n_frames) == "") == (list(chosen.shown) == numbers)


def test_a_long_drive_is_shown_evenly_spaced_and_counted_whole(results):
    record = Record(GridSpec.compact(), KITTI_14, range(0, 3, 2))
    for result in results:
        record.add(result)
    assert [view.clock for view in record.views] == ["frame 0, 0.0 s", "frame 2, 0.2 s"]
    assert record.labelled == 2
    assert SimpleNamespace(**record.metrics()).FmIoU.keys() == record.metrics()["pixel accuracy"].keys()


@pytest.mark.parametrize(
    ("pixels", "classes", "said"),
    [
        (0.888, 0.872, "makes this map worse: class accuracy over semantic cells is 94.8 % without it and 87.2 % with"),
        (0.92, 0.872, "costs class accuracy, though not pixel accuracy: class accuracy"),
        (0.888, 0.95, ""),
    ],
)
def test_a_crf_that_costs_class_accuracy_is_named(pixels, classes, said):
    without, refined = "semantic cells, network", "semantic cells, network + CRF"
    scores = {"pixel accuracy": {without: 0.915, refined: pixels}, "class accuracy": {without: 0.948, refined: classes}}
    assert said in _crf_costs(scores)
    assert bool(_crf_costs(scores)) == bool(said)
