"""A real browser and pages for it. Without playwright or without a browser, the tests of this folder are skipped."""

import contextlib
import json
import shutil
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import pytest
from read_page import Page

from semgrid_edu.datasets.samples import sample_drive, sample_weights
from semgrid_edu.workshop import demo

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
NO_LIBRARY = "needs playwright: pip install -c constraints.txt -e '.[browser]', or make test-browser"
NO_BROWSER = "needs Chromium, Chrome or Edge: apt-get install chromium, or playwright install chromium"


@pytest.fixture(scope="session")
def browser():
    """A browser of Chromium's family, without a window."""
    sync_api = pytest.importorskip("playwright.sync_api", reason=NO_LIBRARY)
    with sync_api.sync_playwright() as playwright:
        browser = launch(playwright.chromium, sync_api.Error)
        if browser is None:
            pytest.skip(NO_BROWSER)
        yield browser
        browser.close()


def launch(kind, error):
    """Start the system's browser, else the one that playwright brought, else Chrome or Edge in their usual places."""
    installed = next(filter(None, map(shutil.which, BROWSERS)), None)
    if installed is not None:
        return kind.launch(executable_path=installed)
    for choice in ({}, {"channel": "chrome"}, {"channel": "msedge"}):
        with contextlib.suppress(error):
            return kind.launch(**choice)
    return None


@pytest.fixture(scope="session")
def shipped_page(browser, tmp_path_factory) -> Path:
    """The demo's page of the shipped drive."""
    return demo.write_demo(sample_drive(), sample_weights(), tmp_path_factory.mktemp("shipped"))


@pytest.fixture
def open_page(browser) -> Iterator:
    """Open a page, which must neither complain nor ask for anything outside itself."""
    contexts, complaints = [], []

    def opened(path: Path, at: str = "", by_hand: bool = False, **options):
        """With `by_hand`, time stands still but for `page.clock.run_for`."""
        contexts.append(browser.new_context(**{"viewport": {"width": 1500, "height": 1000}} | options))
        page = contexts[-1].new_page()
        page.on("console", lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda asked: complaints.append(asked.url) if asked.url.startswith(("http", "ws")) else None)
        if by_hand:
            page.clock.install(time=datetime(2026, 1, 1))
        page.goto(path.as_uri() + at)
        if by_hand:
            page.clock.pause_at(datetime(2026, 1, 2))
        return page

    yield opened
    for context in contexts:
        context.close()
    assert complaints == []


@pytest.fixture
def shipped(open_page, shipped_page):
    """Open the page of the shipped drive."""
    return lambda at="", **options: open_page(shipped_page, at, **options)


@pytest.fixture(scope="session")
def shipped_frames(shipped_page) -> list[dict]:
    """The frames of that page: clock, pictures, texts and so on."""
    return json.loads(Page(shipped_page.read_text(encoding="utf-8")).text["frames"])
