"""Pictures: colours that a colour-blind reader tells apart, maps that lie the right way round."""

from itertools import combinations

import cv2
import numpy as np
import pytest

from semgrid_edu import plotting
from semgrid_edu.camera import Camera
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14, SYNTHIA_10
from semgrid_edu.occupancy import State
from semgrid_edu.plotting.images import blend_labels, visible_points

# Machado, Oliveira and Fernandes (2009), deuteranopia of severity 1.0, on linear RGB.
DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
)

SPEC = GridSpec(x_min=0, x_max=4, y_min=-1, y_max=1, cell=1)


def lab(linear_rgb):
    """CIE L*a*b* of linear RGB, whose Euclidean distance is Delta E of 1976."""
    return cv2.cvtColor(np.float32(linear_rgb).reshape(1, -1, 3), cv2.COLOR_LRGB2LAB)[0]


def linear(rgb):
    share = np.asarray(rgb) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def deuteranope_distances(rgb):
    seen = lab(np.clip(linear(rgb) @ DEUTERANOPIA.T, 0, 1))
    return [np.linalg.norm(a - b) for a, b in combinations(seen, 2)]


def frame(image, points):
    T = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
    camera = Camera(np.array([[10, 0, 10], [0, 10, 5], [0, 0, 1.0]]), T, size=(11, 21))
    return Frame(image, np.array(points, dtype=np.float32), camera, np.eye(4), time=0.0)


def test_the_check_of_colours_knows_red_from_green_for_most_and_not_for_a_deuteranope():
    red, green = (200, 0, 0), (118, 118, 0)
    assert np.linalg.norm(lab(linear(red)) - lab(linear(green))) > 60
    assert deuteranope_distances([red, green])[0] < 15


@pytest.mark.parametrize("label_set", [KITTI_14, SYNTHIA_10], ids=lambda label_set: label_set.name)
def test_a_deuteranope_tells_every_two_classes_apart(label_set):
    assert min(deuteranope_distances(label_set.rgb)) > 20


def test_a_deuteranope_tells_the_occupancy_states_apart():
    assert min(deuteranope_distances(plotting.STATE_COLOURS)) > 28


def test_a_deuteranope_tells_four_headings_apart_and_from_what_stays():
    headings = list(plotting.HEADING_COLOURS)
    stays = [plotting.STATE_COLOURS[s] for s in (State.FREE, State.STATIC, State.UNKNOWN)]
    assert min(deuteranope_distances(headings)) > 35
    assert min(min(deuteranope_distances([heading, still])) for heading in headings for still in stays) > 20


def test_a_velocity_has_the_hue_of_its_heading_and_fades_to_static_as_it_slows():
    forward, left, back, right = plotting.HEADING_COLOURS
    fast = 2 * plotting.WHEEL_SPEED * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]).T
    np.testing.assert_array_equal(plotting.velocity_colours(fast), [forward, left, back, right])
    between = plotting.velocity_colours(np.array([100.0, 100.0]))
    np.testing.assert_allclose(between, np.add(forward, left) / 2, atol=0.5)
    quarter = plotting.velocity_colours(np.array([-plotting.WHEEL_SPEED / 4, 0]))
    np.testing.assert_allclose(quarter, np.add(back, plotting.STATE_COLOURS[State.STATIC]) / 2, atol=0.5)
    np.testing.assert_array_equal(plotting.velocity_colours(np.zeros(2)), plotting.STATE_COLOURS[State.STATIC])
    np.testing.assert_array_equal(
        plotting.velocity_colours(np.array([np.nan, 1])), plotting.STATE_COLOURS[State.DYNAMIC]
    )


def test_hues_go_round_without_a_jump():
    angle = np.radians(np.arange(361))
    ring = plotting.velocity_colours(20 * np.stack([np.cos(angle), np.sin(angle)])).astype(float)
    assert np.abs(np.diff(ring, axis=0)).max() < 4
    np.testing.assert_array_equal(ring[0], ring[-1])


def test_occupancy_mixes_state_colours_by_probability():
    probability = np.zeros((4, 1, 2))
    probability[0, 0, 0] = 1
    probability[[0, 1], 0, 1] = 0.5
    painted = plotting.occupancy_colours(probability)
    np.testing.assert_array_equal(painted[0, 0], plotting.STATE_COLOURS[0])
    mean = np.add(plotting.STATE_COLOURS[0], plotting.STATE_COLOURS[1]) / 2
    np.testing.assert_allclose(painted[0, 1], mean, atol=0.5)


