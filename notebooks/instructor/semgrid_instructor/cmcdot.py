"""Hidden tests of exercise 04, CMCDOT: the package itself is the reference."""

from collections.abc import Callable

import numpy as np

from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.fast import track_drive
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import CmcdotParams, Evidence, FilterState, Particles
from semgrid_edu.occupancy import update as package_update
from semgrid_edu.occupancy.cmcdot import velocity_moments
from semgrid_edu.occupancy.state import cells_of, systematic_resample, weight_in_cells
from semgrid_edu.workshop.course.answers import answer_array, answer_arrays
from semgrid_instructor import close, generator, hidden, in_any_order, keeping


@hidden
def check_in_cells(in_cells: Callable) -> None:
    """Many particles in and around a grid that reaches behind the vehicle, some cells without any."""
    rng = generator(1)
    spec = GridSpec(x_min=-2, x_max=6, y_min=-1, y_max=3, cell=0.5)
    position = rng.uniform([-4, -3], [8, 5], size=(300, 2))
    velocity, weight = rng.normal(0, 8, size=(300, 2)), rng.uniform(0.001, 0.1, size=300)
    particles = Particles(*(a.astype(np.float32) for a in (position, velocity, weight)))
    cells = cells_of(particles.position, spec)
    expected, _ = velocity_moments(particles, cells, spec.shape)
    total = weight_in_cells(particles.weight, cells, spec.shape)
    dx, dy = rng.uniform((1.0, -0.9), (1.9, -0.3))
    before = position + np.array([dx, dy])
    slips = {
        "`dy` isn't subtracted: the vehicle has driven `dx` forward and `dy` to the left": (0, dy),
        "`dx` isn't subtracted: the vehicle has driven `dx` forward and `dy` to the left": (dx, 0),
        "`dy` is added: the vehicle has driven to the left, so what it sees is farther right": (0, 2 * dy),
    }
    wrong = {
        hint: weight_in_cells(particles.weight, cells_of(position + np.array(shift), spec), spec.shape)
        for hint, shift in slips.items()
    }
    got = in_cells(before.copy(), velocity.copy(), weight.copy(), dx, dy, spec.x_max, spec.y_max, spec.cell, spec.shape)
    dynamic, mean = answer_arrays(got, 2)
    assert dynamic.shape == spec.shape, "dynamic has another shape"
    for hint, sums in wrong.items():
        assert not close(dynamic, sums, atol=1e-5), hint
    inner, right = close(dynamic[1:, 1:], total[1:, 1:], atol=1e-5), close(dynamic, total, atol=1e-5)
    cut = (
        "wrong sums in row 0 or column 0: int() and astype(int) cut -0.6 to 0, a cell of the grid; take np.floor first"
    )
    assert right or not inner, cut
    assert right, "wrong sums (cells need not be 1 m; particles may be on any side)"
    empty = np.isnan(expected)
    assert np.array_equal(np.isnan(mean), empty), "velocity must be NaN exactly where no particle is"
    assert close(mean[~empty], expected[~empty], atol=1e-3), "sums are right, mean velocities are not"


def _scan(belief: np.ndarray, likelihood: np.ndarray, first_sight: tuple) -> np.ndarray:
    """Return the belief of each cell after a scan, cell by cell."""
    after = belief.copy()
    for r, c in np.ndindex(belief.shape[1:]):
        free, static, dynamic = likelihood[:, r, c]
        if free == static == dynamic:
            continue
        prior = belief[:3, r, c] + belief[3, r, c] * np.array(first_sight)
        joint = prior * [free, static, dynamic]
        after[:, r, c] = [*joint / joint.sum(), 0] if joint.any() else [0, 0, 0, 1]
    return after


@hidden
@keeping
def check_update(update: Callable) -> None:
    """Random beliefs and likelihoods over a grid of another shape; in some cells two of the three are equal."""
    rng = generator(3)
    belief = rng.dirichlet(np.ones(4), size=(6, 5)).transpose(2, 0, 1)
    likelihood = rng.uniform(0.05, 1, size=(3, 6, 5))
    likelihood[0, 0], likelihood[2, 1], likelihood[0, 2] = likelihood[1, 0], likelihood[1, 1], likelihood[2, 2]
    expected = _scan(belief, likelihood, (0.5, 0.2, 0.3))
    got = answer_array(update(belief.copy(), likelihood.copy(), (0.5, 0.2, 0.3)))
    assert got.shape == belief.shape, "another shape"
    assert close(got.sum(axis=0), 1), "the states of some cells don't sum to 1"
    left = "UNKNOWN is left where two of the three likelihoods are equal: a scan is silent only where all three are"
    assert close(got[3], 0), left
    assert close(got, expected, atol=1e-5), "sums are right, values are not"
    evidence = np.stack([likelihood[0], likelihood[1], likelihood[1]])  # a scanner that measures no speed
    assert close(_package(belief, evidence), _scan(belief, evidence, (0.5, 0.2, 0.3)), atol=1e-5)


def _package(belief: np.ndarray, likelihood: np.ndarray) -> np.ndarray:
    """Return what the package makes of a scan that doesn't tell DYNAMIC from STATIC."""
    spec = GridSpec(x_min=0, x_max=belief.shape[1], y_min=0, y_max=belief.shape[2], cell=1)
    state = FilterState(belief.astype(np.float32), Particles.none(), belief[2].astype(np.float32))
    evidence = Evidence(likelihood[1].astype(np.float32), likelihood[0].astype(np.float32))
    return package_update(state, spec, evidence, CmcdotParams(first_sight=(0.5, 0.2, 0.3))).probability


