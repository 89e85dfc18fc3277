"""Hidden tests of exercise 09, where truth comes from: loops and sums over all outcomes are the reference."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from semgrid_edu.camera import project, transform_points
from semgrid_edu.datasets.ground_truth import TruthPolicy, lidar_truth
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.workshop.course.answers import answer_array, answer_number
from semgrid_instructor import close, generator, hidden


def _open(uv: NDArray, Z: NDArray, reach: int, gap: float) -> NDArray:
    """Return which returns aren't hidden, by an image of the smallest depths; an answer may call this with anything."""
    uv, Z = np.asarray(uv).reshape(-1, 2).astype(int), np.asarray(Z, float).ravel()
    assert (uv >= 0).all(), "a rule takes pixels of an image"
    assert (uv < 2000).all(), "a rule takes pixels of an image"
    assert 0 <= reach < 100, "a rule takes a reach in pixels"
    nearest = np.full(uv.max(axis=0, initial=0) + 1, np.inf)
    np.minimum.at(nearest, tuple(uv.T), Z)
    return Z - minimum_filter(nearest, 2 * int(reach) + 1)[tuple(uv.T)] <= gap


@hidden
def check_open_to_view(open_to_view: Callable) -> None:
    """Crowded images, other reaches and gaps, a single return, and none."""
    for seed, (n, reach, gap) in enumerate(((400, 3, 0.5), (300, 0, 0.0), (500, 6, 4.0), (1, 2, 0.5), (0, 1, 1.0))):
        rng = generator(90 + seed)
        uv, Z = rng.integers(0, (90, 30), (n, 2)), rng.uniform(2, 40, n)
        got = answer_array(open_to_view(uv.copy(), Z.copy(), reach, gap), dtype=bool)
        assert got.shape == (n,), "another shape"
        wrong = (got != _open(uv, Z, reach, gap)).sum()
        assert not wrong, "some returns are wrong, with another reach and another gap"


@hidden
def check_wrong_shares(wrong_shares: Callable) -> None:
    """Sum over all outcomes of every return: one to seven returns, other errors, none of either."""
    drawn = [(n, *rng.uniform(0.05, 0.4, 2), 0.7) for n, rng in ((1, generator(93)), (5, generator(94)))]
    cases = ((3, 0.05, 0.3, 0.5), (5, 0.3, 0.0, 0.1), (7, 0.0, 0.2, 0.6), *drawn)
    for n, outline, calibration, p_car in cases:
        wanted = np.zeros(2)
        for car, off, *swapped in product((False, True), repeat=2 + n):
            chance = np.prod([outline if one else 1 - outline for one in swapped])
            chance *= (p_car if car else 1 - p_car) * (calibration if off else 1 - calibration)
            brings_car = [car ^ off ^ one for one in swapped]
            wanted += chance * np.array([(sum(brings_car) > n / 2) != car, any(brings_car) != car])
        got = answer_array(wrong_shares(n, outline, calibration, p_car))
        assert got.shape == (2,), "another shape"
        for name, a, b in zip(("a majority", "what stands wins"), got, wanted, strict=True):
            assert close(a, b), name + ": another probability of being wrong"


@hidden
def check_audit(audit: Callable) -> None:
    """Random maps, larger reaches, things at every edge; a map that breaks nothing."""
    for seed, (shape, reach) in enumerate((((9, 13), 2), ((12, 5), 1), ((6, 7), 0), ((8, 8), 3))):
        rng = generator(95 + seed)
        votes = np.where(rng.random(shape) < 0.25, rng.integers(0, 10, shape), 255)
        unseen = rng.random(shape) < 0.3
        made = np.where((votes == 255) | (rng.random(shape) < 0.2), rng.integers(0, 14, shape), votes)
        wanted, across = [0, 0, 0], 0
        for r, c in np.ndindex(shape):
            if votes[r, c] != 255:
                wanted[0] += made[r, c] != votes[r, c]
            elif made[r, c] < 10:
                around = votes[max(r - reach, 0) : r + reach + 1, max(c - reach, 0) : c + reach + 1]
                wanted[1] += unseen[r, c]
                wanted[2] += made[r, c] not in around
                round_r, round_c = (np.arange(k - reach, k + reach + 1) for k in (r, c))
                across += made[r, c] not in votes.take(round_r, 0, mode="wrap").take(round_c, 1, mode="wrap")
        got = answer_array(audit(votes.copy(), unseen.copy(), made.copy(), reach))
        assert got.shape == (3,), "another shape"
        wraps = "rule 3: a vote at one edge of the map vouches for cells at the other (np.roll wraps round)"
        assert got[2] == wanted[2] or got[2] != across, wraps
        for rule, (a, b) in enumerate(zip(got, wanted, strict=True)):
            assert a == b, ("rule 1", "rule 2", "rule 3")[rule] + " is broken by another number of cells"
    kept = np.where(votes == 255, 13, votes)
    assert not np.any(answer_array(audit(votes.copy(), unseen.copy(), kept, 1))), "a map of votes alone breaks nothing"


@hidden
def check_labels_and_wrong(labels_and_wrong: Callable) -> None:
    """Other frames of the sample drive, other reaches and gaps, and a rule that must be asked."""
    drive, spec = sample_drive(), GridSpec.compact()
    for k, reach, gap in zip(generator(109).permutation(len(drive))[:2].tolist(), (5, 2), (0.5, 2.0), strict=True):
        frame = drive[k]
        o = np.moveaxis(np.tile([0.1, 0.2, 0.1, 0.6], (*spec.shape, 1)), -1, 0)
        in_camera = transform_points(frame.camera.T_camera_from_lidar, frame.points[:, :3])
        pixels, visible = project(in_camera, frame.camera)
        kept = np.flatnonzero(visible)[_open(np.rint(pixels[visible]).astype(int), in_camera[visible, 2], reach, gap)]
        made = lidar_truth(replace(frame, points=frame.points[kept]), o, spec, TruthPolicy(cleanup="none"))
        wrong = ((made < 10) & (made != frame.labels.birdseye_on(spec))).sum()
        got = answer_array(labels_and_wrong(frame, o, spec, reach, gap, _open))
        assert got.shape == (2,), "another shape"
        assert got[0] == (made < 10).sum(), "another number of labels"
        assert got[1] == wrong, "another number of wrong labels"


@hidden
def check_prices(prices: Callable) -> None:
    """Other counts: some reaches remove nothing, lose no right label, or add wrong ones."""
    for seed in range(4):
        rng = generator(112 + seed)
        labels, wrong = int(rng.integers(800, 2000)), int(rng.integers(100, 400))
        kept = np.column_stack([rng.integers(50, labels - wrong, 5), rng.integers(5, wrong, 5)])  # right and wrong ones
        kept = np.concatenate(
            [kept, [[labels - wrong, wrong // 2], [labels - wrong - 9, wrong], [labels // 3, wrong + 3]]]
        )
        wanted = [
            (labels - wrong - right) / (wrong - left) if left < wrong else np.nan for right, left in kept.tolist()
        ]
        after = np.column_stack([kept.sum(axis=1), kept[:, 1]])
        price, chance = prices(np.array([labels, wrong]), after)
        price = answer_array(price)
        assert price.shape == (8,), "another shape"
        assert np.array_equal(np.isnan(price), np.isnan(wanted)), (
            "a price is NaN where no wrong label was removed, only there"
        )
        for a, b in zip(price.tolist(), wanted, strict=True):
            assert np.isnan(b) or close(a, b), "another price of a reach"
        assert close(answer_number(chance), (labels - wrong) / wrong), "another price at random"