def test_a_binary_grid_has_the_colours_of_the_states():
    p = np.linspace(0, 1, 101)[None]
    states = plotting.binary_states(p)
    assert states.min() >= 0
    np.testing.assert_allclose(states.sum(axis=0), 1)
    np.testing.assert_allclose(states[[State.FREE, State.STATIC]][:, :, ::-1], states[[State.STATIC, State.FREE]])
    painted = plotting.occupancy_colours(plotting.binary_states(np.array([[0.0, 0.5, 1.0]])))[0]
    assert (painted == [plotting.STATE_COLOURS[s] for s in (State.FREE, State.UNKNOWN, State.STATIC)]).all()


def test_maps_have_forward_up_and_left_on_the_left_without_flipping_the_array():
    labels = np.arange(8).reshape(4, 2)
    ax = plotting.grid_labels(SPEC, labels, KITTI_14)
    (picture,) = ax.images
    np.testing.assert_array_equal(picture.get_array(), KITTI_14.colours(labels))
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert left > right, "y must decrease to the right"
    assert top > bottom, "x must grow upwards"
    for (row, col), (x, y) in zip(np.ndindex(4, 2), SPEC.centers().reshape(-1, 2), strict=True):
        across, down = (y - left) / (right - left), (top - x) / (top - bottom)
        assert (int(down * 4), int(across * 2)) == (row, col)


def test_an_arrow_starts_at_its_cell_and_ends_half_a_second_later():
    probability, velocity = np.zeros((4, 4, 2)), np.full((2, 4, 2), np.nan)
    probability[2, 2, 0] = 1
    velocity[:, 2, 0] = 3.0, -1.0
    ax = plotting.velocity(SPEC, probability, velocity, plotting.occupancy(SPEC, probability))
    (arrows,) = [child for child in ax.collections if hasattr(child, "U")]
    np.testing.assert_allclose(arrows.XY, [[0.5, 1.5]])
    assert (arrows.U.item(), arrows.V.item()) == (-0.5, 1.5)


def test_cells_of_a_square_share_an_arrow_and_only_probably_dynamic_ones_count():
    spec = GridSpec(x_min=0, x_max=4, y_min=0, y_max=4, cell=1)
    probability, velocity = np.zeros((4, 4, 4)), np.zeros((2, 4, 4))
    probability[2, 0, 0], probability[2, 1, 1], probability[2, 0, 1], probability[2, 3, 3] = 0.9, 0.6, 0.4, 1.0
    velocity[0, 0, 0], velocity[0, 1, 1], velocity[0, 3, 3] = 2.0, 4.0, np.nan
    start, speed = plotting.velocity_arrows(spec, probability, velocity)
    np.testing.assert_allclose(start, [[3, 3]])
    np.testing.assert_allclose(speed, [[3, 0]])


@pytest.mark.parametrize(("speeds", "deviation", "arrows"), [((2, 5), 2.0, 1), ((2, 8), 0.0, 0), ((4, 4), 2.6, 0)])
def test_an_arrow_needs_a_velocity_that_is_known(speeds, deviation, arrows):
    """Variance within the cells plus variance between them: 4 + 1.5^2, 3^2 and 2.6^2, against 2.5^2."""
    spec = GridSpec(x_min=0, x_max=2, y_min=0, y_max=2, cell=1)
    probability, velocity, covariance = np.zeros((4, 2, 2)), np.full((2, 2, 2), np.nan), np.zeros((2, 2, 2, 2))
    probability[2, 0] = 0.9
    velocity[:, 0] = speeds, (0, 0)
    covariance[0, 0, 0] = deviation**2
    assert len(plotting.velocity_arrows(spec, probability, velocity, covariance)[0]) == arrows


def test_a_still_grid_has_no_arrows():
    start, speed = plotting.velocity_arrows(SPEC, np.full((4, 4, 2), 0.25), np.full((2, 4, 2), np.nan))
    assert start.shape == speed.shape == (0, 2)


def test_legends_name_what_occurs_and_nothing_else():
    labels = np.array([[0, 3], [3, 255], [0, 0], [0, 0]])
    names = [text.get_text() for text in plotting.grid_labels(SPEC, labels, KITTI_14).get_legend().get_texts()]
    assert names == ["road", "car"]


