"""The companion on real streets: what is switched off is off, and the rest of the street stays."""

from dataclasses import replace

import numpy as np
import pytest
from worlds.lecture_04_street_scores import StreetScores
from worlds.lecture_04_suspects import BEFORE, GROUPS, arrivals_barred, counts, opaque, without_pillars

from semgrid_edu.fast import predict
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import FilterState, Particles, State
from semgrid_edu.workshop.simulation import simulate
from semgrid_edu.workshop.simulation.things.materials import Kind


def test_an_opaque_fence_stops_beams_that_the_mesh_lets_through():
    drive = simulate(0, 1, "mesh")
    through = drive.scan(0).points
    opaque(drive)
    stopped = drive.scan(0).points
    assert drive.porous.opacity.min() > 1e5
    far = [np.sum(np.hypot(*points[:, :2].T) > 20) for points in (through, stopped)]
    assert far[1] < far[0]


def test_without_pillars_no_ray_can_meet_a_pole_and_all_else_is_left():
    drive = simulate(0, 1, "walls")
    kinds = drive.static.shape.kind
    without_pillars(drive)
    assert (kinds == Kind.POLE).any()
    np.testing.assert_array_equal(drive.static.shape.kind, kinds[kinds != Kind.POLE])
    assert len(drive.static.instance) == len(drive.static.shape.faces)


def test_barred_arrivals_claim_free_cells_and_no_unknown_ones():
    line, calm = GridSpec(0, 4, 0, 1, 1), replace(BEFORE, rates=((0.0,) * 4,) * 4, stop_rate=0.0, max_acceleration=0.0)
    for state, claims in ((State.FREE, 0.5), (State.UNKNOWN, 0.0)):
        b = np.zeros((4, 4, 1), np.float32)
        b[state] = 1
        b[:, 3, 0] = 0.5 * np.eye(4)[State.FREE] + 0.5 * np.eye(4)[State.DYNAMIC]
        particle = Particles(*(np.array(a, np.float32) for a in ([[0.5, 0.5]], [[10.0, 0.0]], [0.5])))
        before = FilterState(b, particle, np.zeros(line.shape, np.float32))
        with arrivals_barred():
            after = predict(before, line, calm, 0.1, np.random.default_rng(0))
        assert after.probability[State.DYNAMIC, 2, 0] == pytest.approx(claims, abs=1e-6)
        assert predict(before, line, calm, 0.1, np.random.default_rng(0)).probability[State.DYNAMIC, 2, 0] == 0.5


def test_counts_add_the_groups_of_a_border_and_hold_nothing_of_groups_that_never_came():
    scores = StreetScores(GridSpec.compact())
    scores.cells.update({"fences": [10, 1], "walls": [5, 2], "moving cars": [4, 4]})
    assert counts(scores) == {name: [0, 0] for name in GROUPS} | {"border": [15, 3], "moving cars": [4, 4]}
