"""Intervals with known answers, and how often intervals hold the truth of a simulated population."""

import numpy as np
import pytest
from interval_coverage import RATIOS, coverage, population
from scipy import stats

from semgrid_edu.errors import ArgumentError
from semgrid_edu.metrics import METRICS, class_accuracy, pixel_accuracy
from semgrid_edu.workshop.scoring.score_with_interval import compared, score_with_interval
from semgrid_edu.workshop.scoring.statistics import drive_estimate, drive_interval, paired_estimate, paired_interval


def matrices(right):
    """Drives of 100 cells of one class, of which so many are called right: pixel accuracy is a plain mean then."""
    right = np.asarray(right, dtype=float)
    return np.moveaxis(np.array([[right, 100 - right], [0 * right, 0 * right]]), (0, 1), (-2, -1))


def second_iou(matrix):
    """Intersection over union of one class, a ratio that is quick to compute."""
    return matrix[1, 1] / (matrix[1].sum() + matrix[:, 1].sum() - matrix[1, 1])


@pytest.mark.parametrize("ratio", ["drives differ, seeds don't", "seeds alone"])
def test_intervals_cover_the_truth(ratio):
    """At both ends; between them stand the paired ones."""
    assert 0.92 <= coverage(drive_interval, second_iou, population(0, *RATIOS[ratio])) <= 0.975


def test_paired_intervals_cover_the_truth():
    a, b = (population(method, *RATIOS["seeds more"]) for method in (0, 1))
    assert 0.92 <= coverage(paired_interval, pixel_accuracy, a, b) <= 0.975


def test_one_seed_gives_the_t_interval_of_the_drives():
    """The share that is right is the plain mean over drives of equal size, so that Student's interval is exact."""
    right = np.array([80.0, 84.0, 78.0, 82.0, 91.0])
    found = drive_interval(matrices([right]), pixel_accuracy, level=0.9)
    low, high = stats.t.interval(0.9, 4, right.mean(), stats.sem(right))
    np.testing.assert_allclose(found, np.array([low, right.mean(), high]) / 100)


def test_drives_that_are_alike_give_the_t_interval_of_the_seeds():
    seeds = np.array([80.0, 84.0, 79.0])
    found = drive_interval(matrices(np.repeat(seeds[:, None], 6, axis=1)), pixel_accuracy)
    low, high = stats.t.interval(0.95, 2, seeds.mean(), stats.sem(seeds))
    np.testing.assert_allclose(found, np.array([low, seeds.mean(), high]) / 100)


def test_seeds_that_agree_change_nothing():
    drives = matrices([[80.0, 84.0, 78.0]])
    np.testing.assert_allclose(
        drive_interval(np.repeat(drives, 5, axis=0), pixel_accuracy), drive_interval(drives, pixel_accuracy)
    )


def test_seeds_and_drives_add_as_analysis_of_variance_says():
    """Two seeds on three drives, by hand: means of seeds 80 and 84, of drives 78, 82, 86, and nothing in common."""
    right = np.array([[76.0, 80.0, 84.0], [80.0, 84.0, 88.0]])
    of_seeds, of_drives = 8 / 2, 16 / 3  # variances of two and of three means, by their numbers
    t = stats.t.ppf(0.975, [1, 2])
    half = (t[0] * of_seeds + t[1] * of_drives) / np.sqrt(of_seeds + of_drives)
    found = drive_interval(matrices(right), pixel_accuracy)
    np.testing.assert_allclose(found, np.array([82 - half, 82, 82 + half]) / 100)


def test_pairs_share_the_hardness_of_their_drives():
    """Drives differ by tens of points, the methods on each by about one: only the paired interval knows."""
    rng = np.random.default_rng(0)
    hardness = rng.uniform(30, 80, 12)
    a, b = (matrices(hardness + better + rng.normal(size=(3, 12))) for better in (3, 0))
    low, gain, high = paired_interval(a, b, pixel_accuracy)
    widths = [of.high - of.low for of in (drive_interval(a, pixel_accuracy), drive_interval(b, pixel_accuracy))]
    assert 0 < low < 0.03 < high
    assert high - low < min(widths) / 5
    assert gain == pytest.approx(drive_interval(a, pixel_accuracy).mean - drive_interval(b, pixel_accuracy).mean)
    np.testing.assert_allclose(paired_interval(b, a, pixel_accuracy), [-high, -gain, -low])


