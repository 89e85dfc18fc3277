"""Pairs of drives in which one car lies on its top or stands on its wheels."""

import numpy as np
import pytest
from worlds.lecture_12_overturned import FIRST_SEED, ON_ITS_TOP, ON_ITS_WHEELS, called_car, count, drive_pair, the_car

from semgrid_edu.datasets.samples import sample_weights
from semgrid_edu.fast import load_net
from semgrid_edu.labels import KITTI_14

LAST = 0.9
"""Seconds to the last frame."""


@pytest.fixture(scope="module")
def drives():
    return drive_pair(FIRST_SEED)


def test_the_drives_differ_in_nothing_but_how_one_car_lies(drives):
    lying, standing = (drives[name].objects(LAST) for name in (ON_ITS_TOP, ON_ITS_WHEELS))
    car = the_car(drives)
    assert [one for one in lying if one.get("overturned")] == [car]
    assert not any(one.get("overturned") for one in standing)
    assert [{**one, "overturned": None} for one in lying] == [{**one, "overturned": None} for one in standing]
    truths = [drives[name].birdseye(LAST) for name in (ON_ITS_TOP, ON_ITS_WHEELS)]
    np.testing.assert_array_equal(*[instances for _, instances in truths])


def test_cells_of_that_car_alone_are_counted(drives):
    net = load_net(sample_weights(), drives[ON_ITS_TOP].rig.camera)
    car = the_car(drives)
    matrix = count(drives[ON_ITS_TOP], car, net)
    length, width, _ = car["size"]
    cell = net.architecture.grid.cell
    assert 0 < matrix.sum() <= (length + 2 * cell) * (width + 2 * cell) / cell**2 * 1.5  # turned, it covers more
    assert matrix.sum() == matrix[KITTI_14.index("car")].sum()


def test_a_share_by_hand():
    matrix = np.zeros((14, 14), int)
    car = KITTI_14.index("car")
    matrix[car, car], matrix[car, 0], matrix[0, car] = 3, 1, 7
    assert called_car(matrix) == 0.75
