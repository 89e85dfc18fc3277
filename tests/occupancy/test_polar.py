"""The beams of many points at once, held to the beam of each."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgrid_edu.fast.occupancy.ground import ROUGH, beam_of, beams_of, rough_azimuth
from semgrid_edu.occupancy import polar

BEAMS = st.sampled_from([1, 2, 7, 360, 1200, 36_000, 400_000])


def both_ways(points: np.ndarray, beams: int) -> tuple[list[int], list[int]]:
    return beams_of(*points.T, beams).tolist(), [beam_of(x, y, beams) for x, y in points]


@settings(deadline=None)
@given(st.integers(0, 1000), BEAMS, st.floats(-2 * ROUGH, 2 * ROUGH), st.sampled_from([np.float32, np.float64]))
def test_the_same_near_the_borders_of_beams(seed, beams, off, dtype):
    rng = np.random.default_rng(seed)
    azimuth = rng.integers(0, beams, 100) * (2 * np.pi / beams) + off - np.pi
    distance = rng.uniform(1, 80, 100)
    points = np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth)], axis=1).astype(dtype)
    at_once, one_by_one = both_ways(points, beams)
    assert at_once == one_by_one


@pytest.mark.parametrize("of", [beams_of, polar.beams_of], ids=["fast", "book"])
def test_columns_on_the_borders_of_beams_fall_where_double_precision_puts_them(of):
    """Arctangents in single precision differ by kind of processor, and would move many of these columns."""
    azimuth = np.arange(1200) * (2 * np.pi / 1200) - np.pi + 1e-12
    points = np.float32(np.stack([17 * np.cos(azimuth), 17 * np.sin(azimuth)], axis=1))
    exact = [(math.atan2(float(y), float(x)) + math.pi) * 1200 / (2 * math.pi) for x, y in points]
    near = np.abs(np.array(exact) - np.round(exact)) < 1e-9  # the axes and diagonals, exact in single precision, too
    assert near.sum() <= 8
    np.testing.assert_array_equal(of(*points.T, 1200)[~near], np.int64(exact)[~near])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_same_on_the_axes_and_at_the_origin(dtype):
    values = dtype([-3e30, -1, -0.0, 0, np.finfo(dtype).smallest_subnormal, 1, 3e30])
    points = np.stack(np.meshgrid(values, values), axis=-1).reshape(-1, 2)
    at_once, one_by_one = both_ways(points, 1200)
    assert at_once == one_by_one


def test_beams_begin_behind_the_vehicle_and_go_counter_clockwise():
    right_behind, right, ahead, left = [-1, -0.01], [0.0, -1], [1, 0.0], [0.0, 1]
    for of in (beams_of, polar.beams_of):
        assert of(*np.transpose([right_behind, right, ahead, left]), 4).tolist() == [0, 1, 2, 3]


def test_rough_azimuths_err_by_less_than_half_of_what_they_may():
    azimuth = np.linspace(-np.pi, np.pi, 4001)[1:]
    rough = [rough_azimuth(np.cos(a), np.sin(a)) for a in azimuth]
    np.testing.assert_allclose(rough, azimuth, rtol=0, atol=ROUGH / 2)
