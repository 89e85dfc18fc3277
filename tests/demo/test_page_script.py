"""The page's player, run by node on a stub of a page: keys, buttons, the address, and what a screen reader hears."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

import semgrid_edu.workshop.demo.page as page_module

PLAYER = Path(page_module.__file__).with_name("page.js").read_text(encoding="utf-8").replace('"use strict";', "")
STUB = Path(__file__).with_name("page_stub.js").read_text(encoding="utf-8")

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="needs node, to run the page's script")


@pytest.fixture
def play(tmp_path):
    """Run the player, then some more lines; return what the last of them gives."""

    def run(lines: str) -> object:
        *before, last = lines.strip().splitlines()
        program = tmp_path / "play.js"
        program.write_text(
            "\n".join([STUB, PLAYER, *before, f"console.log(JSON.stringify({last}));"]), encoding="utf-8"
        )
        done = subprocess.run(["node", str(program)], capture_output=True, text=True, check=True, timeout=60)
        return json.loads(done.stdout)

    return run


def test_the_address_says_which_frame_is_shown_also_when_it_changes(play):
    assert play("elements.slider.value") == 2
    assert play('location.hash = "#1"; window.fire("hashchange");\nelements.clock.textContent') == "frame 1"
    assert play('location.hash = "#99"; window.fire("hashchange");\nelements.clock.textContent') == "frame 3"
    assert play('location.hash = "#x"; window.fire("hashchange");\nelements.clock.textContent') == "frame 0"


def test_arrow_keys_and_buttons_step_and_stop_at_the_ends(play):
    assert play('document.fire("keydown", { key: "ArrowRight" });\nelements.clock.textContent') == "frame 3"
    assert play('elements.next.fire("click"); elements.next.fire("click");\nelements.clock.textContent') == "frame 3"
    assert play('elements.back.fire("click");\nelements.clock.textContent') == "frame 1"


@pytest.mark.parametrize("key", ["altKey", "ctrlKey", "metaKey"])
def test_an_arrow_with_another_key_is_left_to_the_browser(play, key):
    taken = f'[document.fire("keydown", {{ key: "ArrowLeft", {key}: true }}), elements.slider.value]'
    assert play(taken) == [False, 2]


def test_the_space_key_presses_the_button_that_has_the_focus(play):
    assert play('document.fire("keydown", { key: " ", target: elements.back });\nwaiting') is None
    assert play('document.fire("keydown", { key: " ", target: new Stub("SUMMARY") });\nwaiting') is None
    assert play('document.fire("keydown", { key: " " });\nwaiting.delay') == pytest.approx(400)


def test_plays_in_true_time_also_over_a_gap_and_stops_at_the_end(play):
    lines = """
    elements.back.fire("click"); elements.play.fire("click"); const delays = [waiting.delay];
    waiting.call(); delays.push(elements.clock.textContent, waiting.delay);
    waiting.call(); delays.push(elements.clock.textContent, waiting, elements.play.textContent);
    delays
    """
    assert play(lines) == [pytest.approx(100), "frame 2", pytest.approx(400), "frame 3", None, "▶ Play"]


def test_after_the_end_it_plays_from_the_start(play):
    lines = """
    elements.next.fire("click"); elements.play.fire("click");
    [elements.clock.textContent, waiting.delay]
    """
    assert play(lines) == ["frame 0", pytest.approx(100)]


def test_speed_divides_the_time(play):
    assert play('elements.speed.value = "0.5"; elements.play.fire("click");\nwaiting.delay') == pytest.approx(800)


def test_the_live_region_is_silent_during_play(play):
    heard = 'elements.clock.getAttribute("aria-live")'
    assert play(heard) == "polite"
    assert play(f'elements.play.fire("click");\n{heard}') == "off"
    assert play(f'elements.play.fire("click"); elements.play.fire("click");\n{heard}') == "polite"


def test_the_slider_says_frame_and_time(play):
    assert play('elements.next.fire("click");\nelements.slider.getAttribute("aria-valuetext")') == "frame 3"
