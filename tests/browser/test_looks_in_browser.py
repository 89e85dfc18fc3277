"""How the demo's page looks in a browser: on a phone, in the dark, and to those who need contrast."""

import re
import shutil

import numpy as np
import pytest
from read_page import decode
from tiny_drive import DATE, write_tiny_drive

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.samples import sample_drive, sample_weights
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import Architecture, build_net, save_net
from semgrid_edu.workshop import demo
from semgrid_edu.workshop.demo import example_stages, run

PHONE = {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True}
CELL = "#5/100/24"

BROKEN_WORDS = """(all) => {
  const broken = [];
  for (const element of all) {
    const walker = document.createTreeWalker(element, NodeFilter.SHOW_TEXT);
    for (let node; (node = walker.nextNode()); ) {
      for (const { 0: word, index } of node.data.matchAll(/[^\\s_-]+_?/g)) {
        const range = document.createRange();
        range.setStart(node, index);
        range.setEnd(node, index + word.length);
        if (new Set([...range.getClientRects()].map((box) => Math.round(box.top))).size > 1) broken.push(word);
      }
    }
  }
  return broken;
}"""
"""Words of some elements that stand on more than one line."""

CONTRAST = """(all) => all.map((element) => {
  const luminance = (colour) => colour.match(/[\\d.]+/g).slice(0, 3).map(Number)
    .map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4))
    .reduce((total, c, i) => total + [0.2126, 0.7152, 0.0722][i] * c, 0);
  let ground = element;
  while (!getComputedStyle(ground).backgroundColor.startsWith("rgb(")) ground = ground.parentElement; // see-through
  const [a, b] = [getComputedStyle(element).color, getComputedStyle(ground).backgroundColor].map(luminance);
  return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
})"""
"""Contrast of some elements' text with what it stands on, by the definition of WCAG 2."""


@pytest.fixture(scope="module")
def tiny_page(browser, tmp_path_factory):
    """A comparison with a student's stages, over a gap, with stories of every other frame."""
    root = tmp_path_factory.mktemp("tiny")
    folder = write_tiny_drive(root, n_frames=4, labelled=(0, 2))
    (folder / "velodyne_points" / "data" / "0000000002.bin").unlink()
    drive = KittiRawDrive(root, DATE, "0001")
    save_net(build_net(Architecture(), drive.camera, seed=3), root / "net.safetensors")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "STORIES", 20_000)
        return demo.write_demo(drive, root / "net.safetensors", root / "out", stages=example_stages.__file__)


@pytest.fixture(scope="module")
def unlabelled_page(browser, tmp_path_factory):
    """Eight of the shipped frames, without their labels."""
    root = tmp_path_factory.mktemp("unlabelled")
    shipped = sample_drive().date_folder
    shutil.copytree(shipped, root / shipped.name, ignore=shutil.ignore_patterns("labels"))
    return demo.write_demo(KittiRawDrive(root, shipped.name, "0001"), sample_weights(), root / "out", frames="0:8")


@pytest.fixture(params=["shipped", "tiny"])
def phone(request, open_page):
    """Either page on a phone, with a cell's story."""
    page = open_page(request.getfixturevalue(f"{request.param}_page"), "#0/100/30", **PHONE)
    page.locator("#telling h3").first.wait_for()
    return page


class TestPhone:
    def test_nothing_reaches_over_the_side(self, phone):
        sizes = "[document.documentElement.scrollWidth, innerWidth, visualViewport.scale]"
        assert phone.evaluate(sizes) == [390, 390, 1]
        for folded in phone.locator("#telling summary").all():
            folded.click()
        phone.locator("#zoom").select_option("4")
        assert phone.evaluate(sizes) == [390, 390, 1]
        assert phone.locator(".tables > *").evaluate_all(
            "(all) => all.every((one) => one.scrollWidth <= one.clientWidth)"
        )
        over = phone.locator("body *:visible").evaluate_all(
            "(all) => all.filter((one) => !one.closest('.aloud, svg *') && one.getBoundingClientRect().right > 390.5)"
            ".map((one) => one.outerHTML.slice(0, 80))"
        )
        assert over == []

    def test_the_slider_is_as_wide_as_the_page(self, phone):
        slider, text = (phone.locator(one).bounding_box() for one in ("#slider", ".photos"))
        assert (slider["x"], slider["width"]) == pytest.approx((text["x"], text["width"]), abs=5)
        assert slider["width"] > 350

    def test_no_word_of_legend_tables_and_buttons_is_broken(self, phone):
        for part in (".legend", "table", "button", ".story h3, .story h4", ".pick"):
            assert phone.locator(part).evaluate_all(BROKEN_WORDS) == []
        names = phone.locator(".legend span").evaluate_all("(all) => all.map((one) => one.getClientRects().length)")
        assert set(names) == {1}

    def test_names_of_axes_and_their_numbers_keep_apart(self, phone):
        for svg in phone.locator("svg[data-grid]").all():
            phone.locator("#zoom").select_option("1")
            name = svg.locator("text[transform]").bounding_box()
            numbers = [one.bounding_box() for one in svg.locator("text.x").all()]
            assert name["x"] + name["width"] <= min(one["x"] for one in numbers) + 0.5
            assert name["x"] >= svg.bounding_box()["x"] - 1

    def test_the_controls_keep_their_height_over_a_gap(self, phone):
        heights = set()
        for k in range(4):
            phone.locator("#slider").fill(str(k))
            heights.add(phone.locator(".controls").bounding_box()["height"])
        assert len(heights) == 1

    def test_a_tap_chooses_a_cell(self, phone):
        svg = phone.locator("svg[data-grid=refined]")
        svg.scroll_into_view_if_needed()
        svg.tap()
        phone.locator("#telling", has_text="row 100, column 30)").wait_for(state="detached")
        assert phone.locator("[data-marks=grid] .mark").count() == 1


