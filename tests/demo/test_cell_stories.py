"""The stories that the page tells: their bytes, and the script that reads them, against `cell_story`."""

import base64
import json
import shutil
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest
from read_page import Page
from tiny_drive import DATE, write_tiny_drive

import semgrid_edu.workshop.demo.page as page_module
from semgrid_edu.crf import CrfParams
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.samples import sample_drive, sample_weights
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import Architecture, build_net, load_net, save_net
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.story import cell_story, weights_of_cell
from semgrid_edu.story.cell_story import label_and_rival
from semgrid_edu.workshop.demo import write_demo
from semgrid_edu.workshop.demo.details import PART_STEP, REACH_STEP, VERDICTS, label_and_rival_maps, states_bytes
from semgrid_edu.workshop.demo.record import Record
from semgrid_edu.workshop.demo.run import STORIES, _stories_every

SPEC = GridSpec.compact()
CELLS = [(81, 31), (82, 25), (120, 33), (30, 5), (0, 0), (141, 61)]
SCRIPTS = Path(page_module.__file__).parent


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root, labelled=(2,))
    return KittiRawDrive(root, DATE, "0001")


@pytest.fixture(scope="module")
def out(drive, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    save_net(build_net(Architecture(), drive.camera, seed=3), folder / "net.safetensors")
    write_demo(drive, folder / "net.safetensors", folder)
    return folder


@pytest.fixture(scope="module")
def page(out):
    return Page((out / "index.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def stories(drive, out):
    net = load_net(out / "net.safetensors", drive.camera)
    results = list(run_pipeline(drive, Stages.of(net, keep_steps=True)))
    return results, [cell_story(results[-1], cell, net, past=results[:-1]) for cell in CELLS]


@pytest.fixture(scope="module")
def maps(page):
    """The maps of the last frame, read back with nothing of the page's own."""
    story = json.loads(page.text["storydata"])
    kind, details = json.loads(page.text["frames"])[-1]["details"].split(",")
    assert kind == "data:application/zlib;base64"
    raw = zlib.decompress(base64.b64decode(details, validate=True))
    whole = np.frombuffer(raw, np.uint8).reshape(-1, *SPEC.shape)
    ends = np.cumsum(list(story["layout"].values()))
    assert ends[-1] == len(whole)
    return dict(zip(story["layout"], np.split(whole, ends[:-1]), strict=True))


class TestBytes:
    def test_states_of_every_step(self, maps, stories):
        for story in stories[1]:
            for name, states in story.steps.items():
                known = maps[name][:, *story.cell].astype(int)
                np.testing.assert_allclose([*known, 255 - known.sum()], 255 * states, atol=1.001)

    def test_what_the_scan_says(self, maps, stories):
        for story in stories[1]:
            at = (0, *story.cell)
            assert maps["obstacles"][at] == len(story.scan.obstacles)
            assert maps["ground"][at] == len(story.scan.ground)
            assert VERDICTS[maps["verdict"][at]] == story.scan.verdict
            assert maps["reach"][at] * REACH_STEP == pytest.approx(story.scan.reach, abs=REACH_STEP / 2)

    def test_parts_of_the_score(self, maps, stories):
        for story in stories[1]:
            why = story.for_label.minus(story.for_rival)
            for name, axis in (("planes", 0), ("scores", 1)):
                parts = PART_STEP * (maps[name][:, *story.cell].astype(int) - 128)
                np.testing.assert_allclose(parts, why.planes.sum(axis=axis), atol=0.051)
            high, low = np.split(maps["large"][:, *story.cell].astype(int), 2)
            large = PART_STEP * (256 * high + low - 2**15)
            np.testing.assert_allclose(large, [*why.occupancy, why.score], atol=0.051)

    def test_classes_and_their_probabilities(self, maps, stories):
        for story in stories[1]:
            classes = [story.label, story.rival, story.refined]
            assert maps["classes"][:, *story.cell].tolist() == [*classes, story.truth]
            np.testing.assert_allclose(maps["before"][:, *story.cell], 255 * story.pull.before[classes], atol=0.51)
            np.testing.assert_allclose(maps["after"][:, *story.cell], 255 * story.pull.after[classes], atol=0.51)
            at = (slice(None), *story.cell)
            np.testing.assert_allclose(maps["neighbours"][at], 255 * story.pull.neighbours[at], atol=0.51)

    def test_states_sum_to_255_and_none_is_negative(self):
        probability = np.random.default_rng(1).dirichlet([0.05] * 4, (50, 40)).transpose(2, 0, 1).astype(np.float32)
        known = states_bytes(probability).astype(int)
        assert known.sum(axis=0).max() <= 255
        np.testing.assert_allclose(known, 255 * probability[:3], atol=1.001)

    def test_the_two_classes_of_a_cell_are_those_of_its_story(self):
        rng = np.random.default_rng(4)
        g, truth = rng.dirichlet(np.ones(6), (9, 8)).transpose(2, 0, 1), rng.choice([0, 1, 2, 3, 4, 5, 255], (9, 8))
        labels = label_and_rival_maps(g, truth)
        for cell in np.ndindex(truth.shape):
            assert tuple(int(one[cell]) for one in labels) == label_and_rival(g[:, *cell], int(truth[cell]))


@pytest.mark.parametrize(("n_shown", "every"), [(1, 1), (20, 1), (22, 1), (23, 2), (40, 2)])
def test_a_long_drive_has_stories_of_some_frames(n_shown, every):
    assert _stories_every(n_shown, SPEC) == every
    assert -(-n_shown // every) * SPEC.shape[0] * SPEC.shape[1] <= STORIES


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node, to run the page's script")
class TestScript:
    """The script's numbers, computed by node from the page's own data."""

    @pytest.fixture(scope="class")
    @staticmethod
    def told(page, tmp_path_factory):
        program = tmp_path_factory.mktemp("node") / "tell.js"
        cells = [row * SPEC.shape[1] + col for row, col in CELLS]
        program.write_text(
            f"{(SCRIPTS / 'story.js').read_text(encoding='utf-8')}\n"
            f"const story = {page.text['storydata']}, frames = {page.text['frames']}, cells = {cells};\n"
            """
            (async () => {
              const now = frames[frames.length - 1];
              const reads = await Promise.all(frames.map(async (f) => reader(story, await unpack(f.details))));
              const read = reads[reads.length - 1];
              console.log(JSON.stringify(cells.map((cell) => {
                const of = weights(story, read, cell);
                return {
                  steps: ["shown", "move", "predict", "update", "resample"].map((name) => states(read, name, cell)),
                  parts: parts(story, read, cell), centre: centre(story.grid, cell), pixels: pixels(story, cell),
                  then: frames.map((f) => cellThen(story.grid, f.pose, now.pose, cell)),
                  weights: [...of], messages: messages(story, read, of),
                  strongest: strongest(read, of, read("classes", cell)[2], 5).map(({ pull }) => pull),
                };
              })));
            })();
            """,
            encoding="utf-8",
        )
        run = subprocess.run(["node", str(program)], capture_output=True, text=True, check=True, timeout=120)
        return json.loads(run.stdout)

    def test_states_sum_to_one(self, told, stories):
        for one, story in zip(told, stories[1], strict=True):
            np.testing.assert_allclose(np.sum(one["steps"], axis=1), 1, atol=1e-12)
            np.testing.assert_allclose(one["steps"][0], story.steps["shown"], atol=0.005)

    def test_parts_sum_to_the_score(self, told, stories):
        for one, story in zip(told, stories[1], strict=True):
            parts, why = one["parts"], story.for_label.minus(story.for_rival)
            assert sum(parts["planes"]) + sum(parts["occupancy"]) + parts["rest"] == pytest.approx(parts["score"])
            assert parts["score"] == pytest.approx(why.score, abs=0.051)
            assert parts["rest"] == pytest.approx(why.rest, abs=0.051 * 25)

    def test_points_above_a_cell_follow_eq_1(self, told, stories):
        for one, story in zip(told, stories[1], strict=True):
            assert one["centre"] == pytest.approx(story.xy)
            assert [point["visible"] for point in one["pixels"]] == story.visible.tolist()
            uv = np.array([[point["u"], point["v"]] for point in one["pixels"]])
            np.testing.assert_allclose(uv[story.visible], story.pixels[story.visible], atol=1e-9)

    def test_a_place_is_followed_through_the_poses(self, told):
        for one, (row, col) in zip(told, CELLS, strict=True):  # the vehicle drives two rows a frame
            then = [(row - 2 * back) * SPEC.shape[1] + col if row >= 2 * back else -1 for back in (2, 1, 0)]
            assert one["then"] == then

    def test_neighbours_weigh_as_much_as_in_eq_4(self, told, stories):
        o = stories[0][-1].belief.probability
        for one, story in zip(told, stories[1], strict=True):
            expected, _ = weights_of_cell(o, CrfParams.for_cells(SPEC.cell), story.cell)
            found = np.zeros(SPEC.shape)
            found.ravel()[[cell for cell, _ in one["weights"]]] = [weight for _, weight in one["weights"]]
            np.testing.assert_allclose(found, expected, atol=0.03 * expected.max())
            np.testing.assert_allclose(one["messages"], story.pull.messages, atol=0.1)
            np.testing.assert_allclose(one["strongest"], story.pull.strongest(story.refined)[1], atol=0.03)

    @pytest.mark.parametrize("name", ["page.js", "story.js", "panel.js"])
    def test_is_written_without_mistakes_of_grammar(self, name):
        subprocess.run(["node", "--check", str(SCRIPTS / name)], check=True, capture_output=True, timeout=60)


def test_the_page_of_the_shipped_drive_stays_below_12_megabytes():
    """Judged by two of its frames: the pages of the others differ by little."""
    shipped = sample_drive()
    net = load_net(sample_weights(), shipped.camera)
    record = Record(SPEC, KITTI_14, net=net)
    for result in run_pipeline(shipped[8:10], Stages.of(net, keep_steps=True)):
        record.add(result)
    assert len(shipped) * max(len(json.dumps(vars(view))) for view in record.views) < 11.9e6
    assert _stories_every(len(shipped), SPEC) == 1
