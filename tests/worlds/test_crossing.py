"""The streets of lecture 04: what is measured there, and the table of 24 seeds."""

from unittest.mock import patch

import numpy as np
from worlds.lecture_04_crossing import (
    CAR,
    DRIVES_AWAY,
    ONE_CHANGE,
    WIDE,
    arrivals,
    borders,
    drives_away,
    dynamic_shares,
    luck,
    luck_of_one_change,
    mean_dynamic,
    measure_arrivals,
    measure_drives_away,
    measure_luck,
    street,
)

from semgrid_edu.datasets.samples import real_drive
from semgrid_edu.fast import SensorModel, track_drive
from semgrid_edu.occupancy import CmcdotParams


def test_the_table_of_seeds_is_what_a_run_measures():
    np.testing.assert_allclose(measure_luck(300, range(6)).mean(axis=0), luck()[300][:6].mean(axis=0), atol=12)
    for name, (scene, thing) in ONE_CHANGE.items():
        measured = measure_luck(3000, range(2), scene)[:, thing - CAR]
        np.testing.assert_allclose(measured.mean(), luck_of_one_change()[name][:2].mean(), atol=12, err_msg=name)


def test_a_coming_car_becomes_dynamic():
    times, means = mean_dynamic(street, thing=2, seconds=1.5)
    assert times[-1] == 1.4
    assert means[0] < 0.1 < 0.6 < means[-1]


def test_the_tables_of_causes_are_what_a_run_measures():
    for name, shares in measure_arrivals(seeds=[2]).items():
        np.testing.assert_allclose(shares[0], arrivals()[name][2], atol=6, err_msg=name)
    frames = [real_drive()[k] for k in range(10)]
    for name, shares in measure_drives_away(frames, seeds=[1]).items():
        np.testing.assert_allclose(shares[0], drives_away()[name], atol=14, err_msg=name)  # two of 15 cells
    assert borders().keys() == DRIVES_AWAY.keys()


def test_that_wakes_are_freed_has_no_part_in_the_car_that_drives_away():
    frames = [real_drive()[k] for k in range(10)]
    with patch("semgrid_edu.fast.occupancy.steps.clear_wakes", lambda posterior, left, hidden: posterior):
        run = list(track_drive(frames, WIDE, CmcdotParams(sensor=SensorModel())))
    assert dynamic_shares(WIDE, frames, run, "the car F")[-1] < 10
