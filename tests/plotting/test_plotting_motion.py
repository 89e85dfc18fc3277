"""What moves has the colour of its velocity, at its place, and an animation shows every belief with its time."""

import io

import cv2
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.offsetbox import OffsetImage
from matplotlib.text import Text
from PIL import Image

from semgrid_edu import plotting
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, Particles, State
from semgrid_edu.plotting.moving import MAX_POINTS

FREE, STATIC, DYNAMIC, UNKNOWN = State
FORWARD, LEFT, BACK, RIGHT = plotting.HEADING_COLOURS
SPEC = GridSpec(x_min=0, x_max=4, y_min=-1, y_max=1, cell=1)


def scene(row=0, share=1.0, velocity=(-20.0, 0.0)):
    """Free space; in one cell of the left column something moves."""
    probability, velocities = np.zeros((4, 4, 2), np.float32), np.full((2, 4, 2), np.nan, np.float32)
    probability[FREE] = 1
    probability[[FREE, DYNAMIC], row, 0] = 1 - share, share
    velocities[:, row, 0] = velocity
    return Belief(probability, velocities, np.full((2, 2, 4, 2), np.nan, np.float32))


def texts(ax):
    return [text.get_text() for text in ax.findobj(Text) if text.get_text()]


def painted(belief):
    return plotting.velocity_wheel(SPEC, belief.probability, belief.velocity).images[0].get_array()


def test_what_moves_has_the_colour_of_its_heading_and_the_rest_keeps_that_of_occupancy():
    belief = scene()
    picture = painted(belief)
    np.testing.assert_array_equal(picture[0, 0], BACK)
    still = np.ones((4, 2), bool)
    still[0, 0] = False
    np.testing.assert_array_equal(picture[still], plotting.occupancy_colours(belief.probability)[still])


def test_a_cell_mixes_in_as_much_of_the_colour_as_is_probably_moving():
    half = np.add(LEFT, plotting.STATE_COLOURS[FREE]) / 2
    np.testing.assert_allclose(painted(scene(share=0.5, velocity=(0, 30)))[0, 0], half, atol=1)


def test_dynamic_mass_without_a_velocity_stays_orange():
    picture = painted(scene(velocity=(np.nan, np.nan)))
    np.testing.assert_array_equal(picture[0, 0], plotting.STATE_COLOURS[DYNAMIC])


def test_the_legend_is_a_wheel_with_forward_up_and_left_on_the_left():
    ax = plotting.velocity_wheel(SPEC, scene().probability, scene().velocity)
    (wheel,) = ax.findobj(OffsetImage)
    picture = np.asarray(wheel.get_data())
    for (row, column), colour in {(0, 50): FORWARD, (50, 0): LEFT, (100, 50): BACK, (50, 100): RIGHT}.items():
        np.testing.assert_array_equal(picture[row, column], [*colour, 255])
    np.testing.assert_array_equal(picture[50, 50, :3], plotting.STATE_COLOURS[STATIC])
    assert picture[0, 0, 3] == 0, "outside the wheel nothing is drawn"
    assert {"ahead", "left", "back", "right", "ring 4 m/s\nrim 16 m/s"} < set(texts(ax))
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["free", "static", "unknown"]


def test_without_legend_there_is_no_wheel():
    ax = plotting.velocity_wheel(SPEC, scene().probability, scene().velocity, legend=False)
    assert not ax.findobj(OffsetImage)
    assert ax.get_legend() is None


def test_particles_lie_where_they_are_and_have_the_colour_of_their_velocity():
    position = np.array([[3.5, 0.5], [1.0, -0.5], [9.0, 0.0]], np.float32)
    velocity = np.array([[20, 0], [0, -20], [20, 0]], np.float32)
    ax = plotting.particles(SPEC, Particles(position, velocity, np.array([0.2, 0.1, 0.9], np.float32)))
    (points,) = ax.collections
    np.testing.assert_allclose(points.get_offsets(), [[0.5, 3.5], [-0.5, 1.0]])
    np.testing.assert_allclose(points.get_facecolors()[:, :3], np.divide([FORWARD, RIGHT], 255))
    dense, thin = points.get_facecolors()[:, 3]
    assert dense == 1
    assert 0 < thin < 1
    assert ax.get_xlabel().endswith("2 of 3 particles")