@pytest.mark.parametrize("scheme", ["light", "dark"])
class TestColours:
    def test_the_legend_has_the_colours_that_are_drawn(self, shipped, shipped_frames, scheme):
        page = shipped("#0", color_scheme=scheme)
        legend = dict(
            page.locator(".legend span:not(.way)").evaluate_all(
                "(all) => all.map((one) => [one.innerText, getComputedStyle(one, '::before').backgroundColor])"
            )
        )
        drawn = page.evaluate(
            """async (uris) => {
                 const found = new Set();
                 for (const uri of uris) {
                   const { data } = await decode(uri);
                   for (let i = 0; i < data.length; i += 4) found.add(`rgb(${data.slice(i, i + 3).join(", ")})`);
                 }
                 return [...found];
               }""",
            [frame["images"][name] for frame in shipped_frames for name in ("grid", "refined", "truth")],
        )
        assert set(drawn) <= set(legend.values())
        assert len(set(legend.values())) == len(legend), "no two entries share a colour"
        assert legend["dynamic"] != legend["unknown-dynamic"]
        states = page.evaluate("story.colours.states.map((one) => `rgb(${one.join(', ')})`)")
        assert states == [legend[name] for name in ("free", "static", "dynamic", "unknown")]

    def test_an_arrow_in_the_legend_looks_like_one_in_the_grid(self, shipped, scheme):
        page = shipped(color_scheme=scheme)
        drawn = page.locator(".arrows").evaluate("(path) => getComputedStyle(path).stroke")
        assert page.locator(".legend .way").evaluate("(one) => getComputedStyle(one, '::before').color") == drawn

    def test_a_picture_is_the_same_in_both(self, shipped, scheme):
        page = shipped(color_scheme=scheme)
        for name in ("occupancy", "grid"):
            style = page.locator(f"image[data-image={name}]").evaluate(
                "(one) => ['filter', 'opacity', 'mixBlendMode'].map((name) => getComputedStyle(one)[name])"
            )
            assert style == ["none", "1", "normal"]

    def test_text_can_be_read(self, shipped, scheme):
        page = shipped(CELL, color_scheme=scheme)
        page.locator("#telling h3").first.wait_for()
        parts = (
            "p, h1, h2, h3, h4, figcaption, figcaption b, figcaption i, caption, th, td, th i, button, output, .pick"
        )
        contrast = page.locator(f":is({parts}):visible").evaluate_all(CONTRAST)
        assert len(contrast) > 100
        assert min(contrast) >= 4.5


def contrast(a, b) -> float:
    """The contrast of two colours by the definition of WCAG 2, from 1 to 21."""
    linear = np.where(
        np.divide((a, b), 255) <= 0.04045, np.divide((a, b), 3294.6), ((np.divide((a, b), 255) + 0.055) / 1.055) ** 2.4
    )
    dark, light = sorted(linear @ (0.2126, 0.7152, 0.0722))
    return (light + 0.05) / (dark + 0.05)


def test_a_mark_shows_on_every_class(shipped):
    page = shipped(CELL)
    page.locator("#telling h3").first.wait_for()
    strokes = [
        [
            int(part)
            for part in re.findall(
                r"\d+",
                page.locator(f"[data-marks=grid] .{one}").first.evaluate("(one) => getComputedStyle(one).stroke"),
            )
        ]
        for one in ("mark", "halo")
    ]
    assert min(max(contrast(stroke[:3], rgb) for stroke in strokes) for rgb in KITTI_14.rgb) >= 3


