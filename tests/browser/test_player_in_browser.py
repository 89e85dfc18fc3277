"""The demo's page in a browser: slider, keys, address, and play in true time.

What the player's script decides by itself is tested without a browser, in `tests/demo/test_page_script.py`.
"""

import pytest


def frame(page) -> int:
    return int(page.locator("#slider").input_value())


def clock(page) -> str:
    return page.locator("#clock").inner_text()


def pictures(page) -> dict[str, str]:
    return page.evaluate(
        "Object.fromEntries([...document.querySelectorAll('[data-image]')].map((one) =>"
        " [one.dataset.image, one.getAttribute(one.tagName === 'IMG' ? 'src' : 'href')]))"
    )


class TestSlider:
    @pytest.mark.parametrize(("share", "expected"), [(0.0, 0), (1.0, -1)])
    def test_its_ends_are_the_first_and_the_last_frame(self, shipped, shipped_frames, share, expected):
        page = shipped("#5")
        box = page.locator("#slider").bounding_box()
        page.mouse.click(box["x"] + 1 + share * (box["width"] - 2), box["y"] + box["height"] / 2)
        assert clock(page) == shipped_frames[expected]["clock"]

    def test_moving_it_changes_every_picture_its_words_and_the_arrows(self, shipped, shipped_frames):
        page = shipped()
        for k in (7, 19, 0):
            page.locator("#slider").fill(str(k))
            wanted = shipped_frames[k]
            assert clock(page) == wanted["clock"]
            assert pictures(page) == wanted["images"]
            assert page.locator("[data-arrows=occupancy]").get_attribute("d") == wanted["arrows"]["occupancy"]
            assert page.locator("img[data-text=scores]").get_attribute("alt") == wanted["texts"]["scores"]
            assert page.locator("svg[data-text=grid]").get_attribute("aria-label") == wanted["texts"]["grid"]

    def test_it_keeps_its_length_while_it_is_moved(self, shipped):
        page = shipped()
        lengths = set()
        for k in range(20):
            page.locator("#slider").fill(str(k))
            lengths.add(page.locator("#slider").bounding_box()["width"])
        assert len(lengths) == 1


class TestKeys:
    @pytest.mark.parametrize("focus", ["body", "#slider", "#play"])
    def test_an_arrow_moves_by_one_frame_wherever_the_focus_is(self, shipped, focus):
        page = shipped("#5")
        page.locator(focus).focus()
        for key, expected in (("ArrowRight", 6), ("ArrowRight", 7), ("ArrowLeft", 6)):
            page.keyboard.press(key)
            assert frame(page) == expected

    def test_arrows_in_a_list_choose_its_options(self, shipped):
        page = shipped("#5")
        page.locator("#speed").focus()
        page.keyboard.press("ArrowDown")
        assert frame(page) == 5

    def test_space_plays_and_pauses_but_opens_what_can_be_unfolded(self, shipped):
        page = shipped("#5/100/30", by_hand=True)
        page.locator("#telling summary").first.focus()
        page.keyboard.press("Space")
        assert page.locator("#telling details").first.evaluate("(details) => details.open")
        assert page.locator("#play").inner_text() == "▶ Play"
        page.locator("body").focus()
        page.evaluate("document.activeElement.blur()")
        page.keyboard.press("Space")
        assert page.locator("#play").inner_text() == "❚❚ Pause"
        page.keyboard.press("Space")
        assert page.locator("#play").inner_text() == "▶ Play"


class TestPlay:
    def test_each_frame_comes_at_its_time_and_the_last_one_stays(self, shipped, shipped_frames):
        page = shipped("#0", by_hand=True)
        page.locator("#play").click()
        passed = 0
        for k, view in enumerate(shipped_frames):
            due = round(1000 * (view["time"] - shipped_frames[0]["time"]))
            page.clock.run_for(max(0, due - 20 - passed))
            assert frame(page) == max(0, k - 1)
            page.clock.run_for(40 if k else 20)
            passed = due + 20
            assert frame(page) == k
        assert page.locator("#play").inner_text() == "▶ Play"
        page.clock.run_for(5000)
        assert frame(page) == len(shipped_frames) - 1

    def test_pause_holds_the_frame(self, shipped):
        page = shipped("#0", by_hand=True)
        page.locator("#play").click()
        page.clock.run_for(330)
        page.locator("#play").click()
        page.clock.run_for(3000)
        assert frame(page) == 3
