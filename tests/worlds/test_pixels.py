"""Pixels along a ray: occlusion by hand, what cell by cell makes of it, and heights."""

from itertools import product

import numpy as np
from worlds.lecture_05_pixel_ray import RayWorld, cell_by_cell, exact_ray


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


def test_without_occlusion_there_is_one_cell_and_both_agree():
    for label in (0, 1):
        world = RayWorld(1, prior=0.3, right=0.8)
        np.testing.assert_allclose(exact_ray([label], world), cell_by_cell([label], world), atol=1e-12)
