"""The whole system: what its tables say by hand, what d-separation says of its chain, and what each cut edge costs."""

import itertools

import numpy as np
import pytest
from pyagrum_oracle import assert_oracle_agrees
from worlds.lecture_00_street import CLASS_OF, CONTENTS, PARAMS, STREET, SystemWorld
from worlds.lecture_00_system import class_and_sensors, same_belief, street, system_gain, whole_system
from worlds.lecture_02_cell import exact_cell, read_scans

from semgrid_edu.graphical import d_separated, eliminate, enumerate_marginals, why_dependent

ROAD, SIDEWALK, PARKED, MOVING, BUILDING = range(len(CONTENTS))
WORLDS = [SystemWorld(), SystemWorld(1), SystemWorld(3), SystemWorld(dt=0.1, pixel_right=0.95, range_error=0.2)]


def test_a_beam_over_two_cells_by_hand():
    """Free cells reflect in 0.05, things in 0.8; a return is measured in the other cell in 0.05."""
    scan = SystemWorld().scan()
    np.testing.assert_allclose(scan[ROAD, SIDEWALK, 2], 0.95**2)
    np.testing.assert_allclose(scan[PARKED, ROAD, 0], 0.8 * 0.95 + 0.2 * 0.05 * 0.05)
    np.testing.assert_allclose(scan[PARKED], scan[[PARKED] * 5, [0, 1, 2, 3, 4]])
    np.testing.assert_array_equal(scan[MOVING], scan[BUILDING])


def test_the_pixel_sees_what_stands_nearest():
    image = SystemWorld().image()
    car, building, sidewalk = 2, 3, 1
    assert image[MOVING, BUILDING, car] == pytest.approx(0.8)
    assert image[ROAD, BUILDING, building] == pytest.approx(0.8)
    assert image[ROAD, SIDEWALK, sidewalk] == pytest.approx(0.8)
    assert image[SIDEWALK, ROAD, sidewalk] == pytest.approx(0.2 / 3)


def test_contents_change_by_the_filters_rates():
    """No time: no change. In a short time a moving car leaves at the rate 1.0 + 0.1, and leaves road or sidewalk."""
    np.testing.assert_allclose(SystemWorld(dt=0.0).change(), np.eye(5), atol=1e-12)
    short = SystemWorld(dt=1e-4).change()
    np.testing.assert_allclose(short.sum(axis=1), 1)
    assert short[MOVING, MOVING] == pytest.approx(1 - 1.1e-4, abs=1e-7)
    np.testing.assert_allclose(short[MOVING, [ROAD, SIDEWALK]], [1e-4 * 5 / 7, 1e-4 * 2 / 7], rtol=1e-3)
    assert short[MOVING, PARKED] == pytest.approx(1e-5, rel=1e-3)
    assert short[MOVING, BUILDING] == 0


def test_o_is_the_exact_filter_of_each_cell():
    """Returns from near and from far: the near cell is hit, then passed; the far one is hidden, then hit."""
    o = SystemWorld().occupancy()
    assert [len(one) for one in o] == [3, 9]
    for cell, says in ((0, "#."), (1, " #")):
        first, then = read_scans(says)
        start = exact_cell([first], 0.0, PARAMS).updated[0]
        np.testing.assert_allclose(o[0][0, cell], start, atol=1e-6)
        np.testing.assert_allclose(o[1][1, cell], exact_cell([then], 0.5, PARAMS, start).updated[0], atol=1e-6)


def test_the_joint_by_the_definition():
    world = SystemWorld(1)
    for cell, joint in zip(("near0", "far0"), class_and_sensors(world, 0), strict=True):
        wanted = enumerate_marginals(street(world), (cell, "l0", "i0")).table
        np.testing.assert_allclose(joint, np.einsum("wc,wli->cli", CLASS_OF, wanted), atol=1e-12)


def test_the_joint_of_two_instants_by_summing_over_streets():
    """One entry by loops: the far cell holds a building; returns from near, then far; images of a car, a building."""
    world = SystemWorld()
    scan, image, change = world.scan(), world.image(), world.change()
    total = 0.0
    for n0, f0, n1 in itertools.product(range(5), repeat=3):
        first = STREET[n0] * STREET[f0] * scan[n0, f0, 0] * image[n0, f0, 2]
        then = change[n0, n1] * change[f0, BUILDING] * scan[n1, BUILDING, 1] * image[n1, BUILDING, 3]
        total += first * then
    assert class_and_sensors(world, 1)[1, 3, 3 * 0 + 1, 4 * 2 + 3] == pytest.approx(total)


