"""The grid: axes, borders and the round trip between cells and metres."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec

SPEC = GridSpec(x_min=0, x_max=3, y_min=-1, y_max=1, cell=1)


def test_forward_is_up_and_left_is_left():
    rows, cols, inside = SPEC.cells(np.array([[2.9, 0.9], [0.1, -0.9]]))
    assert inside.all()
    assert (rows.tolist(), cols.tolist()) == ([0, 2], [0, 1])


def test_the_papers_grid_is_31_by_71_metres_in_355_by_155_cells():
    spec = GridSpec.paper()
    assert spec.shape == (355, 155)
    assert (spec.x_max - spec.x_min, spec.y_max - spec.y_min, spec.cell) == (71, 31, 0.2)


def test_distances_by_hand():
    expected = [[6.5, 6.5], [2.5, 2.5], [0.5, 0.5]]
    np.testing.assert_allclose(SPEC.distances() ** 2, expected)


@pytest.mark.parametrize("spec", [SPEC, GridSpec.paper(), GridSpec.compact()])
def test_the_centre_of_each_cell_falls_into_that_cell(spec):
    height, width = spec.shape
    rows, cols, inside = spec.cells(spec.centers().reshape(-1, 2))
    assert inside.all()
    np.testing.assert_array_equal(rows.reshape(height, width), np.indices((height, width))[0])
    np.testing.assert_array_equal(cols.reshape(height, width), np.indices((height, width))[1])


@given(st.floats(-0.499, 0.499), st.floats(-0.499, 0.499), st.integers(0, 354), st.integers(0, 154))
def test_every_point_of_a_cell_falls_into_it(dx, dy, row, col):
    spec = GridSpec.paper()
    point = spec.centers()[row, col] + spec.cell * np.array([dx, dy])
    assert [part[0] for part in spec.cells(point[None])] == [row, col, True]


def test_points_outside_and_nan_are_not_inside():
    _, _, inside = SPEC.cells(np.array([[3.01, 0], [-0.01, 0], [1, 1.01], [1, -1.01], [np.nan, 0], [np.inf, 0]]))
    assert not inside.any()


@pytest.mark.parametrize(
    ("borders", "named"),
    [
        ((0, 3, -1, 1, 0.0), "cell"),
        ((0, 3, -1, 1, np.nan), "cell"),
        ((3, 0, -1, 1, 1.0), "x_min"),
        ((0, 3, -1, np.inf, 1.0), "y_min"),
        ((0, 3, -1, 1, 0.7), "x_max"),
    ],
)
def test_impossible_grids_are_refused_by_name(borders, named):
    with pytest.raises(ArgumentError, match=named):
        GridSpec(*borders)


def test_a_table_of_the_wrong_shape_is_refused():
    with pytest.raises(ArgumentError, match=r"xy: expected points of shape \(N, 2\), found shape \(3,\)"):
        SPEC.cells(np.zeros(3))
