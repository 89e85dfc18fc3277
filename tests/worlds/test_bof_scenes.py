"""What lecture 03 and its exercise say of walkers, a bus and a train of posts, where no cell of theirs asserts it."""

import numpy as np
import pytest
from worlds.lecture_03_scenes import PAPER, pass_by, unchanging, walker

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    BofParams,
    BofState,
    Evidence,
    State,
    VelocityLattice,
    WorldModel,
    bof_predict,
    bof_update,
)


@pytest.mark.parametrize(
    ("speed", "spacing", "found"),
    [(1.4, 2, False), (1.4, 1.4, True), (1.4, 1, True), (2.0, 2, True), (1.0, 2, False), (1.0, 1, False)],
)
def test_a_walker_is_found_if_the_lattice_has_the_speed_and_it_is_not_too_low(speed, spacing, found):
    told = walker(speed, spacing, start=15.0)[-10:].mean()
    assert told > 0.6 if found else told < 0.45


def test_the_slower_walker_is_found_in_cells_half_as_wide():
    assert walker(1.0, 1, cell=0.25)[-10:].mean() > 0.7


def test_a_world_without_change_keeps_its_first_sight():
    world = unchanging(PAPER)
    assert not np.any(world.rates)
    assert world.stop_rate == 0
    assert world.first_sight == PAPER.first_sight


def test_at_even_odds_a_bus_that_was_there_before_still_seems_to_stand():
    _, states = pass_by(1.6, WorldModel(first_sight=(0.952, 0.024, 0.024), walls=None))
    assert states[State.STATIC, 4:, 23:26].min() > 0.9  # 11.5 to 13 m, which the bus covers to the end


def posts(dt, first_sight, scans):
    """Return P(STATIC) and P(DYNAMIC) of the fourteen posts behind the first of a train, after some scans."""
    spec, params = GridSpec(0, 60, 0, 1.5, 0.5), BofParams(VelocityLattice(20, 5), WorldModel(first_sight=first_sight))
    state, x = BofState.nothing_known(spec, params.lattice), spec.centers()[:, 1, 0]
    for k in range(scans):
        places = 30.25 - 20 * dt * k + 2 * np.arange(40)
        hit = np.zeros(spec.shape, bool)
        hit[:, 1] = (abs(x[:, None] - places) < 0.26).any(axis=1)
        scan = Evidence(*(np.where(hit, *pair).astype(np.float32) for pair in ((0.8, 0.3), (0.05, 0.7))))
        state = bof_update(bof_predict(state, spec, params, dt), spec, scan, params)
    rows = [int(abs(x - place).argmin()) for place in places if 0 < place < 60][:14]
    return state.probability[[State.STATIC, State.DYNAMIC]][:, rows, 1]


@pytest.mark.parametrize("first_sight", [(0.952, 0.045, 0.003), (0.952, 0.024, 0.024), (0.952, 0.003, 0.045)])
def test_posts_in_step_with_the_scans_are_static_whatever_first_sight_says(first_sight):
    static, dynamic = posts(0.1, first_sight, scans=15)
    assert dynamic[0] > 0.9
    assert static[8:].min() > 0.9


def test_posts_out_of_step_with_the_scans_are_dynamic():
    assert posts(1 / 15, WorldModel.first_sight, scans=22)[1].min() > 0.9
