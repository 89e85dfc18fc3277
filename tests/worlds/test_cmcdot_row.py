"""CMCDOT against joint inference and BOF: sampling error falls like N^-1/2, and what remains is BOF's bias."""

import numpy as np
import pytest
from worlds.lecture_03_bof import AT_THE_EDGE, STANDING_OR_DRIVING, TOWARDS_A_FENCE, bof_beliefs
from worlds.lecture_03_row import HIT, NO_CHANGE, NOT_SEEN, Cell, CellsInARow, exact_beliefs
from worlds.lecture_04_cmcdot import FORGETTING, LEFT_OR_RIGHT, particle_beliefs, sampling_error
from worlds.lecture_04_cmcdot_graph import FROM_BOTH_SIDES, cmcdot_stage

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import eliminate
from semgrid_edu.metrics import total_variation

NUMBERS = [100, 400, 1600, 6400]


def cell_2(world):
    """Return the distribution of cell 2 after the first scan, by exact inference in the graph."""
    seen = world.scans[0][1]
    given = {"one1": 1} | ({"z1": int(seen == HIT)} if seen != NOT_SEEN else {})
    return eliminate(cmcdot_stage(world).model, "m1", given).normalised().table


def test_where_bof_is_exact_particles_tend_to_the_exact_answer():
    error = sampling_error(AT_THE_EDGE, NUMBERS, seeds=range(40))
    assert error.bias < 1e-9
    np.testing.assert_allclose(error.to_exact, error.to_bof, atol=1e-9)
    assert -0.6 < error.slope < -0.4
    assert error.to_exact[-1] < 0.001


def test_elsewhere_they_tend_to_bof_and_its_bias_remains():
    error = sampling_error(LEFT_OR_RIGHT, NUMBERS, seeds=range(40))
    assert -0.6 < error.slope < -0.4
    assert error.bias == pytest.approx(0.051, abs=5e-4)
    np.testing.assert_allclose(error.to_bof[[0, -1]], [0.010, 0.001], rtol=0.25)
    np.testing.assert_allclose(error.to_exact**2, error.bias**2 + error.to_bof**2, rtol=0.05)
    assert error.to_exact[-1] == pytest.approx(error.bias, rel=0.01)


def test_the_bias_is_that_of_two_cells_that_hold_the_same_thing():
    errors = total_variation(bof_beliefs(LEFT_OR_RIGHT), exact_beliefs(LEFT_OR_RIGHT))
    assert errors[0].argmax() == 0
    assert errors[0, 0] == pytest.approx(0.218, abs=5e-4)


@pytest.mark.parametrize("world", [STANDING_OR_DRIVING, TOWARDS_A_FENCE])
def test_particles_of_one_velocity_per_cell_have_nothing_to_sample(world):
    np.testing.assert_allclose(particle_beliefs(world, 100, seed=0), bof_beliefs(world), atol=1e-6)


def test_the_same_seed_gives_the_same_bits():
    assert np.array_equal(particle_beliefs(LEFT_OR_RIGHT, 50, seed=1), particle_beliefs(LEFT_OR_RIGHT, 50, seed=1))
    assert not np.array_equal(particle_beliefs(LEFT_OR_RIGHT, 50, seed=1), particle_beliefs(LEFT_OR_RIGHT, 50, seed=2))


UNSEEN = {"unknown": 1.0}
BESIDE_A_WALL = ({"static": 0.6, "right": 0.4}, UNSEEN, {"static": 0.7, "left": 0.1})
"""What comes into cell 2 comes out of something that probably stands, and goes on towards what probably stands, too."""


@pytest.mark.parametrize("scan", [".x.", "...", ".?."])
@pytest.mark.parametrize(
    "cells", [FROM_BOTH_SIDES.cells, BESIDE_A_WALL, ({}, {"static": 0.5}, {"left": 0.9}), ({}, {}, {})]
)
def test_the_graph_computes_what_predict_and_update_do_in_one_cell(cells, scan):
    world = CellsInARow(cells, (scan,), FORGETTING, clearing_time=0.0)
    bof, found = bof_beliefs(world)[0, 1], cell_2(world)
    moving = bof[[Cell.LEFT, Cell.RIGHT]].sum()
    np.testing.assert_allclose(found, [*bof[[Cell.FREE, Cell.STATIC]], moving, bof[Cell.UNKNOWN]], atol=1e-12)


@pytest.mark.parametrize("scan", ["?x?", "?.?", "???"])
@pytest.mark.parametrize("own", [{"right": 0.5}, {"static": 0.3, "left": 0.2, "right": 0.3, "unknown": 0.1}])
def test_the_graph_is_joint_inference_where_only_the_cell_itself_may_hold_what_moves(own, scan):
    """FREE cells stay free, so that nothing stands up in a neighbour and is in the way there."""
    world = CellsInARow(({}, own, {}), (scan,), (NO_CHANGE[0], *FORGETTING[1:]), clearing_time=0.0)
    found = cell_2(world)
    exact = exact_beliefs(world)[0, 1]
    moving = exact[[Cell.LEFT, Cell.RIGHT]].sum()
    np.testing.assert_allclose(found, [*exact[[Cell.FREE, Cell.STATIC]], moving, exact[Cell.UNKNOWN]], atol=1e-12)


def test_more_than_one_thing_on_the_move_is_refused():
    with pytest.raises(ArgumentError, match="at most one moving thing"):
        cmcdot_stage(CellsInARow(({"right": 0.8}, {}, {"left": 0.5}), ("...",)))