def test_a_method_without_seeds_stands_against_every_seed():
    rng = np.random.default_rng(0)
    net, baseline = matrices(rng.uniform(60, 90, (3, 8))), matrices(rng.uniform(30, 60, (1, 8)))
    found = paired_interval(net, baseline, pixel_accuracy)
    np.testing.assert_allclose(found, paired_interval(net, np.repeat(baseline, 3, axis=0), pixel_accuracy))
    assert paired_interval(net, net, pixel_accuracy) == (0.0, 0.0, 0.0)
    assert compared(net, baseline, pixel_accuracy)["seeds"] == pytest.approx(
        net[..., 0, 0].mean(axis=1) / 100 - baseline[..., 0, 0].mean() / 100
    )


def test_large_drives_count_for_more():
    """Pooled: 10 of 100 and 900 of 1000 right are 910 of 1100, and not the mean of the two shares."""
    drives = [[[[10, 90], [0, 0]], [[900, 100], [0, 0]]]]
    assert drive_interval(drives, pixel_accuracy).mean == pytest.approx(910 / 1100)


def test_what_gives_no_interval_is_refused():
    fine = matrices([[80.0, 84.0, 78.0]])
    for confusions, complaint in (
        (fine[0], r"\(S, V, C, C\)"),
        (fine[:, :1], "two drives or more"),
        (fine[:0], r"\(S, V, C, C\)"),
    ):
        with pytest.raises(ArgumentError, match=complaint):
            drive_interval(confusions, pixel_accuracy)
    for level in (0, 1, 95):
        with pytest.raises(ArgumentError, match="level"):
            drive_interval(fine, pixel_accuracy, level)
    one_labelled = fine * np.array([1, 0, 0])[:, None, None]
    with pytest.raises(ArgumentError, match="all but one"):
        drive_interval(one_labelled, class_accuracy)
    for b in (fine[:, :2], matrices([[1.0, 2.0, 3.0]] * 3)[:2]):
        with pytest.raises(ArgumentError, match="seeds and drives of a"):
            paired_interval(np.repeat(fine, 3, axis=0), b, pixel_accuracy)


def test_what_was_measured_is_the_interval_and_every_seed():
    confusions = matrices(np.random.default_rng(0).uniform(60, 90, (3, 10)))
    for metric in METRICS.values():
        value, interval = score_with_interval(confusions, metric), drive_interval(confusions, metric)
        assert (value["low"], value["mean"], value["high"]) == interval
        assert value["seeds"] == [metric(matrix) for matrix in confusions.sum(axis=1)]
        assert np.mean(value["seeds"]) == pytest.approx(value["mean"])


@pytest.mark.parametrize("level", [0.5, 0.95, 0.99])
def test_p_values_and_intervals_never_disagree(level):
    """At the end of an interval of level 1 - 2 p the p-value is p, with seeds and drives that both vary."""
    rng = np.random.default_rng(0)
    a, b = (matrices(rng.uniform(60, 80, 12) + rng.normal(size=(3, 12))) for _ in range(2))
    low, _, high = paired_interval(a, b, pixel_accuracy, level)
    estimate = paired_estimate(a, b, pixel_accuracy)
    assert estimate.p_value(high, above=True) == pytest.approx((1 - level) / 2)
    assert estimate.p_value(low, above=False) == pytest.approx((1 - level) / 2)
    assert estimate.p_value(low, above=True) == pytest.approx((1 + level) / 2)


def test_numbers_that_never_vary_are_certain():
    estimate = drive_estimate(matrices(np.full((2, 5), 80.0)), pixel_accuracy)
    assert estimate.p_value(0.9, above=True) == 0
    assert estimate.p_value(0.7, above=True) == 1