def test_points_are_drawn_where_eq_1_puts_them_and_the_nearest_last():
    image = np.zeros((11, 21, 3), np.uint8)
    here = frame(image, [[5, 0, 0, 0], [10, 1, 0, 0], [-5, 0, 0, 0], [2, 100, 0, 0]])
    pixels, depth = visible_points(here)
    np.testing.assert_allclose(pixels, [[9, 5], [10, 5]])
    np.testing.assert_allclose(depth, [10, 5])
    ax = plotting.points_on_image(here)
    np.testing.assert_allclose(ax.collections[0].get_offsets(), pixels)


def test_a_plane_is_drawn_where_its_cells_are_seen_and_the_nearest_last():
    """The camera sits at the LIDAR, 1.73 m above the ground: seen from there, a plane at that height is one line."""
    here = frame(np.zeros((11, 21, 3), np.uint8), np.zeros((0, 4)))
    ahead = GridSpec(x_min=-2, x_max=10, y_min=-4, y_max=4, cell=4)  # the last row of cells lies at the camera
    level = plotting.plane_on_image(ahead, 1.73, here).collections[0]
    np.testing.assert_allclose(level.get_offsets(), [[7.5, 5], [12.5, 5], [5, 5], [15, 5]])
    lower = plotting.plane_on_image(ahead, 1.33, here).collections[0]
    np.testing.assert_allclose(lower.get_offsets(), [[7.5, 5.5], [12.5, 5.5], [5, 6], [15, 6]])
    depth = plotting.depth_colours(np.array([8, 8, 4, 4]))
    np.testing.assert_allclose(lower.get_facecolors()[:, :3] * 255, depth)


def test_near_and_far_have_other_colours_beyond_the_range_they_stay():
    near, far = plotting.DEPTH_RANGE
    colours = plotting.depth_colours(np.array([near, far, near / 2, far * 2]))
    assert np.abs(colours[0].astype(int) - colours[1]).max() > 100
    np.testing.assert_array_equal(colours[:2], colours[2:])


def test_an_overlay_leaves_unlabelled_pixels_alone():
    image = np.full((1, 2, 3), 100, np.uint8)
    mixed = blend_labels(image, np.array([[255, 0]]), KITTI_14, opacity=0.5)
    np.testing.assert_array_equal(mixed[0, 0], image[0, 0])
    np.testing.assert_allclose(mixed[0, 1], np.add(100, KITTI_14.rgb[0]) / 2, atol=0.5)
    assert plotting.image_labels(image, np.array([[255, 0]]), KITTI_14).get_legend().get_texts()[0].get_text() == "road"


def test_confusion_is_in_per_cent_of_the_truth_and_a_row_without_truth_is_empty():
    ax = plotting.confusion(np.array([[3, 1], [0, 0]]), ["road", "car"])
    assert [text.get_text() for text in ax.texts] == ["75", "25"]


def test_values_carry_a_colour_bar_with_their_name():
    for ax in (
        plotting.grid_values(SPEC, np.ones((4, 2)), "height [m]"),
        plotting.image_values(np.ones((3, 4)), "score"),
    ):
        assert [other.get_ylabel() for other in ax.figure.axes if other is not ax] != [""]


@pytest.mark.parametrize(
    "draw",
    [
        lambda: plotting.occupancy(SPEC, np.zeros((3, 4, 2))),
        lambda: plotting.occupancy(SPEC, np.zeros((4, 2, 4))),
        lambda: plotting.grid_labels(SPEC, np.zeros((2, 4), int), KITTI_14),
        lambda: plotting.points_on_image(frame(None, [[1, 0, 0, 0]])),
        lambda: plotting.plane_on_image(SPEC, 0.0, frame(None, [[1, 0, 0, 0]])),
        lambda: plotting.image_labels(np.zeros((2, 2, 3), np.uint8), np.zeros((3, 3), int), KITTI_14),
        lambda: plotting.confusion(np.zeros((2, 2)), ["road"]),
    ],
)
def test_wrong_input_is_named(draw):
    with pytest.raises(ArgumentError, match="expected"):
        draw()


def test_label_maps_share_one_legend_of_all_their_classes():
    spec = GridSpec(0, 2, -1, 1, 1)
    maps = {"left": np.array([[0, 0], [0, 3]]), "right": np.array([[1, 255], [1, 1]])}
    figure = plotting.label_maps(spec, maps, KITTI_14)
    assert [ax.get_title() for ax in figure.axes] == ["left", "right"]
    assert [ax.get_legend() is None for ax in figure.axes] == [True, False]
    assert [text.get_text() for text in figure.axes[1].get_legend().get_texts()] == ["road", "sidewalk", "car"]
