"""Late fusion: exact answers summed by hand, independences, and when multiplying costs nothing."""

import numpy as np
import pytest
from worlds.lecture_08_late_fusion import TwoSensors, car_by_both, late_fusion

from semgrid_edu.graphical import d_separated


def test_a_cell_whose_pixel_shows_a_car_and_that_no_beam_reached():
    # By hand: seen 0.5 * 0.95 * 0.1 or 0.5 * 0.05 * 0.1, hidden 0.5 * 0.9 * 0.95 whatever stands there.
    hidden = 0.5 * 0.9 * 0.95
    car, road = 0.2 * (0.0475 + hidden), 0.8 * (0.0025 + hidden)
    by_label = 0.2 * (0.475 + 0.45), 0.8 * (0.025 + 0.45)  # UNKNOWN is as probable over road as over a car
    expected = car / (car + road), by_label[0] / sum(by_label)
    np.testing.assert_allclose(car_by_both(1, 2), expected)


def test_the_sensors_are_independent_only_once_it_is_known_whether_the_cell_is_hidden():
    model = late_fusion().model
    assert d_separated(model, "m", "hid")
    assert not d_separated(model, "m", "hid", given=("a",))
    assert not d_separated(model, "a", "o", given=("m",))
    assert d_separated(model, "a", "o", given=("m", "hid"))


@pytest.mark.parametrize("world", [TwoSensors(hidden=0.0), TwoSensors(hidden=1.0)], ids=["seen", "hidden"])
@pytest.mark.parametrize("label", [0, 1])
@pytest.mark.parametrize("state", [0, 1, 2])
def test_without_doubt_about_hiding_late_fusion_is_exact(world, label, state):
    exact, late = car_by_both(label, state, world)
    assert late == pytest.approx(exact)
