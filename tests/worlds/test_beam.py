"""A beam over several cells: explaining away by hand, the exemplar's numbers, and the package's own thick walls."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds.lecture_02_beam import (
    BeamWorld,
    beam_beliefs,
    beam_likelihood,
    beam_over_cells,
    range_state,
)  # fmt: skip
from worlds.lecture_02_thick_walls import (
    count_rings,
    draw_ranges,
    package_row,
    same_sensor,
    scan_with_pose_error,
    thick_walls,
)  # fmt: skip

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import d_separated, eliminate, why_dependent

COARSE = [4.0, 4.6, 3.6, 4.2]
"""Four returns from a wall in the fifth of eight cells, with a noise of one cell."""


def exact_by_hand(world, ranges):
    """P(map | ranges): prior times, for each range, the sum over which cell reflects, without any factor."""
    weights = {}
    for m in itertools.product((0, 1), repeat=world.n_cells):
        weights[m] = np.prod([world.prior if one else 1 - world.prior for one in m])
        for z in ranges:
            reaches, likelihood = 1.0, 0.0
            for k, one in enumerate(m):
                reflects = world.hit if one else world.clutter
                likelihood += reaches * reflects * np.exp(-0.5 * ((k - z) / world.noise) ** 2)
                reaches *= 1 - reflects
            weights[m] *= likelihood
    table = np.reshape(list(weights.values()), [2] * world.n_cells)
    return table / table.sum()


def test_cells_depend_on_each_other_once_the_range_is_known():
    model = beam_over_cells(BeamWorld(n_cells=4)).model
    assert d_separated(model, "m1", "m4")
    assert not d_separated(model, "m1", "m4", given="z1")
    assert why_dependent(model, "m1", "m4", given="z1") == ("m1", "r1", "m4")


def test_the_graph_of_four_beams_is_the_sum_over_maps():
    world = BeamWorld()
    known = {f"z{b}": range_state(world, z) for b, z in enumerate(COARSE, start=1)}
    found = eliminate(beam_over_cells(world, 4).model, world.cells, known).normalised()
    np.testing.assert_allclose(found.table, exact_by_hand(world, COARSE), atol=1e-9)


def test_no_return_says_that_the_row_is_probably_free():
    world = BeamWorld(n_cells=2)
    np.testing.assert_allclose(beam_likelihood(world, None).table, [[0.99**2, 0.99 * 0.1], [0.1 * 0.99, 0.01]])


def test_the_package_agrees_where_the_range_is_exact():
    """The cell of a return takes P(z | occupied) / P(z | free) = 0.8 / 0.05 both ways; behind, the prior stays."""
    exact, package = beam_beliefs(same_sensor(0), [4.0]).exact[0], package_row([4.0])[0]
    np.testing.assert_allclose(exact[4:], [0.8, 0.2, 0.2, 0.2], atol=1e-6)
    np.testing.assert_allclose(package[4:], [0.8, 0.2, 0.2, 0.2], atol=1e-6)
    assert (package[:4] < 0.2).all()
    assert (exact[:4] < 0.2).all()


def thickness(beliefs):
    """The mean number of cells that are called occupied."""
    return (beliefs > 0.5).sum(axis=1).mean()


def test_the_package_makes_walls_thick():
    """By about 1.5 cells, of which forgetting that cells are coupled costs a tenth; each cause is switched off."""
    walls = thick_walls()
    found = {name: thickness(beliefs) for name, beliefs in walls.items()}
    right = {"exact": 1.08, "cell by cell": 1.17, "package": 2.48, "no clamp": 1.98, "beam's passes": 2.12}
    assert found == pytest.approx(right | {"no lower limit": 1.94, "neither": 1.6, "passes behind": 1.84}, abs=0.12)
    assert thickness(thick_walls(noise=0.1)["neither"]) == pytest.approx(1, abs=0.1)


def test_more_scans_make_the_packages_wall_thicker_and_the_exact_one_no_thicker_than_it_is():
    walls = [thick_walls(scans=n, draws=30, seed=1) for n in (1, 5, 10, 20)]
    assert (np.diff([wall["package"][:, 5].mean() for wall in walls]) > 0).all()
    assert walls[-1]["exact"][:, 5].mean() < 0.2 < walls[-1]["package"][:, 5].mean()


def test_all_walls_at_once_are_those_of_one_sequence_of_scans():
    world = same_sensor(0.5)
    ranges = draw_ranges(world, [0, 0, 0, 0, 1, 0, 0, 0], 6, np.random.default_rng(3))
    walls = thick_walls(scans=6, draws=1, seed=3)
    beliefs = beam_beliefs(world, ranges)
    np.testing.assert_allclose(walls["exact"][0], beliefs.exact[-1], atol=1e-12)
    np.testing.assert_allclose(walls["cell by cell"][0], beliefs.cell_by_cell[-1], atol=1e-12)
    np.testing.assert_allclose(walls["package"][0], package_row(ranges)[-1], atol=1e-12)


def test_walls_stay_thin_when_every_return_lies_in_its_cell():
    for ranges in ([4.0] * 10, [4.1, 3.8, 4.3, 4.0]):
        assert (package_row(ranges)[-1] > 0.5).sum() == 1


def test_a_second_ring_adds_little_when_it_shares_the_pose_error():
    counted = count_rings()
    np.testing.assert_allclose(counted.exact, [0.40, 0.46, 0.46], atol=0.005)
    np.testing.assert_allclose(counted.independent, [0.40, 0.57, 0.69], atol=0.005)
    np.testing.assert_allclose(counted.package, [0.80, 0.97, 0.97], atol=0.005)
    assert 0 < counted.exact[2] - counted.exact[1] < 0.001


def test_without_pose_error_to_speak_of_rings_are_independent():
    counted = count_rings(noise=0.1, rings=2)
    np.testing.assert_allclose(counted.exact, counted.independent, atol=1e-6)


def test_rings_are_coupled_by_the_pose():
    stage = scan_with_pose_error(same_sensor(0.3, n_cells=4))
    model = stage.model
    everything = ("m1", "m2", "m3", "m4")
    assert why_dependent(model, "z1", "z2", given=everything) == ("z1", "e", "z2")
    assert d_separated(model, "z1", "z2", given=(*everything, "e"))
    assert d_separated(beam_over_cells(BeamWorld(n_cells=4), 2).model, "z1", "z2", given=everything)


def test_draws_come_from_the_forward_model():
    world = same_sensor(0.5, n_cells=4)
    ranges = draw_ranges(world, [0, 0, 1, 0], 20_000, np.random.default_rng(0))
    missing = np.mean([z is None for z in ranges])
    assert missing == pytest.approx(0.95**3 * 0.2, abs=0.01)
    seen = np.array([z for z in ranges if z is not None])
    assert np.mean(abs(seen - 2) < 1) == pytest.approx(0.87, abs=0.05)


@pytest.mark.parametrize("z", [99.0, -50.0, np.nan])
def test_a_range_that_nothing_can_give_is_refused(z):
    with pytest.raises(ArgumentError, match=r"^z:"):
        range_state(BeamWorld(), z)


@settings(deadline=None, max_examples=20)
@given(st.lists(st.none() | st.integers(0, 5).map(float), min_size=1, max_size=5), st.floats(0.05, 0.95))
def test_cell_by_cell_is_exact_where_the_range_is(ranges, prior):
    beliefs = beam_beliefs(BeamWorld(n_cells=6, noise=0, prior=prior), ranges)
    np.testing.assert_allclose(beliefs.cell_by_cell, beliefs.exact, atol=1e-12)
