"""The pictures of the lattice: where vertices lie, and what the story of the filter shows."""

import matplotlib.pyplot as plt
import numpy as np
from worlds.lecture_11_lattice import draw_lattice_frame, draw_triangles, lattice_story, vertex_places

from semgrid_edu.crf import PermutohedralLattice, enclosing_simplices
from semgrid_edu.crf.lattice import elevated, elevation


def street():
    rng = np.random.default_rng(0)
    return rng.uniform(0, 3, (12, 2)), rng.random(12)


def test_vertices_lie_where_their_points_are():
    features, _ = street()
    for place, corners, weights in zip(features, *enclosing_simplices(elevated(features)), strict=True):
        np.testing.assert_allclose(weights @ vertex_places(corners), place)


def test_the_story_begins_with_the_points_and_ends_with_their_weighted_means():
    features, values = street()
    first, *_, last = lattice_story(features, values, between=2)
    np.testing.assert_array_equal(first.values, values)
    sums, weights = PermutohedralLattice.build(features)(np.column_stack([values, np.ones(12)])).T
    np.testing.assert_allclose(last.values, sums / weights)
    np.testing.assert_array_equal(last.places, features)


def test_all_that_the_points_have_is_on_its_way_and_then_on_the_vertices():
    features, values = street()
    frames = list(lattice_story(features, values, between=1))
    for frame in frames[:3]:  # the points, half-way to the corners, on the vertices
        np.testing.assert_allclose(frame.weights.sum(), 12)
        np.testing.assert_allclose(frame.weights @ frame.values, values.sum())


def test_between_adds_pictures_but_no_steps():
    features, values = street()
    few, many = (list(lattice_story(features, values, between)) for between in (0, 2))
    assert list(dict.fromkeys(f.title for f in few)) == list(dict.fromkeys(f.title for f in many))
    assert len(many) == len(few) + 5 * 2


def test_triangles_have_a_vertex_at_each_end():
    ax = draw_triangles((-1, -1), (2, 2), plt.figure().add_subplot())
    ends = np.concatenate(ax.collections[0].get_segments())
    lifted = ends @ elevation(2).T
    np.testing.assert_allclose(lifted, np.rint(lifted), atol=1e-9)
    for corner in np.rint(lifted).astype(int):
        assert len(set((corner % 3).tolist())) == 1
    frame = next(lattice_story(*street()))
    assert draw_lattice_frame(frame, ax) is ax
