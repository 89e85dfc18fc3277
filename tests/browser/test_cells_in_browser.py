"""Cells followed on the demo's page: marks, points, the story beside `cell_story`, errors, zoom and hover."""

import re

import numpy as np
import pytest
from read_page import decode
from test_looks_in_browser import PHONE
from told_story import told_story

from semgrid_edu.datasets.samples import sample_drive, sample_weights
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import load_net
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.workshop.demo import cell_story

SPEC = GridSpec.compact()
FRAME = 5
GRIDS = ("occupancy", "grid", "refined", "truth")


def classes(view, name) -> np.ndarray:
    return np.array(decode(view["images"][name]))


def cell_box(page, grid, cell) -> dict[str, float]:
    """Where a cell is on the screen, from where the browser drew its raster."""
    box = page.locator(f"image[data-image={grid}]").bounding_box()
    width, height = box["width"] / SPEC.shape[1], box["height"] / SPEC.shape[0]
    return {"x": box["x"] + cell[1] * width, "y": box["y"] + cell[0] * height, "width": width, "height": height}


def centre(box) -> tuple[float, float]:
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def point_at(page, grid, cell) -> tuple[float, float]:
    """Bring a cell into view, and return the middle of it."""
    page.locator(f"svg[data-grid={grid}]").evaluate("(svg) => svg.scrollIntoView({ block: 'center' })")
    return centre(cell_box(page, grid, cell))


def click(page, grid, cell) -> None:
    page.mouse.click(*point_at(page, grid, cell))
    told(page, cell)


def told(page, cell) -> None:
    """Wait until the panel tells of a cell."""
    page.locator("#telling", has_text=f"row {cell[0]}, column {cell[1]})").wait_for()


def number(text: str) -> float:
    return float(text.replace("−", "-").removesuffix(" %"))


def rows(page, table: str) -> dict[str, list[float]]:
    """The numbers of a table of the panel, by the head of the row."""
    found = (
        page.locator(table)
        .locator("tbody tr")
        .evaluate_all(
            "(all) => all.map((row) => [row.querySelector('th').innerText.trim(),"
            " [...row.querySelectorAll('td')].map((cell) => cell.innerText.trim())])"
        )
    )
    return {head: [number(text) for text in cells if text] for head, cells in found}


def opened_at(shipped, frame, cell, **options):
    """Open the page by the address of a cell, whose story it tells."""
    page = shipped(f"#{frame}/{cell[0]}/{cell[1]}", **options)
    told(page, cell)
    return page


