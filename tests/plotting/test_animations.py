"""Animations, decoded again by Pillow and by OpenCV."""

import io

import cv2
import matplotlib.pyplot as plt
import numpy as np
import pytest
from IPython.core.formatters import DisplayFormatter
from PIL import Image

from semgrid_edu import plotting
from semgrid_edu.errors import ArgumentError
from semgrid_edu.plotting import animations


def squares(n=5):
    """A red square that moves right by four pixels a frame, on grey."""
    for k in range(n):
        frame = np.full((20, 30, 3), 200, np.uint8)
        frame[8:12, 4 * k : 4 * k + 4] = (220, 30, 30)
        yield frame


def drawings():
    """One figure, drawn on again and again."""
    fig, ax = plt.subplots(figsize=(3, 2), dpi=plotting.FIGURE_DPI)
    (point,) = ax.plot([0], [0], "o")
    ax.set_xlim(-1, 4)
    for k in range(4):
        point.set_xdata([k])
        yield fig


def decoded(png):
    """All frames as OpenCV sees them, (n, h, w, 3), and their milliseconds."""
    readable, animation = cv2.imdecodeanimation(np.frombuffer(png, np.uint8))
    assert readable
    return np.stack(animation.frames)[..., 2::-1], list(animation.durations)


def test_all_frames_come_back_exactly_and_run_for_ever():
    animation = plotting.animate(squares(), period=0.1, alt="a red square moves to the right")
    frames, milliseconds = decoded(animation.png)
    np.testing.assert_array_equal(frames, list(squares()))
    assert milliseconds == [100] * 5
    with Image.open(io.BytesIO(animation.png)) as image:
        assert (image.format, image.n_frames, image.info["loop"]) == ("PNG", 5, 0)


def test_a_figure_is_drawn_anew_for_each_frame_and_closed():
    before = plt.get_fignums()
    frames, _ = decoded(plotting.animate(drawings(), 0.2, "a point moves to the right").png)
    assert frames.shape == (4, 220, 330, 3)
    blue = [np.argwhere((frame[..., 2] > 150) & (frame[..., 0] < 60))[:, 1].mean() for frame in frames]
    np.testing.assert_allclose(np.diff(blue), (0.9 - 0.125) * 330 / 5, atol=1)  # matplotlib's default margins
    assert plt.get_fignums() == before


CHANGES = {
    "data": lambda ax: ax.lines[0].set_data([0, 1], [1, 0]),
    "picture": lambda ax: ax.images[0].set_data(1 - ax.images[0].get_array()),
    "title": lambda ax: ax.set_title("after"),
    "text": lambda ax: ax.texts[0].set(position=(0.8, 0.8)),
    "new": lambda ax: ax.scatter([0.2], [0.7], color="red"),
    "legend": lambda ax: ax.legend(["line"]),
    "gone": lambda ax: ax.lines[0].remove(),
    "figure": lambda ax: ax.figure.suptitle("above"),
    "limits": lambda ax: ax.set_xlim(0, 9),
    "cleared": lambda ax: ax.clear(),
}
"""What may happen to a figure between two frames, one after the other."""


def as_saved(fig):
    """A figure's pixels as `savefig` writes them."""
    file = io.BytesIO()
    fig.savefig(file, dpi="figure")
    return np.asarray(Image.open(file).convert("RGB"))


def held_and_changed():
    """A figure twice as it is, and once after each change."""
    fig, ax = plt.subplots(figsize=(3, 2), layout="constrained")
    ax.plot([0, 1], [0, 1])
    ax.imshow([[0.0, 1.0]], extent=(0, 1, 0, 1), cmap="Greys")
    ax.text(0.2, 0.2, "A")
    yield fig
    yield fig
    for change in CHANGES.values():
        change(ax)
        yield fig
    plt.close(fig)


def test_each_frame_looks_as_it_would_be_saved(monkeypatch):
    pictures, reduced = [], animations._with_common_palette
    monkeypatch.setattr(
        animations, "_with_common_palette", lambda drawn: pictures.extend(map(np.asarray, drawn)) or reduced(drawn)
    )
    plotting.animate(held_and_changed(), 0.2, "a line changes")
    saved = list(map(as_saved, held_and_changed()))
    for k, change in enumerate(CHANGES, start=2):
        np.testing.assert_array_equal(pictures[k], saved[k], err_msg=change)
        assert not np.array_equal(pictures[k - 1], pictures[k]), change
    np.testing.assert_array_equal(pictures[:2], saved[:2])


def test_a_figure_that_is_held_is_drawn_once(monkeypatch):
    drawn, draw = [], animations._picture
    monkeypatch.setattr(animations, "_picture", lambda frame: drawn.append(frame) or draw(frame))
    held = plotting.animate((frame for frame in drawings() for _ in range(3)), 0.2, "a point moves to the right")
    assert len(drawn) == 4
    assert sum(decoded(held.png)[1]) == 12 * 200


def test_the_rarest_colour_of_a_large_animation_is_kept():
    frames = np.full((3, 400, 500, 3), 200, np.uint8)
    frames[1, 30, 70] = (220, 30, 30)
    np.testing.assert_array_equal(decoded(plotting.animate(frames, 0.1, "a pixel flashes").png)[0], frames)


def test_many_colours_become_the_nearest_few():
    ramp = np.arange(60_000).reshape(200, 300)
    frames = np.stack([np.stack([(ramp + k) % 256, ramp // 300, ramp % 3], axis=-1) for k in range(3)]).astype(np.uint8)
    shown = decoded(plotting.animate(frames, 0.1, "ramps of colours").png)[0].astype(int)
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) <= 256
    assert np.abs(shown - frames).mean() < 5  # one colour in the middle of each of 16 x 16 squares is 4 off


def test_the_same_frames_give_the_same_bytes():
    first, second = (plotting.animate(drawings(), 0.2, "a point moves to the right") for _ in range(2))
    assert first.png == second.png


def test_it_is_shown_as_a_png_with_its_alternative_text():
    animation = plotting.animate(squares(), 0.1, "a red square moves to the right")
    data, metadata = DisplayFormatter().format(animation)
    assert data["image/png"] == animation.png
    assert data["text/plain"] == "Animation(alt='a red square moves to the right')"
    assert metadata["image/png"] == {"alt": "a red square moves to the right"}


def test_too_large_an_animation_says_how_to_shrink_it():
    noise = np.random.default_rng(0).integers(0, 3, (20, 300, 300, 3)).astype(np.uint8) * 120
    with pytest.raises(
        ArgumentError, match=r"at most 600 kB: show fewer frames.*found \d+ kB for 20 frames of 300 x 300"
    ):
        plotting.animate(noise, 0.1, "noise")


@pytest.mark.parametrize(
    ("frames", "period", "name"),
    [
        ([], 0.1, "frames"),
        ([np.zeros((4, 4, 3), np.uint8), np.zeros((4, 5, 3), np.uint8)], 0.1, "frames"),
        (list(squares()), 0.0, "period"),
        (list(squares()), np.nan, "period"),
    ],
)
def test_wrong_input_is_named(frames, period, name):
    with pytest.raises(ArgumentError, match=f"^{name}: expected"):
        plotting.animate(frames, period, "a text")