@hidden
def check_update_limits(update: Callable) -> None:
    """Silent cells, cells certain of a state, contradictions, and what is only improbable.

    What becomes of UNKNOWN and of DYNAMIC in a cell that the scan sees is for check_update to judge.
    """
    belief = np.eye(4)[:, None, [0, 1, 0, 1, 0, 1, 2, 3]]
    occupied, free = generator(7).uniform(0.1, 0.9, size=(2, 1, 8))
    free[0, 0] = occupied[0, 1] = occupied[0, 2] = free[0, 3] = 0
    free[0, 4:] = occupied[0, 4:]
    likelihood = np.stack([free, occupied, occupied])
    expected = _scan(belief, likelihood, (0.5, 0.2, 0.3))
    got = answer_array(update(belief.copy(), likelihood.copy(), (0.5, 0.2, 0.3)))
    assert np.isfinite(got).all(), "a cell is NaN or infinite"
    assert close(got[..., 4:], belief[..., 4:]), "where the scan is silent the belief must stay"
    assert close(got, expected, atol=1e-5), "wrong where a cell is certain or contradicted"
    for tiny in (1e-4, 1e-7):
        got = answer_array(update(belief[..., :1].copy(), np.array([tiny, 0.9, 0.9])[:, None, None], (0.5, 0.2, 0.3)))
        possible = "a cell, surely free, explains its scan with a small probability: that is no contradiction"
        assert close(got[:, 0, 0], [1, 0, 0, 0]), possible


@hidden
def check_stratified(stratified: Callable) -> None:
    """More and fewer draws than weights, weights of zero at the ends, and teeth on borders."""
    rng = generator(4)
    for size, count in ((50, 50), (7, 200), (400, 20)):
        weight, offsets = rng.dirichlet(np.full(size, 0.3)) * 3, rng.random(count)
        teeth = (np.arange(count) + offsets) / count * weight.sum()
        expected = [int(np.argmax(np.cumsum(weight) > tooth)) for tooth in teeth]
        got = answer_array(stratified(weight.copy(), count, offsets.copy()))
        assert got.shape == (count,), "another number of indices than were asked for"
        assert np.array_equal(got, expected), "wrong indices for random weights"
    one = rng.random()
    comb = systematic_resample(weight, 20, one)
    assert np.array_equal(answer_array(stratified(weight.copy(), 20, np.full(20, one))), comb), "equal offsets: a comb"
    weight = np.array([0.0, 1, 1, 0, 2, 0])
    got = answer_array(stratified(weight.copy(), 8, np.zeros(8)), dtype=int)
    assert (weight[got] > 0).all(), "a particle of weight 0 was drawn (a tooth on a border draws the second)"
    assert np.array_equal(got, [1, 1, 2, 2, 4, 4, 4, 4]), "wrong where a tooth lies on a border"


@hidden
@keeping
def check_two_arrivals(two_arrivals: Callable) -> None:
    """Random cells, and cells in which something surely arrives, surely doesn't, or surely stands."""
    rng = generator(5)
    left, right, static = rng.uniform(0.05, 0.95, size=(3, 5, 4))
    left[0], right[1, :2], static[2, :2], static[3, :2] = 0, 1, 0, 1
    expected = np.empty((3, 5, 4))
    for cell in np.ndindex(left.shape):
        a, b, s = left[cell], right[cell], static[cell]
        possible = np.array([(1 - a) * (1 - b) * (1 - s), (1 - a) * (1 - b) * s, (a + b - 2 * a * b) * (1 - s)])
        expected[(slice(None), *cell)] = possible / possible.sum()
    got = answer_array(two_arrivals(left.copy(), right.copy(), static.copy()))
    assert got.shape == expected.shape, "another shape"
    assert close(got.sum(axis=0), 1), "the states of some cells don't sum to 1"
    assert close(got[:, 0], expected[:, 0], atol=1e-5), "wrong where nothing arrives from the left"
    assert close(got, expected, atol=1e-5), "wrong where both may arrive"


def _one_tooth_in_each_part(weight: np.ndarray, count: int, offsets: np.ndarray) -> np.ndarray:
    ends = np.cumsum(weight)
    return np.searchsorted(ends, (np.arange(count) + offsets) / count * ends[-1], side="right")


class _Stratified:
    """The resampling that the exercise asks for."""

    def draw(self, weight: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """Draw by one tooth in each part."""
        return _one_tooth_in_each_part(weight, count, rng.random(count))


@hidden
def check_track(maps: Callable) -> None:
    """Compare frames of both drives, drawn like the grid, with the same filter under the right resampling.

    What is right is worked out first, from frames of its own. The answer gets others, in any order.
    """
    rng = generator(6)
    params = CmcdotParams(n_particles=20_000, resampling=_Stratified())
    cases = []
    for drive in (sample_drive, real_drive):
        count = int(rng.integers(3, 5))
        first = int(rng.integers(1, len(drive()) - count + 1))
        x_max, y_max = (float(edge) for edge in rng.integers((18, 8), (26, 13)))
        spec = GridSpec(x_min=0, x_max=x_max, y_min=y_max - 20, y_max=y_max, cell=0.5)
        beliefs = track_drive(_frames(drive, first, count), spec, params, seed=0)
        cases.append((drive, first, spec, np.array([belief.probability[2] for belief in beliefs])))
    for drive, first, spec, expected in in_any_order(cases):
        got = answer_array(maps(_frames(drive, first, len(expected)), spec, _one_tooth_in_each_part))
        assert got.shape == expected.shape, "maps of another shape, or for another number of frames"
        same = close(got, expected, atol=1e-4)
        assert same, "it isn't the same filter (20,000 particles, seed 0, offsets from rng.random(count))"


def _frames(drive: Callable, first: int, count: int) -> list[Frame]:
    opened = drive()
    return [opened[k] for k in range(first, first + count)]
