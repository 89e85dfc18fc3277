"""The stories that the page tells: their bytes, and the script that reads them, against `cell_story`."""

import base64
import json
import shutil
import subprocess
import zlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from read_page import Page
from told_story import memory_of, told_story

import semgrid_edu.workshop.demo.page as page_module
from semgrid_edu.datasets.samples import sample_drive, sample_weights
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import load_net, save_net
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.workshop.demo import record, run, write_demo
from semgrid_edu.workshop.demo.details import FILTER_STEPS, STEPS, VERDICTS, frame_details, states_bytes
from semgrid_edu.workshop.demo.record import Record
from semgrid_edu.workshop.demo.run import STORIES, _stories_every

SPEC = GridSpec.compact()
CELLS = [(81, 31), (82, 25), (120, 33), (30, 5), (0, 0), (141, 61)]
SCRIPTS = Path(page_module.__file__).parent


@pytest.fixture(scope="module")
def page(last_labelled, net, tmp_path_factory):
    """The page of a drive with memory; only its last frame has stories, because they take most of the time."""
    folder = tmp_path_factory.mktemp("out")
    save_net(net, folder / "net.safetensors")
    last, none = len(last_labelled) - 1, SimpleNamespace(layout=dict, packed=str)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "save_overview", lambda *_: None)
        patch.setattr(record, "frame_details", lambda *args: frame_details(*args) if len(args[2]) == last else none)
        written = write_demo(last_labelled, folder / "net.safetensors", folder, memory=True)
    return Page(written.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def maps(page):
    """The maps of the last frame, read back with nothing of the page's own."""
    story = json.loads(page.text["storydata"])
    return unpacked(json.loads(page.text["frames"])[-1]["details"], story["layout"])


def unpacked(uri, layout):
    kind, details = uri.split(",")
    assert kind == "data:application/zlib;base64"
    raw = np.frombuffer(zlib.decompress(base64.b64decode(details, validate=True)), np.uint8)
    n_cells, maps = SPEC.shape[0] * SPEC.shape[1], {}
    assert len(raw) == n_cells * sum(number for _, number, _, _ in layout.values())
    for name, (start, number, step, stride) in layout.items():
        index = start + step * np.arange(number)[:, None] + stride * np.arange(n_cells)
        maps[name] = raw[index].reshape(number, *SPEC.shape)
        if stride == 1:
            maps[name] = np.cumsum(maps[name], axis=1, dtype=np.uint8)
    return maps


def test_bytes_hold_what_the_scan_says(maps, stories):
    for story in stories:
        at = (0, *story.cell)
        assert maps["obstacles"][at] == story.scan.obstacles
        assert maps["ground"][at] == story.scan.ground
        assert VERDICTS[maps["verdict"][at]] == story.scan.verdict
        assert maps["reach"][at] * STEPS["reach"] == pytest.approx(story.scan.reach, abs=STEPS["reach"] / 2)


def test_bytes_hold_classes_and_their_probabilities(maps, stories):
    for story in stories:
        classes = [story.label, story.rival, story.refined]
        assert maps["classes"][:, *story.cell].tolist() == [*classes, story.truth]
        np.testing.assert_allclose(maps["before"][:, *story.cell], 255 * story.before[classes], atol=0.51)
        np.testing.assert_allclose(maps["after"][:, *story.cell], 255 * story.after[classes], atol=0.51)


def test_bytes_hold_the_distance_of_each_place(page, stories):
    data = json.loads(page.text["storydata"])
    high, low = unpacked(data["places"], data["places_layout"])["distance"].astype(int)
    for story in stories:
        found = 256 * high[story.cell] + low[story.cell]
        assert STEPS["distance"] * found == pytest.approx(story.scan.distance, abs=0.051)


def test_states_sum_to_255_and_none_is_negative():
    probability = np.random.default_rng(1).dirichlet([0.05] * 4, (50, 40)).transpose(2, 0, 1).astype(np.float32)
    known = states_bytes(probability).astype(int)
    assert (known.sum(axis=0) == 255).all()
    np.testing.assert_allclose(known, 255 * probability, atol=1.001)


@pytest.mark.parametrize(("n_shown", "every"), [(1, 1), (20, 1), (22, 1), (23, 2), (40, 2)])
def test_a_long_drive_has_stories_of_some_frames(n_shown, every):
    assert _stories_every(n_shown, SPEC) == every
    assert -(-n_shown // every) * SPEC.shape[0] * SPEC.shape[1] <= STORIES


@pytest.fixture(scope="module")
def node():
    """What runs the page's script."""
    return shutil.which("node") or pytest.skip("needs node, to run the page's script")


@pytest.fixture(scope="module")
def read(page, node, tmp_path_factory):
    """What the script reads, run by node on the page's own data."""
    program = tmp_path_factory.mktemp("node") / "tell.js"
    cells = [row * SPEC.shape[1] + col for row, col in CELLS]
    program.write_text(
        f"{(SCRIPTS / 'story.js').read_text(encoding='utf-8')}\n"
        f"const story = {page.text['storydata']}, frames = {page.text['frames']}, cells = {cells};\n"
        """
        (async () => {
          const now = frames[frames.length - 1];
          const places = await unpack(story.grid, story.places_layout, story.places);
          const read = await unpack(story.grid, story.layout, now.details);
          console.log(JSON.stringify(cells.map((cell) => ({
            steps: story.filter_steps.map((name) => states(story, read, name, cell)),
            parts: parts(story, read, cell), centre: centre(story.grid, cell), pixels: pixels(story, places, cell),
            then: frames.map((f) => cellThen(story.grid, f.pose, now.pose, cell)),
            messages: messages(story, read, cell), strongest: strongest(story, read, cell),
            sentences: sentences(story, read, cell),
          }))));
        })();
        """,
        encoding="utf-8",
    )
    told = subprocess.run([node, str(program)], capture_output=True, text=True, check=True, timeout=120)
    return json.loads(told.stdout)


def test_the_script_reads_states(read, stories):
    for one, story in zip(read, stories, strict=True):
        np.testing.assert_allclose(np.sum(one["steps"], axis=1), 1, atol=1e-12)
        for name, states in zip(FILTER_STEPS, one["steps"], strict=True):
            np.testing.assert_allclose(states, story.steps[name], atol=0.005)


def test_the_script_reads_parts(read, stories):
    for one, story in zip(read, stories, strict=True):
        parts, why = one["parts"], story.why
        np.testing.assert_allclose(parts["planes"], why.planes, atol=0.051)
        np.testing.assert_allclose(parts["scores"], why.classes, atol=0.051)
        np.testing.assert_allclose(parts["occupancy"], why.occupancy, atol=0.051)
        image, occupancy, rest, score = parts["totals"]
        assert image + occupancy + rest == pytest.approx(score)
        assert score == pytest.approx(why.score, abs=0.051)
        assert rest == pytest.approx(why.rest, abs=0.151)
        assert parts["times"] == pytest.approx(np.exp(why.score), rel=0.051)


def test_the_script_reads_sentences(read, stories, story_maps, told):
    for one, story in zip(read, stories, strict=True):
        memory = memory_of(told[-1].remembered, story_maps.sight, story.cell, len(told) - 1)
        assert one["sentences"] == told_story(story, memory)


def test_the_script_reads_points_above_a_cell(read, stories):
    for one, story in zip(read, stories, strict=True):
        assert one["centre"] == pytest.approx(story.xy)
        assert [point is not None for point in one["pixels"]] == story.visible.tolist()
        uv = np.array([point for point in one["pixels"] if point]).reshape(-1, 2)
        np.testing.assert_allclose(uv, story.pixels[story.visible], atol=STEPS["pixel"] / 2)


def test_the_script_follows_a_place_through_the_poses(read):
    for one, (row, col) in zip(read, CELLS, strict=True):  # the vehicle drives two rows a frame
        then = [(row - 2 * back) * SPEC.shape[1] + col if row >= 2 * back else -1 for back in (2, 1, 0)]
        assert one["then"] == then


def test_the_script_reads_neighbours(read, stories, story_maps):
    for one, story in zip(read, stories, strict=True):
        expected = story.messages[[story.label, story.rival, story.refined]]
        np.testing.assert_allclose(one["messages"], expected, atol=0.051)
        rows, cols = np.reshape(story.cell, (2, 1)) + story_maps.neighbours.steps[:, :, *story.cell]
        assert [neighbour["cell"] for neighbour in one["strongest"]] == (rows * SPEC.shape[1] + cols).tolist()
        pulls = [neighbour["pull"] for neighbour in one["strongest"]]
        np.testing.assert_allclose(pulls, story_maps.neighbours.pull[:, *story.cell], atol=0.051)


@pytest.mark.parametrize("name", ["page.js", "story.js", "panel.js"])
def test_scripts_are_written_without_mistakes_of_grammar(name, node):
    subprocess.run([node, "--check", str(SCRIPTS / name)], check=True, capture_output=True, timeout=60)


def test_the_page_of_the_shipped_drive_stays_below_12_and_a_half_megabytes():
    """Judged by one of its frames: the pages of the others differ by little."""
    shipped = sample_drive()
    net = load_net(sample_weights(), shipped.camera)
    recorded = Record(SPEC, KITTI_14, net=net)
    for result in run_pipeline(shipped[8:9], Stages.fast(net, keep_steps=True)):
        recorded.add(result)
    assert len(shipped) * len(json.dumps(vars(recorded.views[0]))) < 12.4e6
    assert _stories_every(len(shipped), SPEC) == 1
