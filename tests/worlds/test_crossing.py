"""The streets of lecture 04: what is measured there, and the table of 24 seeds."""

import numpy as np
from worlds.lecture_04_crossing import luck, mean_dynamic, measure_luck, on_a_line, street

from semgrid_edu.occupancy import State


def test_the_table_of_seeds_is_what_a_run_measures():
    np.testing.assert_allclose(measure_luck(300, seeds=[3])[0], luck()[300][3], atol=6)


def test_the_mean_over_seeds_rises_with_the_number_of_particles_and_the_scatter_falls():
    shares = np.array(list(luck().values()))  # numbers, seeds, car and person
    assert shares.shape == (3, 24, 2)
    assert (np.diff(shares.mean(axis=1), axis=0) > 5).all()
    assert (np.diff(shares.std(axis=1), axis=0) < 0).all()


def test_the_line_holds_what_its_particles_carry():
    line, _, state = on_a_line(np.array([1.2, 1.8]), np.array([10, 0]), np.array([0.2, 0.3]), fence=4)
    assert line.shape == (6, 1)
    np.testing.assert_allclose(state.probability[State.DYNAMIC, ::-1, 0], [0, 0.5, 0, 0, 0, 0])
    np.testing.assert_allclose(state.probability.sum(axis=0), 1)


def test_a_coming_car_becomes_dynamic():
    times, means = mean_dynamic(street, thing=2, seconds=1.5)
    assert times[-1] == 1.4
    assert means[0] < 0.1 < 0.6 < means[-1]
