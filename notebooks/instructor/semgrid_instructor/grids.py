"""Hidden tests of exercise 02, occupancy grids: held to scipy, and to where a beam enters and leaves each cell."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from semgrid_edu.graphical import Factor, product
from semgrid_edu.grid import GridSpec
from semgrid_edu.workshop.course.answers import answer_array, answer_number
from semgrid_instructor import close, generator, hidden, keeping

CLIPPED = 0.05
"""A beam that is in a cell for less than this share of its side only clips it: passed or not, both are right."""


def _posterior(prior: NDArray, reflect: NDArray, seen: NDArray) -> NDArray:
    """Return P(m1, m2, m3 | z) by the package's exact inference, (2, 2, 2)."""
    passes = np.where(np.array(list(np.ndindex(2, 2, 2))) == 1, 1 - reflect[1], 1 - reflect[0])
    reaches = np.cumprod(np.column_stack([np.ones(8), passes]), axis=1)
    reflected = np.column_stack([reaches[:, :3] * (1 - passes), reaches[:, 3]]).reshape(2, 2, 2, 4)
    cells = [Factor(f"m{k}", [1 - p, p]) for k, p in enumerate(prior)]
    model = product([*cells, Factor(("m0", "m1", "m2", "r"), reflected), Factor("r", seen)])
    return model.sum("r").ordered("m0", "m1", "m2").normalised().table


def _world(rng: np.random.Generator) -> tuple[NDArray, NDArray, NDArray]:
    """Return prior, reflect and seen of three cells."""
    reflect = np.array([rng.uniform(0.02, 0.2), rng.uniform(0.6, 0.9)])
    return rng.uniform(0.1, 0.9, 3), reflect, rng.uniform(0.1, 0.9, 4)


@hidden
@keeping
def check_posterior(beam_posterior: Callable) -> None:
    """Other cells and reports; a report that rules some cells out."""
    rng = generator(21)
    for k in range(6):
        prior, reflect, seen = _world(rng)
        seen[k % 4] *= k % 2
        got = answer_array(beam_posterior(prior.copy(), reflect.copy(), seen.copy()))
        expected = _posterior(prior, reflect, seen)
        assert got.shape == expected.shape, "another shape"
        assert close(got.sum(), 1.0), "the eight probabilities don't sum to 1"
        assert close(got, expected), "wrong probabilities of the maps"


@hidden
@keeping
def check_nothing_back(beam_posterior: Callable) -> None:
    """Nothing came back, and free cells never reflect: ratios of maps, which no normalisation changes."""
    rng = generator(30)
    for clutter in (0.0, 0.1):
        prior, reflect, _ = _world(rng)
        reflect[0] = clutter
        got = answer_array(beam_posterior(prior.copy(), reflect.copy(), np.array([0.0, 0.0, 0.0, 0.5])))
        assert got.shape == (2, 2, 2), "another shape"
        assert (got > 0).all(), "every map lets some beams pass"
        expected = np.prod((1 - reflect[1]) / (1 - clutter) * prior / (1 - prior))
        assert close(got[1, 1, 1] / got[0, 0, 0], expected), "wrong when nothing came back"


@hidden
@keeping
def check_price(price: Callable) -> None:
    """Posteriors drawn at random, and one whose cells are sure of being alike."""
    rng = generator(22)
    alike = np.zeros((2, 2, 2))
    alike[0, 0, 0] = alike[1, 1, 1] = 0.5
    for table in (*rng.dirichlet(np.full(8, 0.5), size=5).reshape(5, 2, 2, 2), alike):
        ones = [table.take(1, axis=k).sum() for k in range(3)]
        q = product(Factor(f"m{k}", [1 - p, p]) for k, p in enumerate(ones)).table
        got = answer_number(price(table.copy()))
        assert close(got, 0.5 * np.abs(table - q).sum(), atol=1e-5), "wrong total variation"


def _scan(seed: int) -> tuple[NDArray, NDArray, NDArray]:
    """Return log-odds and the two likelihoods of a scan that says nothing of every third cell, each (5, 7)."""
    rng = generator(seed)
    occupied, free = rng.uniform(0.05, 0.95, size=(2, 5, 7))
    free.flat[::3] = occupied.flat[::3]
    return rng.normal(0, 1, size=(5, 7)), occupied, free