def test_bars_of_different_times_differ_in_length(shipped):
    rows = (
        shipped("#0")
        .locator("tr.stage")
        .evaluate_all(
            "(all) => all.map((row) => "
            "[row.cells[2].innerText, row.querySelector('.share span').getBoundingClientRect().width])"
        )
    )
    longest = max(rows, key=lambda row: float(row[0]))
    for time, width in rows:
        assert width == pytest.approx(longest[1] * float(time) / float(longest[0]), abs=1.5)


def test_forced_colours_keep_the_swatches(shipped):
    page = shipped("#0", forced_colors="active")
    drawn = page.locator(".legend span[data-texture]").evaluate_all(
        "(all) => all.map((one) => [one.innerText, getComputedStyle(one, '::before').backgroundColor])"
    )
    found = {name: colour for name, colour in drawn if name in KITTI_14.names}
    assert found == {name: f"rgb{tuple(KITTI_14.rgb[KITTI_14.index(name)])}" for name in found}
    assert len(found) > 5


def test_car_and_bicycle_have_textures(shipped, shipped_frames):
    page = shipped("#5")
    layer = page.locator("image[data-textures=truth][href]")
    layer.wait_for(state="attached")
    truth = np.array(decode(shipped_frames[5]["images"]["truth"]))
    painted = page.evaluate("async (uri) => [...(await decode(uri)).data]", layer.get_attribute("href"))
    dots = np.reshape(painted, (4 * truth.shape[0], 4 * truth.shape[1], 4))[..., 3] > 0
    dots = dots.reshape(truth.shape[0], 4, truth.shape[1], 4).any(axis=(1, 3))
    np.testing.assert_array_equal(dots, np.isin(truth, [KITTI_14.index("car"), KITTI_14.index("bicycle")]))


def test_a_frame_without_a_scan_says_so(open_page, tiny_page):
    page = open_page(tiny_page, "#2/100/30")
    assert page.locator("#clock").inner_text() == "frame 2, 0.2 s, no scan: predicted"
    page.locator("#telling", has_text="This frame has no scan").wait_for()


def test_a_frame_without_stories_names_the_nearest_that_has_them(open_page, tiny_page):
    page = open_page(tiny_page, "#1/100/30")
    page.locator("#telling", has_text="The nearest frame that has it: frame 0, 0.0 s.").wait_for()
    page.locator("#slider").fill("2")
    page.locator("#telling h3").first.wait_for()


def test_a_student_s_map_says_its_class_and_no_states_of_the_package(open_page, tiny_page):
    page = open_page(tiny_page)
    page.locator("svg[data-grid=your_refined]").hover()
    page.locator("#hover").wait_for()
    page.locator("svg[data-grid=your_occupancy]").hover()
    page.locator("#hover").wait_for(state="hidden")


def test_errors_are_offered_only_where_the_truth_is_known(open_page, tiny_page, tmp_path):
    assert open_page(tiny_page).locator("#errors").is_visible()
    unlabelled = tmp_path / "index.html"
    unlabelled.write_text(tiny_page.read_text(encoding="utf-8").replace('"truth":', '"other":'), encoding="utf-8")
    assert open_page(unlabelled).locator("#errors").is_hidden()


@pytest.mark.parametrize(("width", "height", "highest"), [(1500, 1000, 620), (1100, 900, 800), (390, 844, 1300)])
def test_maps_come_first_and_the_inset_of_a_phone_is_on_phones_alone(open_page, shipped_page, width, height, highest):
    page = open_page(shipped_page, CELL, viewport={"width": width, "height": height})
    page.locator("#telling h3").first.wait_for()
    assert page.locator("#inset").evaluate("(one) => getComputedStyle(one).display") == (
        "block" if width == 390 else "none"
    )
    tops = page.locator(".grids figure").evaluate_all(
        "(all) => all.map((one) => one.getBoundingClientRect().top + scrollY)"
    )
    assert tops[0] < highest
    assert len(set(tops)) == (2 if width == 390 else 1)


@pytest.mark.parametrize("width", [1100, 1500])
def test_three_maps_fill_the_width_and_the_first_cell_is_a_near_one_that_moves(open_page, unlabelled_page, width):
    page = open_page(unlabelled_page, viewport={"width": width, "height": 1000})
    page.locator("#telling", has_text="Nobody labelled this frame.").wait_for()
    shown = page.locator("#telling > table").first.locator("tbody tr").last.locator("td").all_inner_texts()
    assert int(shown[2].removesuffix(" %")) > 50
    right = "(all) => Math.max(...all.map((one) => one.getBoundingClientRect().right))"
    assert page.locator(".grids figure").count() == 3
    assert page.locator(".grids figure").evaluate_all(right) == pytest.approx(
        page.locator(".grids").evaluate("(one) => one.getBoundingClientRect().right"), abs=1
    )
