"""Maps of lecture 13: images of another height, forbidden answers, and what the fusion network sees."""

import numpy as np
import pytest
from worlds.lecture_13_map import (
    brighter,
    fusion_inputs,
    ground_begins,
    occupancy_grids,
    semantic_grids,
    with_rows,
    without_unknown,
)

from semgrid_edu.datasets.samples import real_drive, sample_drive, sample_weights
from semgrid_edu.fast import build_net, load_net
from semgrid_edu.networks import Architecture
from semgrid_edu.pipeline import run_pipeline


@pytest.fixture(scope="module")
def net():
    return load_net(sample_weights(), real_drive().camera).requires_grad_(False)


@pytest.mark.parametrize("with_heights", [False, True])
def test_maps_are_those_of_the_pipeline(net, with_heights):
    if with_heights:
        net = build_net(Architecture(uses_return_heights=True), real_drive().camera).requires_grad_(False).eval()
    frames, spec = real_drive()[:2], net.architecture.grid
    beliefs = occupancy_grids(frames, spec)
    grids = semantic_grids(net.fusion, fusion_inputs(net, frames, beliefs))
    for grid, result in zip(grids, run_pipeline(frames, net), strict=True):
        np.testing.assert_allclose(grid, result.grid, atol=1e-5)


def test_rows_below_bring_nearer_ground_into_view_and_rows_cut_off_lose_it(net):
    frame, spec = sample_drive()[0], net.architecture.grid
    begins = [ground_begins(with_rows(frame, rows).camera, spec) for rows in (-40, 0, 20)]
    assert begins == sorted(begins, reverse=True)
    taller = with_rows(frame, 3).image
    assert taller.shape[0] == frame.image.shape[0] + 3
    np.testing.assert_array_equal(taller[-3:], np.repeat(frame.image[-1:], 3, axis=0))
    np.testing.assert_array_equal(with_rows(frame, -3).image, frame.image[:-3])


def test_rows_above_move_no_ground(net):
    frame, spec = sample_drive()[0], net.architecture.grid
    for rows in (-40, 40):
        other = with_rows(frame, rows, above=True)
        assert ground_begins(other.camera, spec) == ground_begins(frame.camera, spec)
        np.testing.assert_array_equal(other.image[-100:], frame.image[-100:])
        assert other.camera.size == other.image.shape[:2] == (frame.image.shape[0] + rows, frame.image.shape[1])


def test_a_brighter_image_does_not_wrap_around():
    frame = sample_drive()[0]
    assert (brighter(frame, 200).image.astype(int) >= frame.image).all()


def test_probabilities_without_unknown_keep_their_ratios():
    grids = np.random.default_rng(0).dirichlet(np.ones(14), (2, 3, 4)).transpose(0, 3, 1, 2)
    named = without_unknown(grids)
    np.testing.assert_allclose(named.sum(axis=1), 1)
    np.testing.assert_allclose(named[:, 3] * grids[:, 5], named[:, 5] * grids[:, 3])
