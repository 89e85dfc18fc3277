"""A student's own resampling in the filter, and what is said to one that is broken."""

import numpy as np
import pytest

from semgrid_edu import fast
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import Cmcdot
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    CmcdotParams,
    FilterState,
    PlanarMotion,
    Resampling,
    State,
    SystematicResampling,
    resample,
)

SPEC = GridSpec(0, 20, -5, 5, 0.5)
WALL = np.array([[10.25, y, 1.0] for y in np.arange(-3.9, 4, 0.1)])


class Multinomial:
    """Independent draws, as in the bootstrap filter."""

    def __init__(self):
        self.asked = []

    def draw(self, weight, count, rng):
        self.asked.append((len(weight), count))
        weight /= weight.sum()  # it is a copy
        return rng.choice(len(weight), count, p=weight)


class Stratified:
    """One point anywhere in each of `count` equal intervals of the weights laid end to end."""

    def draw(self, weight, count, rng):
        points = (np.arange(count) + rng.random(count)) / count
        return np.searchsorted(np.cumsum(weight / weight.sum())[:-1], points, side="right")


def params_with(resampling: Resampling) -> CmcdotParams:
    return CmcdotParams(n_particles=5000, resampling=resampling)


def beliefs_of(resampling: Resampling, seed: int = 0) -> list[np.ndarray]:
    tracker = Cmcdot(SPEC, params_with(resampling), seed)
    return [tracker.step(WALL + np.array([0.3 * k, 0, 0]), PlanarMotion(), 0.1).probability for k in range(6)]


@pytest.mark.parametrize("resampling", [Multinomial(), Stratified()], ids=["multinomial", "stratified"])
def test_the_filter_draws_by_it_and_believes_much_the_same(resampling):
    own, again, usual = beliefs_of(resampling), beliefs_of(resampling), beliefs_of(SystematicResampling())
    assert np.array_equal(own, again)
    assert not np.array_equal(own, usual)
    assert np.abs(np.subtract(own, usual)).mean() < 0.02
    np.testing.assert_allclose(np.sum(own, axis=1), 1, atol=1e-5)


def test_it_is_asked_for_particles_and_for_newborn_cells():
    resampling = Multinomial()
    tracker = Cmcdot(SPEC, params_with(resampling))
    cells = int(np.prod(tracker.map_spec.shape))
    for _ in range(2):
        tracker.step(WALL, PlanarMotion(), 0.1)
    assert resampling.asked == [(cells, 1500), (1500, 3500), (cells, 1500)]


def test_both_twins_draw_by_it():
    state = FilterState.unknown(SPEC)
    state.probability[State.DYNAMIC], state.probability[State.UNKNOWN] = 0.25, 0.75
    state.newborn[:] = 0.25
    twins = resample, fast.resample
    book, compiled = (twin(state, SPEC, params_with(Stratified()), np.random.default_rng(0)) for twin in twins)
    np.testing.assert_allclose(book.particles.position, compiled.particles.position, atol=1e-5)


class Returns:
    """Returns what it was given."""

    def __init__(self, answer):
        self.answer = answer

    def draw(self, weight, count, rng):
        return self.answer


@pytest.mark.parametrize(
    ("answer", "found"),
    [
        (None, r"shape \(\), type object"),
        (np.zeros(7, int), r"shape \(7,\), type int64"),
        (np.zeros(1500), r"shape \(1500,\), type float64"),
        (np.full(1500, -1), "indices from -1 to -1"),
        (np.full(1500, 10**6), "indices from 1000000 to 1000000"),
    ],
    ids=["nothing", "too few", "no whole numbers", "negative", "too large"],
)
def test_an_answer_that_is_no_index_is_refused_with_the_name_of_its_class_and_changes_nothing(answer, found):
    """The first step draws the 1500 newborn particles out of 5000."""
    resampling = Returns(answer)
    tracker = Cmcdot(SPEC, params_with(resampling))
    with pytest.raises(ArgumentError, match=rf"^Returns: expected \.draw\(.* return 1500 whole numbers.*found {found}"):
        tracker.step(WALL, PlanarMotion(1, 0, 0), 0.1)
    resampling.draw = SystematicResampling().draw
    twin = Cmcdot(SPEC, params_with(SystematicResampling()))
    for _ in range(2):
        beliefs = [one.step(WALL, PlanarMotion(), 0.1).probability for one in (tracker, twin)]
        assert np.array_equal(*beliefs)


@pytest.mark.parametrize(
    ("resampling", "found"),
    [
        (Multinomial, r"the class Multinomial itself: write Multinomial\(\)"),
        (len, "builtin_function_or_method"),
        (None, "None"),
    ],
)
def test_what_cannot_draw_is_refused_when_it_is_handed_over(resampling, found):
    with pytest.raises(ArgumentError, match=rf"^resampling: expected .*draw\(weight, count, rng\).*found {found}"):
        params_with(resampling)
