"""Carrying a map: what each scheme does to it, against what can be worked out by hand."""

import numpy as np
import pytest
from worlds.lecture_04_blur import SCHEMES, measure_blur, winding_road

from semgrid_edu.occupancy import PlanarMotion

FEW = {"drops": 8}


def test_a_scrolling_map_that_doesnt_turn_keeps_everything():
    """Whatever fractions of a cell the vehicle drives."""
    motions = [PlanarMotion(0.137, -0.031)] * 50
    blur = measure_blur("scrolling", motions, **FEW)
    assert (blur.entropy == 0).all()
    assert (blur.left == 0).all()
    assert blur.displacement.max() < 1e-6


@pytest.mark.parametrize("scheme", SCHEMES)
def test_whole_cells_are_exact_by_any_scheme(scheme):
    blur = measure_blur(scheme, [PlanarMotion(0.4, -0.2)] * 10, **FEW)
    assert blur.entropy.max() < 1e-4
    assert blur.left.max() < 1e-4
    assert blur.displacement.max() < 1e-2


def test_bilinear_spreads_as_coins_thrown():
    """Half a cell a step moves each drop by half a cell to either side: a random walk, 0.1 m sqrt(T)."""
    blur = measure_blur("bilinear", [PlanarMotion(0.1)] * 16, **FEW)
    np.testing.assert_allclose(blur.displacement, 0.1 * np.sqrt(np.arange(1, 17)), rtol=1e-3)
    assert blur.entropy[-1] > 0.5


def test_the_nearest_cell_runs_away_from_small_motions():
    """A vehicle that drives 0.4 cells a step never leaves its cell, as the nearest cell sees it."""
    blur = measure_blur("nearest", [PlanarMotion(0.08)] * 20, **FEW)
    np.testing.assert_allclose(blur.displacement, 0.08 * np.arange(1, 21), rtol=1e-4)
    assert (blur.entropy == 0).all()


def test_in_turns_scrolling_displaces_least():
    motions = winding_road(25)
    last = {scheme: measure_blur(scheme, motions, **FEW).displacement[-1] for scheme in SCHEMES}
    assert last["scrolling"] < 0.5 * min(last["bilinear"], last["nearest"])