def test_of_very_many_particles_every_kth_is_drawn_and_the_picture_says_so():
    n = 2 * MAX_POINTS + 1
    rng = np.random.default_rng(0)
    position = rng.uniform([0, -1], [4, 1], (n, 2)).astype(np.float32)
    many = Particles(position, np.ones((n, 2), np.float32), np.full(n, 1e-4, np.float32))
    drawn = [plotting.particles(SPEC, many) for _ in range(2)]
    offsets = [ax.collections[0].get_offsets() for ax in drawn]
    np.testing.assert_array_equal(*offsets)
    np.testing.assert_allclose(offsets[0], position[::3, ::-1])
    assert f"{len(offsets[0]):,} of {n:,} particles" in drawn[0].get_xlabel()


def test_no_particles_are_no_points():
    ax = plotting.particles(SPEC, Particles.none(), plotting.occupancy(SPEC, scene().probability))
    assert len(ax.collections[0].get_offsets()) == 0


def test_an_animation_shows_each_belief_with_its_time():
    beliefs, times = [scene(row) for row in range(4)], [5.0, 5.1, 5.2, 5.3]
    animation = plotting.animate_occupancy(SPEC, (b for b in beliefs), times, "something moves down")
    ax = plotting.velocity_wheel(SPEC, beliefs[2].probability, beliefs[2].velocity)
    ax.set_title("0.2 s")
    still = decoded(plotting.animate([ax.figure], 1.0, "the third frame").png)[0]
    with Image.open(io.BytesIO(animation.png)) as image:
        assert (image.n_frames, image.info["duration"]) == (4, 100)
    shift = decoded(animation.png)[2].astype(int) - still
    assert np.abs(shift).mean() < 1, "the same picture, but for its palette"


def decoded(png):
    """All frames as OpenCV sees them, (n, h, w, 3)."""
    return np.stack(cv2.imdecodeanimation(np.frombuffer(png, np.uint8))[1].frames)[..., 2::-1]


def test_nothing_but_the_time_changes_while_the_belief_stays():
    ax = plt.subplots(figsize=(3, 4), layout="constrained")[1]
    frames = decoded(plotting.animate_occupancy(SPEC, [scene()] * 3, [0, 1, 2], "nothing moves", ax).png)
    changed = (frames != frames[0]).any(axis=(0, 2, 3)).nonzero()[0]
    assert 0 < len(changed) < 20, "rows of pixels, those of the title"


def test_an_animation_of_one_belief_stands_still():
    with Image.open(io.BytesIO(plotting.animate_occupancy(SPEC, [scene()], [0.0], "one belief").png)) as image:
        assert getattr(image, "n_frames", 1) == 1


@pytest.mark.parametrize(
    ("draw", "names"),
    [
        (lambda: plotting.velocity_wheel(SPEC, np.zeros((4, 4, 2)), np.zeros((2, 2, 4))), "velocity"),
        (lambda: plotting.velocity_wheel(SPEC, np.zeros((4, 2, 4)), np.zeros((2, 4, 2))), "probability"),
        (lambda: plotting.velocity_wheel(SPEC, np.zeros((3, 4, 2)), np.zeros((2, 4, 2))), "probability"),
        (lambda: plotting.occupancy_colours(np.full((4, 4, 2), np.nan)), "probability"),
        (lambda: plotting.velocity_colours(np.zeros((3, 4))), "velocity"),
        (lambda: plotting.animate_occupancy(SPEC, [], [], "none"), "times"),
        (lambda: plotting.animate_occupancy(SPEC, [scene()] * 2, [0.0], "two"), "times"),
        (lambda: plotting.animate_occupancy(SPEC, [scene()] * 2, [1.0, 1.0], "two"), "times"),
    ],
)
def test_wrong_input_is_named(draw, names):
    with pytest.raises(ArgumentError, match=f"^{names}: expected"):
        draw()
