"""Pixels along a ray: occlusion by hand, what cell by cell makes of it, and heights."""

from itertools import pairwise, product

import numpy as np
from worlds.lecture_05_pixel_ray import RayWorld, cell_by_cell, exact_ray, pixel_ray
from worlds.lecture_07_post import believed_of_post, post_pixels

from semgrid_edu.graphical import d_separated


def test_the_posterior_is_the_sum_over_all_streets():
    labels, world = (0, 1, 1), RayWorld(3, prior=0.3, right=0.9)
    weight = {}
    for street in product((0, 1), repeat=3):
        weight[street] = np.prod([0.3 if car else 0.7 for car in street])
        for j, label in enumerate(labels):
            weight[street] *= 0.9 if label == max(street[: j + 1]) else 0.1
    total = sum(weight.values())
    by_hand = [sum(w for street, w in weight.items() if street[k]) / total for k in range(3)]
    np.testing.assert_allclose(exact_ray(labels, world), by_hand, atol=1e-12)


def test_perfect_pixels_tell_nothing_about_what_is_behind_the_first_car():
    world = RayWorld(4, prior=0.2, right=1.0)
    np.testing.assert_allclose(exact_ray([0, 1, 1, 1], world), [0, 1, 0.2, 0.2], atol=1e-12)
    np.testing.assert_allclose(cell_by_cell([0, 1, 1, 1], world), [0, 1, 1, 1])


def test_without_occlusion_there_is_one_cell_and_both_agree():
    for label in (0, 1):
        world = RayWorld(1, prior=0.3, right=0.8)
        np.testing.assert_allclose(exact_ray([label], world), cell_by_cell([label], world), atol=1e-12)


def test_a_pixel_makes_the_cells_on_its_ray_depend_on_each_other():
    model = pixel_ray().model
    assert d_separated(model, "m1", "m3")
    assert not d_separated(model, "m1", "m3", given=("a3",))
    assert d_separated(model, "m4", "a3")


def test_a_post_is_the_sum_over_all_its_labels():
    says, right = (1, 1, 0, 1), 1 / (1 + np.exp(-2))
    weight = {}
    for labels in product((0, 1), repeat=4):
        told = np.prod([right if one == label else 1 - right for one, label in zip(says, labels, strict=True)])
        weight[labels] = told * np.prod([0.7 if a == b else 0.3 for a, b in pairwise(labels)])
    total = sum(weight.values())
    by_hand = [sum(w for labels, w in weight.items() if labels[k]) / total for k in range(4)]
    np.testing.assert_allclose(believed_of_post(says, stays=0.7, lead=2.0)[0], by_hand, atol=1e-12)


def test_a_soft_max_per_pixel_is_exact_where_neighbours_say_nothing_of_each_other():
    exact, alone = believed_of_post([1, 0, 0, 1, 0], stays=0.5)
    np.testing.assert_allclose(exact, alone, atol=1e-12)


def test_the_edge_that_fills_a_gap_wipes_out_what_is_thin():
    along, across = believed_of_post([1, 1, 0, 1, 1])[:, 2], believed_of_post([0, 0, 1, 0, 0])[:, 2]
    assert along[1] < 0.5 < along[0]
    np.testing.assert_allclose(along + across, 1, atol=1e-12)


def test_labels_along_a_post_depend_on_each_other_until_one_between_them_is_known():
    model = post_pixels().model
    assert not d_separated(model, "x1", "x5", given=("s1", "s2", "s3", "s4", "s5"))
    assert d_separated(model, "x1", "x5", given=("x3",))
