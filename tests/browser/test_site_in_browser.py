"""The course site in a real browser, where `make site` has built it; no page fetches from elsewhere (`open_page`)."""

from pathlib import Path
from urllib.parse import urlsplit

import pytest
from stage import CLONE

SITE = CLONE / "out" / "site"
pytestmark = pytest.mark.skipif(not (SITE / "index.html").exists(), reason="needs the site: make site")


def test_one_can_click_from_the_first_page_to_a_lecture_and_its_code(open_page):
    page = open_page(SITE / "index.html")
    page.locator("nav >> text=Lectures").first.click()
    page.locator("article a", has_text="The CRF by hand").first.click()
    page.wait_for_selector("mjx-container")
    assert page.locator("mjx-container").count() > 50
    assert page.locator("mjx-merror").count() == 0
    pictures = page.locator("article img")
    assert pictures.count() > 5
    assert all(pictures.evaluate_all("all => all.map(one => one.alt.length > 20)"))


def test_search_finds_a_term_without_a_server(open_page):
    page = open_page(SITE / "search.html", "?q=permutohedral")
    page.wait_for_selector("#search-results li")
    assert "11" in page.locator("#search-results").inner_text()


def test_dark_mode_keeps_the_colours_of_the_classes(open_page):
    page = open_page(SITE / "notebooks" / "00_tour.html", color_scheme="dark")
    assert page.locator("html").get_attribute("data-theme") == "dark"
    assert set(page.locator("article img").evaluate_all("all => all.map(one => getComputedStyle(one).filter)")) == {
        "none"
    }


@pytest.mark.parametrize("width", [390, 1500])
def test_no_page_is_wider_than_the_window(open_page, width):
    for name in (
        "index",
        "graphs",
        "gallery",
        "glossary",
        "notebooks/10_crf",
        "notebooks/exercises/01_bayes",
        "api/occupancy",
        "docs/results",
    ):
        page = open_page(SITE / f"{name}.html", viewport={"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width, name


def test_every_page_opens_and_stays_at_home(open_page):
    page = open_page(SITE / "index.html")
    for file in sorted(SITE.rglob("*.html")):
        if not {"_static", "_modules", "demo"} & {*file.parts}:
            page.goto(file.as_uri(), wait_until="domcontentloaded")
            assert page.title()


def test_a_widget_moves_without_a_kernel(open_page):
    page = open_page(SITE / "notebooks" / "05_pixels.html")
    picture, slider = page.locator(".moving img"), page.locator(".moving input")
    before = picture.get_attribute("alt"), picture.evaluate("(one) => one.src")
    slider.focus()
    page.keyboard.press("ArrowRight")
    assert (picture.get_attribute("alt"), picture.evaluate("(one) => one.src")) != before
    page.wait_for_function(
        "() => { const one = document.querySelector('.moving img'); return one.complete && one.naturalWidth > 100; }"
    )
    assert page.locator(".moving output").inner_text() in picture.get_attribute("alt")


def test_animations_play(open_page):
    page = open_page(SITE / "notebooks" / "00_tour.html")
    files = page.locator("article img").evaluate_all("(all) => all.map((one) => one.src)")
    moving = [one for one in files if one.endswith(".png") and b"acTL" in Path(urlsplit(one).path).read_bytes()]
    assert moving