@hidden
@keeping
def check_update(update: Callable) -> None:
    """Random scans of a grid of another shape, with limits far away; check_clamp judges what the limits do."""
    L, occupied, free = _scan(23)
    silent = occupied == free
    for dt, tau in ((0.1, 0.5), (0.2, 1.5), (0.4, 0.3)):
        got = answer_array(update(L.copy(), occupied.copy(), free.copy(), dt, tau, -50.0, 50.0))
        assert got.shape == L.shape, "another shape"
        expected = np.where(silent, L * np.exp(-dt / tau), L + np.log(occupied) - np.log(free))
        within = (expected > -2) & (expected < 3.5)
        assert close(got[silent & within], expected[silent & within]), (
            "cells of which the scan says nothing fade wrongly"
        )
        assert close(got[within], expected[within]), "wrong log-odds where something was seen"


@hidden
def check_clamp(update: Callable) -> None:
    """Other limits, not symmetric; cells on both sides of them, and some that began outside; the sums are its own."""
    L, occupied, free = _scan(24)
    L *= 3
    got = answer_array(update(L.copy(), occupied.copy(), free.copy(), 0.1, 2.0, -1.2, 2.7))
    sums = answer_array(update(L.copy(), occupied.copy(), free.copy(), 0.1, 2.0, -50.0, 50.0))
    opposite = answer_array(update(L.copy(), free.copy(), occupied.copy(), 0.1, 2.0, -50.0, 50.0))
    assert not close(sums, opposite), "with wide limits it doesn't matter what the scan says"
    assert got.size > 0, "no cells came back"
    assert got.max() <= 2.7 + 1e-6, "some cells are above L_max"
    assert got.min() >= -1.2 - 1e-6, "some cells are below L_min"
    assert not close(got, sums), "no cell gets as far as its limit, old beliefs and scan together"
    assert close(got, np.clip(sums, -1.2, 2.7)), "cells within the limits are wrong"


@hidden
def check_fuse(fuse: Callable) -> None:
    """One scan, and many; other priors."""
    rng = generator(25)
    for n_scans, prior in ((1, 0.1), (2, 0.7), (9, 0.35)):
        posteriors = rng.uniform(0.05, 0.95, size=(n_scans, 3, 4))
        posteriors[:, 0, 0] = prior
        got = answer_array(fuse(prior, posteriors.copy()))
        how_many = "one scan" if n_scans == 1 else "several scans"
        assert got.shape == (3, 4), "another shape"
        assert close(got[0, 0], prior), how_many + " said nothing of a cell, and its prior has changed"
        evidence = logit(posteriors) - logit(prior)
        assert close(got, expit(logit(prior) + evidence.sum(axis=0))), "wrong with " + how_many


@hidden
def check_fuse_many(fuse: Callable) -> None:
    """Thousands of scans for and then as many against, which cancel; the prior, 0.5, is for check_fuse to judge."""
    rng = generator(29)
    for_it, last = rng.uniform(0.6, 0.95, size=(1500, 2, 3)), rng.uniform(0.1, 0.9, size=(1, 2, 3))
    for posteriors in (np.concatenate([for_it, 1 - for_it]), np.concatenate([1 - for_it, for_it])):
        got = answer_array(fuse(0.5, np.roll(np.concatenate([posteriors, last]), rng.integers(1500), axis=0)))
        assert np.isfinite(got).all(), (
            "NaN after thousands of scans: a long product ends at 0 or infinity; add logarithms"
        )
        alone = answer_array(fuse(0.5, last.copy()))
        opposite = answer_array(fuse(0.5, 1 - last))
        assert not close(alone, opposite), "it doesn't matter what one scan says"
        stuck = "thousands of scans that cancel leave a trace: no belief comes back from exactly 0 or 1; add logarithms"
        assert close(got, alone), stuck


@hidden
def check_highest_clamp(highest_clamp: Callable) -> None:
    """Other speeds, periods, tails and sensors; tails so short that no pass may be survived."""
    rng = generator(26)
    for survived in range(7):
        occupied, share = rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.9)
        free = rng.uniform(occupied + 0.15, 0.95)
        speed, dt = rng.uniform(1, 30), rng.uniform(0.05, 0.5)
        got = answer_number(highest_clamp((survived + share) * speed * dt, speed, dt, occupied, free))
        assert 0 < got < 1, "that is no probability to clamp at"
        wrong = "wrong clamp (a tail may be so short that no pass is survived)"
        assert abs(got - expit((survived + 1) * np.log(free / occupied))) < 2e-4, wrong
        if survived:  # numbers that a computer holds exactly
            got = answer_number(highest_clamp(survived * 2.0, 8.0, 0.25, occupied, free))
            longest = "wrong clamp where the tail may be exactly a number of passes long: it may be at most that long"
            assert abs(got - expit((survived + 1) * np.log(free / occupied))) < 2e-4, longest