def test_g_knows_the_world_through_o_and_p_alone():
    model = whole_system().model
    everything = [name for name in model.names if name[:-1] in ("near", "far", "l", "i")]
    assert d_separated(model, "g1", everything, given=("o1", "p1"))
    assert d_separated(model, "g1", "g0", given=("o1", "p1"))
    assert why_dependent(model, "near1", "i0", given=("l0", "l1", "i1"))
    assert d_separated(model, "o1", "i1", given=("near0", "far0", "near1", "far1"))


def test_near_and_far_are_coupled_by_what_both_cause():
    model = whole_system(SystemWorld(1)).model
    assert d_separated(model, "near0", "far0")
    assert why_dependent(model, "near0", "far0", given="i0") == ("near0", "i0", "far0")


def test_g_is_the_best_label_from_o_and_p():
    """Summed over everything, g is right as often as the score says."""
    world = SystemWorld()
    right = system_gain(world).cell_by_cell.right
    for name, labels, expected in zip(("near1", "far1"), np.divmod(np.arange(16), 4), right, strict=True):
        joint = CLASS_OF.T @ eliminate(whole_system(world).model, (name, "g1")).table
        assert joint[labels, np.arange(16)].sum() == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("world", WORLDS)
def test_who_knows_more_loses_less(world):
    gain = system_gain(world)
    ladder = [gain.image, gain.cell_by_cell, gain.neighbours, gain.scans, gain.joint]
    for less, more in itertools.pairwise(ladder):
        assert (more.log_loss <= less.log_loss + 1e-12).all()
        assert (more.right >= less.right - 1e-12).all()
    assert (gain.multiplied.log_loss >= gain.cell_by_cell.log_loss - 1e-12).all()


def test_the_numbers_of_the_docstring():
    gain = system_gain()
    for score, log_loss in (
        (gain.image, [1.008, 0.938]),
        (gain.multiplied, [1.201, 1.059]),
        (gain.cell_by_cell, [0.743, 0.720]),
        (gain.joint, [0.682, 0.618]),
    ):
        np.testing.assert_allclose(score.log_loss, log_loss, atol=0.0006)
    np.testing.assert_allclose(gain.cell_by_cell.right, [0.699, 0.726], atol=0.0006)
    np.testing.assert_allclose(gain.joint.right, [0.713, 0.760], atol=0.0006)
    np.testing.assert_allclose(gain.neighbours.log_loss, gain.scans.log_loss, atol=1e-12)
    assert len(set(same_belief(SystemWorld().occupancy()[1]))) == 9


def test_the_prices_of_the_cut_edges():
    """What the earlier image adds is what classes that aren't carried on cost; o in both cells tells all scans."""
    gain = system_gain()
    np.testing.assert_allclose(gain.scans.log_loss - gain.joint.log_loss, [0.05, 0.10], atol=0.005)
    np.testing.assert_allclose(gain.neighbours.log_loss, gain.scans.log_loss, atol=1e-12)
    assert (
        gain.neighbours.log_loss - gain.joint.log_loss > 0.8 * (gain.cell_by_cell.log_loss - gain.joint.log_loss)
    ).all()


def test_one_instant_leaves_nothing_to_gain_beyond_the_neighbour():
    gain = system_gain(SystemWorld(1))
    np.testing.assert_allclose(gain.joint.log_loss, gain.neighbours.log_loss, atol=1e-12)


def test_images_that_say_nothing_gain_nothing():
    """The network guesses among four classes."""
    gain = system_gain(SystemWorld(pixel_right=0.25))
    np.testing.assert_allclose(gain.joint.log_loss, gain.scans.log_loss, atol=1e-9)


def test_a_blind_camera_leaves_the_image_at_the_prior():
    log_loss = system_gain(SystemWorld(1, pixel_right=0.25)).image.log_loss
    prior = STREET @ CLASS_OF
    np.testing.assert_allclose(log_loss, -(prior * np.log(prior)).sum())


def test_pyagrum_agrees():
    assert_oracle_agrees(whole_system().model, {"l0": 0, "l1": 1, "i0": 2, "i1": 3})
