"""Moving things from the boxes of the sample drive: where they are, and how fast they move."""

import numpy as np
import pytest
from worlds.lecture_09_boxes import beliefs_of_boxes

from semgrid_edu import fast
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import State


@pytest.fixture(scope="module")
def beliefs():
    drive, spec = sample_drive(), GridSpec.compact()
    tracked = list(fast.track_drive([drive[k] for k in range(2)], spec))
    return beliefs_of_boxes(drive, [tracked[k % 2] for k in range(len(drive))], spec)


def test_a_car_that_overtakes_moves_with_its_velocity_and_a_parked_one_rests(beliefs):
    rows, cols, _ = GridSpec.compact().cells(np.array([[4.158, 3.402, 0.0], [17.261, 9.661, 0.0]]))
    assert beliefs[10].probability[State.DYNAMIC, rows, cols].tolist() == [1, 0]
    np.testing.assert_allclose(beliefs[10].velocity[:, rows, cols], [[13.998, 0], [-0.028, 0]], rtol=1e-4)


def test_a_box_covers_about_its_own_area(beliefs):
    probability, velocity = beliefs[10].probability, beliefs[10].velocity
    np.testing.assert_array_equal(probability.sum(axis=0), 1)
    overtaking = np.isclose(velocity[0], 13.998, rtol=1e-4).sum() * GridSpec.compact().cell ** 2
    assert 4.7 * 1.8 < overtaking < 5.7 * 2.8