@pytest.fixture(scope="module")
def cells(shipped_frames) -> dict[str, tuple[int, int]]:
    """A cell of a car, one of a pedestrian that was not found, and one that nobody has seen."""
    view = shipped_frames[FRAME]
    refined, truth = classes(view, "refined"), classes(view, "truth")
    kinds = {
        "car": (refined == KITTI_14.index("car")) & (truth == refined),
        "mistake": (refined != truth) & (truth == KITTI_14.index("pedestrian")),
        "unseen": (refined == KITTI_14.index("unknown-unobserved")) & (truth == refined),
    }
    return {name: tuple(np.argwhere(kind)[kind.sum() // 2].tolist()) for name, kind in kinds.items()}


@pytest.fixture(scope="module")
def stories(cells):
    """`cell_story` for each of the cells."""
    drive = sample_drive()
    net = load_net(sample_weights(), drive.camera)
    results = list(run_pipeline(drive[: FRAME + 1], Stages.fast(net, keep_steps=True)))
    return {name: cell_story(results[-1], cell, net, past=results[:-1]) for name, cell in cells.items()}


LINE_WIDTH = "(one) => parseFloat(getComputedStyle(one).strokeWidth) * one.getScreenCTM().a"
"""JavaScript: the width of a line, pixels."""


@pytest.mark.parametrize("grid", GRIDS)
class TestMarks:
    CELL = (100, 24)

    def test_the_raster_lies_between_the_axes(self, shipped, grid):
        page = shipped("#0")
        svg = page.locator(f"svg[data-grid={grid}]")
        raster, border = svg.locator("[data-image]").bounding_box(), svg.locator(".frame").bounding_box()
        line = svg.locator(".frame").evaluate(LINE_WIDTH)  # half of it lies outside on each side
        inner = {side: border[side] + (line / 2 if side in "xy" else -line) for side in border}
        assert raster == pytest.approx(inner, abs=1)
        number_at_10 = svg.locator("text.x", has_text=re.compile("^10$")).bounding_box()
        assert centre(number_at_10)[1] == pytest.approx(raster["y"] + raster["height"] * 61 / 71, abs=3)

    def test_a_click_on_any_grid_marks_its_cell_in_all(self, shipped, grid):
        page = shipped(f"#{FRAME}")
        click(page, grid, self.CELL)
        for other in GRIDS:
            mark = page.locator(f"[data-marks={other}] .mark").bounding_box()
            assert centre(mark) == pytest.approx(centre(cell_box(page, other, self.CELL)), abs=1)

    def test_arrow_keys_go_from_cell_to_cell(self, shipped, grid):
        page = opened_at(shipped, FRAME, self.CELL)
        page.locator(f"svg[data-grid={grid}]").focus()
        for key, cell in (("ArrowUp", (99, 24)), ("ArrowRight", (99, 25)), ("ArrowDown", (100, 25))):
            page.keyboard.press(key)
            told(page, cell)
        assert page.locator("#slider").input_value() == str(FRAME)


def turn(yaw):
    """The rotation from the vehicle's axes to those of the world."""
    return np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])


class TestChosenCells:
    def test_without_a_cell_the_keys_begin_on_the_road_ahead(self, shipped):
        page = shipped("#0")
        page.locator("svg[data-grid=grid]").focus()
        page.keyboard.press("ArrowUp")
        page.locator("#telling h3").first.wait_for()
        heading = page.locator("#telling > p").first.inner_text()
        ahead, aside = re.findall(r"([\d.]+) m", heading)
        assert 5 < float(ahead) < 25
        assert float(aside) < 1

    @pytest.mark.parametrize(("cell", "key"), [((0, 0), "ArrowUp"), ((141, 61), "ArrowRight")])
    def test_keys_stop_at_the_border(self, shipped, cell, key):
        page = opened_at(shipped, 0, cell)
        page.locator("svg[data-grid=grid]").focus()
        page.keyboard.press(key)
        page.wait_for_timeout(300)
        told(page, cell)

    @pytest.mark.parametrize("at", ["#3/999/10", "#3/10/62", "#3/-1/4", "#3/a/b", "#3/10", "#3//"])
    def test_an_address_without_such_a_cell_chooses_none(self, shipped, at):
        page = shipped(at)
        page.wait_for_timeout(200)
        assert page.locator(".mark").count() == 0
        assert page.locator("#slider").input_value() == "3"

    def test_without_an_address_it_begins_with_a_mistake_where_most_moves_and_escape_leaves_it(self, shipped):
        page = shipped("")
        assert page.locator("#slider").input_value() == str(page.evaluate("story.start"))
        page.locator("#telling", has_text="The mistake comes from").wait_for()
        assert page.locator("svg[data-grid=grid] .mark").count() == 1
        page.evaluate("document.activeElement.blur()")
        page.keyboard.press("Escape")
        page.locator("#telling", has_text="No cell is chosen").wait_for()
        assert page.locator(".mark").count() == 0

    def test_a_click_beside_the_map_chooses_nothing(self, shipped):
        page = shipped("#0")
        x, y = point_at(page, "grid", (70, 0))
        page.mouse.click(x - 20, y)
        page.wait_for_timeout(200)
        assert page.locator(".mark").count() == 0

    def test_the_mark_stays_on_its_place_until_that_leaves_the_map(self, shipped, shipped_frames):
        page = opened_at(shipped, 0, (120, 40))
        for k, view in enumerate(shipped_frames[:10]):
            page.locator("#slider").fill(str(k))
            then, now = (np.array(shipped_frames[i]["pose"]) for i in (0, k))
            world = turn(then[2]) @ SPEC.centers()[120, 40] + then[:2]
            here = turn(now[2]).T @ (world - now[:2])
            row, col, inside = (one.item() for one in SPEC.cells(here[None]))
            if inside:
                told(page, (row, col))
            else:
                page.locator("#telling", has_text="left the grid").wait_for()
                assert page.locator(".mark").count() == 0
            assert view["details"]

    def test_what_was_unfolded_stays_so(self, shipped):
        page = shipped(f"#{FRAME}/100/24")
        page.locator("#telling summary", has_text="and not").click()
        click(page, "grid", (101, 24))
        assert page.locator("#telling details").evaluate_all("(all) => all.map((one) => one.open)") == [False, True]


@pytest.mark.parametrize("name", ["car", "mistake", "unseen"])
class TestStory:
    """What the panel tells, against `cell_story`."""

    def test_its_class_and_the_truth(self, shipped, cells, stories, name):
        page, story = shipped(f"#{FRAME}"), stories[name]
        click(page, "refined", cells[name])
        heading = page.locator("#telling > p").first
        assert heading.locator(".class").inner_text() == story.names[story.refined]
        truth, right = story.names[story.truth], story.refined == story.truth
        if truth.startswith("unknown"):
            told = "This agrees with the filter; nobody labelled it." if right else f"to the filter it is {truth}."
        else:
            told = "This is right." if right else f"The truth is {truth}."
        assert told in heading.inner_text()
        assert page.locator("#where").text_content().endswith(f": {story.names[story.refined]}.")
        why = page.locator("#telling h3", has_text="and not")
        begins = "Why" if story.refined == story.label else "Before the CRF: why"
        assert why.inner_text() == f"{begins} {story.names[story.label]} and not {story.names[story.rival]}?"
        sentences = page.locator("#telling > p").all_inner_texts()
        assert set(sentences) >= set(told_story(story))

    def test_what_the_scan_says(self, shipped, cells, stories, name):
        page, scan = shipped(f"#{FRAME}"), stories[name].scan
        click(page, "refined", cells[name])
        text = page.locator("#telling").inner_text()
        assert re.search(rf"\b{scan.obstacles} obstacle returns? and {scan.ground} ground returns? lie", text)
        assert f"the cell is {scan.distance:.1f} m away" in text or "Nothing came back" in text
        sentence = {
            "hit": "stands here",
            "passed": "passes the cell",
            "ground": "was seen here",
            "silent": "nothing of",
        }
        assert sentence[scan.verdict] in text

    def test_its_four_states_sum_to_one_after_each_step(self, shipped, cells, stories, name):
        page, story = shipped(f"#{FRAME}"), stories[name]
        click(page, "refined", cells[name])
        page.locator("#telling summary").first.click()
        shown = rows(page, "#telling > table >> nth=0")
        words = {
            "moved": "move",
            "predicted": "predict",
            "updated": "update",
            "resampled": "resample",
            "shown": "shown",
        }
        assert list(shown) == list(words)
        for word, step in words.items():
            assert sum(story.steps[step]) == pytest.approx(1)
            assert shown[word] == pytest.approx(100 * story.steps[step], abs=1.01)
        width = "[...band.children].reduce((sum, part) => sum + parseFloat(part.style.width), 0)"
        bands = page.locator("#telling .band").evaluate_all(f"(all) => all.map((band) => {width})")
        assert bands == pytest.approx([100] * len(bands), abs=0.01)
        past = list(rows(page, "#telling details >> nth=0").values())
        np.testing.assert_allclose(past, 100 * story.history.T, atol=1.01)

    def test_the_parts_of_the_score_add_up(self, shipped, cells, stories, name):
        page, why = shipped(f"#{FRAME}"), stories[name].why
        click(page, "refined", cells[name])
        page.locator("#telling details", has=page.locator("h3", has_text="and not")).locator("summary").first.click()
        image, occupancy, rest, total = (value for (value,) in rows(page, "#telling .parts >> nth=0").values())
        assert image + occupancy + rest == pytest.approx(total, abs=0.2)
        assert total == pytest.approx(why.score, abs=0.11)
        assert occupancy == pytest.approx(why.occupancy.sum(), abs=0.26)
        assert image == pytest.approx(why.planes.sum(), abs=1.1)  # twenty planes, each rounded to 0.1
        by_height = [value for (value,) in rows(page, "#telling .two > div + div .parts").values()]
        np.testing.assert_allclose(by_height[::-1], why.planes, atol=0.11)

    def test_what_the_neighbours_add(self, shipped, cells, stories, name):
        page, story = shipped(f"#{FRAME}"), stories[name]
        click(page, "refined", cells[name])
        told_of = rows(page, "#telling > table >> nth=-1")
        assert len(told_of) == len({story.label, story.rival, story.refined})
        for word, (before, pulled, after) in told_of.items():
            c = story.names.index(word)
            assert (before, after) == pytest.approx((100 * story.before[c], 100 * story.after[c]), abs=1.01)
            assert pulled == pytest.approx(story.messages[c], abs=0.16)
        assert page.locator("[data-marks=refined] .pull").count() == page.locator("#telling ol li").count() == 5

    def test_the_images_show_its_points_of_eq_1(self, shipped, cells, stories, name):
        page, story = shipped(f"#{FRAME}"), stories[name]
        click(page, "refined", cells[name])
        expected = story.pixels[story.visible]
        assert len(expected) > 10 or name == "unseen"
        for layer in range(2):
            points = page.locator("[data-column]").nth(layer).locator("circle")
            drawn = points.evaluate_all("(all) => all.map((one) => [one.cx.baseVal.value, one.cy.baseVal.value])")
            np.testing.assert_allclose(np.reshape(drawn, (-1, 2)), expected, atol=0.02)  # rounded to 1/32
            photo = page.locator(".stack").nth(layer).locator("img").first.bounding_box()
            for k, (u, v) in enumerate(expected):
                scale = photo["width"] / sample_drive().camera.size[1]
                on_screen = photo["x"] + (u + 0.5) * scale, photo["y"] + (v + 0.5) * scale
                assert centre(points.nth(k).bounding_box()) == pytest.approx(on_screen, abs=1)


def test_while_the_drive_plays_the_neighbours_wait_until_it_is_paused(shipped):
    page = opened_at(shipped, FRAME, (100, 24), by_hand=True)
    page.locator("#play").click()
    page.clock.run_for(120)
    page.locator("#telling", has_text="when the drive is paused").wait_for()
    assert page.locator("#telling ol").count() == 0
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("Space")
    page.locator("#telling ol").wait_for()


def in_sight(page, locator) -> bool:
    """Whether all of an element lies inside the window."""
    box, size = locator.bounding_box(), page.viewport_size
    inside = box["x"] >= 0 and box["x"] + box["width"] <= size["width"]
    return inside and box["y"] >= 0 and box["y"] + box["height"] <= size["height"]


class TestTogether:
    """A click and what it changes are in sight together."""

    CELL = (100, 24)

    @pytest.mark.parametrize("grid", GRIDS)
    def test_the_points_in_the_images_and_the_first_sentences(self, shipped, grid):
        page = shipped(f"#{FRAME}")
        page.locator(f"svg[data-grid={grid}]").evaluate("(svg) => svg.scrollIntoView({ block: 'start' })")
        page.mouse.click(*centre(cell_box(page, grid, self.CELL)))
        told(page, self.CELL)
        seen = [page.locator("#brief"), page.locator(f"[data-marks={grid}] .mark"), *page.locator(".stack").all()]
        assert all(in_sight(page, one) for one in seen)
        assert page.locator("#brief p").first.inner_text() == page.locator("#telling > p").first.inner_text()

    def test_cells_have_four_pixels_and_the_panel_no_scroller(self, shipped):
        page = opened_at(shipped, FRAME, self.CELL)
        assert min(cell_box(page, grid, self.CELL)["width"] for grid in GRIDS) >= 4
        assert page.locator(".story").evaluate("(one) => one.scrollHeight <= one.clientHeight + 1")

    def test_a_phone_shows_the_points_in_an_inset(self, shipped):
        page = opened_at(shipped, FRAME, self.CELL, **PHONE)
        page.locator("svg[data-grid=refined]").scroll_into_view_if_needed()
        inset = page.locator("#inset")
        assert in_sight(page, inset)
        points = page.locator("[data-column]").first.locator("circle").count()
        assert inset.locator("circle").count() == points > 0
        assert all(in_sight(page, one) for one in inset.locator("circle").all())

    @pytest.mark.parametrize("place", ["h1", ".story", ".tables"])
    def test_no_inset_lies_over_a_phones_text_but_beside_the_grids(self, shipped, place):
        page = opened_at(shipped, FRAME, self.CELL, **PHONE)
        page.locator(place).evaluate("(one) => one.scrollIntoView({ block: 'start' })")
        assert not in_sight(page, page.locator("#inset"))


class TestErrors:
    def test_red_where_the_class_is_not_the_truth(self, shipped, shipped_frames):
        page = shipped(f"#{FRAME}")
        page.locator("#errors").click()
        for k in (FRAME, FRAME + 1):
            page.locator("#slider").fill(str(k))
            view = shipped_frames[k]
            for name in ("grid", "refined"):
                wrong = (classes(view, name) != classes(view, "truth")).sum()
                assert self.painted_red(page, name, wrong) == wrong
        assert page.locator("#errorsnote").is_visible()

    @staticmethod
    def painted_red(page, name, expected) -> int:
        """Count the red cells, when they are those of the frame that is shown or a second has passed."""
        return page.evaluate(
            """async ([name, expected]) => {
                 for (let red = -1, left = 50; ; left--) {
                   const uri = document.querySelector(`[data-errors=${name}]`).getAttribute("href");
                   if (uri) {
                     const { data } = await decode(uri);
                     red = 0;
                     for (let i = 0; i < data.length; i += 4) red += data[i] > 200 && data[i + 1] < 60;
                   }
                   if (red === expected || left === 0) return red;
                   await new Promise((done) => setTimeout(done, 20));
                 }
               }""",
            [name, int(expected)],
        )

    def test_switched_off_they_are_gone(self, shipped):
        page = shipped(f"#{FRAME}")
        button = page.locator("#errors")
        button.click()
        page.locator("[data-errors=grid][href]").wait_for(state="attached")
        assert button.get_attribute("aria-pressed") == "true"
        button.click()
        assert button.get_attribute("aria-pressed") == "false"
        page.wait_for_timeout(200)
        assert page.locator("[data-errors][href]").count() == 0
        assert page.locator("#errorsnote").is_hidden()


@pytest.mark.parametrize("factor", [2, 4])
class TestZoom:
    CELL = (60, 50)

    def test_cells_grow_around_the_chosen_one(self, shipped, factor):
        page = opened_at(shipped, FRAME, self.CELL)
        before = cell_box(page, "grid", self.CELL)["width"]
        page.locator("#zoom").select_option(str(factor))
        box = cell_box(page, "grid", self.CELL)
        assert box["width"] == pytest.approx(factor * before, rel=0.01)
        svg = page.locator("svg[data-grid=grid]").bounding_box()
        assert svg["x"] < centre(box)[0] < svg["x"] + svg["width"]
        assert svg["y"] < centre(box)[1] < svg["y"] + svg["height"]

    def test_the_numbers_of_the_axes_stand_at_their_cells(self, shipped, factor):
        page = opened_at(shipped, FRAME, self.CELL)
        page.locator("#zoom").select_option(str(factor))
        page.locator("svg[data-grid=grid]").evaluate("(svg) => svg.scrollIntoView({ block: 'center' })")
        raster = cell_box(page, "grid", (0, 0))
        numbers = page.locator("svg[data-grid=grid] text.x")
        assert numbers.count() > 4
        for one in numbers.all():
            ahead = (SPEC.x_max - float(one.text_content())) / SPEC.cell
            assert centre(one.bounding_box())[1] == pytest.approx(raster["y"] + ahead * raster["height"], abs=4)

    def test_the_pointer_finds_the_name_of_its_cell(self, shipped, shipped_frames, factor):
        page = opened_at(shipped, FRAME, self.CELL)
        page.locator("#zoom").select_option(str(factor))
        for cell in (self.CELL, (self.CELL[0] + 4, self.CELL[1] - 3), (self.CELL[0] - 5, self.CELL[1] + 2)):
            page.mouse.move(*point_at(page, "grid", cell))
            label = KITTI_14.names[classes(shipped_frames[FRAME], "grid")[cell]]
            page.locator("#hover", has_text=re.compile(f"^{label}$")).wait_for()

    def test_without_a_cell_the_road_ahead_is_in_view(self, shipped, factor):
        page = shipped("#0")
        page.locator("#zoom").select_option(str(factor))
        click(page, "grid", (115, 31))


class TestHover:
    def test_a_map_of_classes_says_the_class(self, shipped, shipped_frames, cells):
        page = shipped(f"#{FRAME}")
        for cell in cells.values():
            for name in ("grid", "refined", "truth"):
                page.mouse.move(*point_at(page, name, cell))
                label = KITTI_14.names[classes(shipped_frames[FRAME], name)[cell]]
                page.locator("#hover", has_text=re.compile(f"^{label}$")).wait_for()

    def test_the_occupancy_grid_says_the_states(self, shipped, cells, stories):
        page = shipped(f"#{FRAME}")
        for name, cell in cells.items():
            page.mouse.move(*point_at(page, "occupancy", cell))
            free = round(100 * stories[name].steps["shown"][0])
            page.locator("#hover", has_text=re.compile(rf"^free ({free - 1}|{free}|{free + 1}) %, static")).wait_for()

    def test_it_leaves_with_the_pointer_and_stays_inside_the_window(self, shipped):
        page = shipped(f"#{FRAME}")
        for name in ("truth", "occupancy"):
            page.mouse.move(*point_at(page, name, (100, 60)))
            page.locator("#hover").wait_for()
            box = page.locator("#hover").bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= 1500
            page.mouse.move(5, 5)
            page.locator("#hover").wait_for(state="hidden")