@hidden
@keeping
def check_as_belief(as_belief: Callable) -> None:
    """Random log-odds of a grid that isn't square, and some whose exponential no computer holds."""
    L = generator(31).normal(0, 2, size=(4, 5))
    L[0, :2] = 1000, -1000
    got = answer_array(as_belief(L.copy()))
    assert got.shape == (4, 4, 5), "another shape"
    assert np.isfinite(got).all(), "log-odds of 1000 give no number: e^1000 overflows"
    P = expit(L)
    expected = np.stack([np.maximum(1 - 2 * P, 0), np.maximum(2 * P - 1, 0), 0 * P, 1 - np.abs(2 * P - 1)])
    assert close(got, expected, atol=1e-5), "wrong probabilities of the states"


def _crossed(spec: GridSpec, x: float, y: float) -> NDArray:
    """Return how far the beam to (x, y) runs in each cell, metres, (H, W)."""
    towards = np.where(np.array([x, y]) == 0, 1e-12, [x, y])
    near, far = ((spec.centers() - sign * np.copysign(spec.cell / 2, towards)) / towards for sign in (1, -1))
    enters = near.max(axis=-1).clip(0, 1)
    leaves = far.min(axis=-1).clip(0, 1)
    return np.maximum(leaves - enters, 0) * np.hypot(x, y)


def _judge_passes(got: NDArray, inside: NDArray, spec: GridSpec) -> None:
    """Compare evidence (H, W) in the cells that aren't hit with how far the beam runs in them."""
    assert (got <= 0).all(), "a cell is hit in which there is no return"
    assert close(got[inside > CLIPPED * spec.cell], -0.4), "a cell that the beam crosses isn't free"
    assert (got[inside == 0] == 0).all(), "the beam says something of cells that it doesn't cross"


def _judge_beam(beam_evidence: Callable, spec: GridSpec, x: float, y: float) -> None:
    """Compare one beam with a return in the grid, cell by cell, with where the beam enters and leaves it."""
    got = answer_array(beam_evidence(x, y, spec, 1.5, -0.4))
    assert got.shape == spec.shape, "another shape"
    (row,), (col,), _ = spec.cells(np.array([[x, y]]))
    assert close(got[row, col], 1.5), "the cell of the return isn't hit (cells need not be 1 m, nor the grid symmetric)"
    inside = _crossed(spec, x, y)
    inside[row, col] = got[row, col] = 0
    _judge_passes(got, inside, spec)


def _judge_beam_beyond(beam_evidence: Callable, spec: GridSpec, x: float, y: float) -> None:
    """Judge a beam with a return outside the grid; where beams within the grid are wrong, half of the cells will do."""
    got = answer_array(beam_evidence(x, y, spec, 1.5, -0.4))
    assert got.shape == spec.shape, "another shape"
    inside = _crossed(spec, x, y)
    assert (got < 0).sum() < 3 * (inside > 0).sum() + 9, "the beam says something of cells that it doesn't cross"
    to_border = 0.999 * inside.sum() / np.hypot(x, y)
    try:
        _judge_beam(beam_evidence, spec, to_border * x, to_border * y)
    except AssertionError:
        within = answer_array(beam_evidence(to_border * x, to_border * y, spec, 1.5, -0.4))
        assert (got <= 0).all(), "a cell is hit in which there is no return"
        assert (got < 0).sum() >= max(1, (within < 0).sum() / 2), "a cell that the beam crosses isn't free"
    else:
        _judge_passes(got, inside, spec)


@hidden
def check_beam(beam_evidence: Callable) -> None:
    """Beams in all directions, in a grid that also reaches behind the vehicle, of small cells."""
    rng = generator(27)
    spec = GridSpec(x_min=-10.1, x_max=14.9, y_min=-6.1, y_max=9.9, cell=0.5)
    for x, y in rng.uniform([-9, -5.5], [14, 9], size=(12, 2)):
        _judge_beam(beam_evidence, spec, float(x), float(y))


@hidden
def check_beam_outside(beam_evidence: Callable) -> None:
    """Try returns beyond each border of the grid, far and near: int() cuts -0.6 to 0, a row of the grid."""
    spec = GridSpec(x_min=-10.1, x_max=14.9, y_min=-6.1, y_max=9.9, cell=0.5)
    ahead, behind = (answer_array(beam_evidence(x, 1.7, spec, 1.5, -0.4)) for x in (20.3, -12.4))
    assert not close(ahead, behind), "the same cells, wherever the beam goes"
    ways = ((20.3, 1.7), (16.1, -9.3), (-12.4, 3.3), (4.2, 12.9), (3.1, -7.7), (15.2, 1.7), (4.2, 10.2))
    for x, y in ways + generator(28).uniform(-0.15, 0.15, (7, 2)):
        _judge_beam_beyond(beam_evidence, spec, x, y)
