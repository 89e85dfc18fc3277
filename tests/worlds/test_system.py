"""The whole system: what its tables say by hand, what d-separation says of its chain, and what each cut edge costs."""

import itertools

import numpy as np
import pytest
from worlds.lecture_00_street import CLASS_OF, CONTENTS, PARAMS, STREET, SystemWorld
from worlds.lecture_00_system import class_and_sensors, forgotten_class, same_belief, whole_system
from worlds.lecture_02_cell import exact_cell, read_scans

from semgrid_edu.graphical import d_separated, eliminate, why_dependent

ROAD, SIDEWALK, PARKED, MOVING, BUILDING = range(len(CONTENTS))


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


def test_g_is_right_as_often_as_the_best_label_from_p_and_the_cells_column_of_o():
    """Summed over everything: for each column of o and each class of p, the most probable class of the cell."""
    world = SystemWorld()
    model, o = whole_system(world).model, world.occupancy()[1]
    for cell, (name, labels) in enumerate(zip(("near1", "far1"), np.divmod(np.arange(16), 4), strict=True)):
        right = (CLASS_OF.T @ eliminate(model, (name, "g1")).table)[labels, np.arange(16)].sum()
        joint = np.tensordot(CLASS_OF, eliminate(model, (name, "o1", "p1")).table, axes=(0, 0))
        columns = np.eye(9)[same_belief(o[:, cell])]
        assert right == pytest.approx(np.einsum("kop,og->kgp", joint, columns).max(axis=0).sum(), abs=1e-9)


def test_a_forgotten_image_costs_the_entropy_that_it_would_have_removed():
    """-log P(class of the far cell | readings), summed over all streets and readings by the joint distribution."""
    joint = class_and_sensors(SystemWorld(), 1)[1]
    told = joint.reshape(4, 9, 4, 4)
    for found, known in zip(forgotten_class()[:2], (told, told.sum(axis=2, keepdims=True)), strict=True):
        assert found == pytest.approx(-(known * np.log(known / known.sum(axis=0))).sum(), abs=1e-9)


def test_o_in_both_cells_tells_all_sequences_of_scans_apart():
    assert len(set(same_belief(SystemWorld().occupancy()[1]))) == 9
