"""CMCDOT tends to the BOF, at the rate of the central limit theorem."""

import numpy as np
from worlds.lecture_02_boxes import cells_in
from worlds.lecture_04_convergence import (
    SPEC,
    evidence_of_boxes,
    measure_convergence,
    passing_cars,
    run_bof,
    run_cmcdot,
)


def test_errors_fall_like_one_over_the_root_of_the_number_of_particles():
    found = measure_convergence([4_000, 16_000, 64_000], seeds=range(20))
    assert found.dynamic[-1] < 0.02
    assert found.velocity[-1] < 0.1
    assert all(-0.65 < slope < -0.35 for slope in found.slopes)


def test_the_exact_filter_finds_both_cars():
    *_, (dynamic, velocity) = run_bof()
    for car, expected in zip(passing_cars(6), (8, -8), strict=True):
        inside = cells_in(car, SPEC)
        assert (dynamic[inside] > 0.9).all()
        assert np.abs(velocity[:, inside] - np.array([[expected], [0]])).max() < 0.5


def test_the_same_seed_gives_the_same_bits():
    for first, again in zip(run_cmcdot(1000, 3), run_cmcdot(1000, 3), strict=True):
        assert np.array_equal(first[0], again[0])
        assert np.array_equal(first[1], again[1], equal_nan=True)


def test_evidence_is_of_the_cars_alone():
    evidence = evidence_of_boxes(passing_cars(2))
    hit = evidence.occupied > evidence.free
    assert np.array_equal(hit, cells_in(passing_cars(2)[0], SPEC) | cells_in(passing_cars(2)[1], SPEC))
    assert hit.sum() == 2 * 4 * 2
