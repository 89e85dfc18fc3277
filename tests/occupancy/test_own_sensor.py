"""A student's own sensor model in all filters, and what they say to one that is broken."""

import numpy as np
import pytest

from semgrid_edu import fast
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    Bof,
    BofParams,
    Cmcdot,
    CmcdotParams,
    Evidence,
    LogOddsGrid,
    LogOddsParams,
    PlanarMotion,
    Sensor,
    State,
    VelocityLattice,
    WorldModel,
)


class HitsOnly:
    """Believes what it hits, and draws no conclusion from what its beams pass."""

    def scan(self, points):
        self.high = points[points[:, 2] > 0.3]
        return self

    def evidence(self, spec, pose):
        rows, cols, inside = spec.cells(pose.parent_from_child(self.high[:, :2]))
        occupied, free = np.ones(spec.shape), np.ones(spec.shape)
        occupied[rows[inside], cols[inside]], free[rows[inside], cols[inside]] = 0.8, 0.05
        return Evidence(occupied, free)


SPEC = GridSpec(0, 20, -5, 5, 0.5)
WALL = np.array([[10.25, y, 1.0] for y in np.arange(-3.9, 4, 0.1)])
HIT, BEFORE = (19, slice(3, 17)), (slice(22, 32), 10)
"""Cells of the wall, and of a column of cells between it and the vehicle."""


def tracker_of(kind: str, sensor: Sensor) -> Cmcdot | Bof | LogOddsGrid:
    if "cmcdot" in kind:
        filter_class = Cmcdot if kind == "cmcdot" else fast.Cmcdot
        return filter_class(SPEC, CmcdotParams(n_particles=5000, sensor=sensor))
    if kind == "bof":
        return Bof(SPEC, BofParams(VelocityLattice(4.0, 2.0), WorldModel(sensor=sensor)))
    return LogOddsGrid(SPEC, LogOddsParams(sensor=sensor))


def occupied(kind: str, belief: object) -> np.ndarray:
    """Return P(occupied) of what a filter hands out."""
    return belief if kind == "log-odds" else belief.probability[[State.STATIC, State.DYNAMIC]].sum(axis=0)


KINDS = pytest.mark.parametrize("kind", ["cmcdot", "fast cmcdot", "bof", "log-odds"])


@KINDS
def test_it_is_heard_by_every_filter(kind):
    """One hit by hand: Bayes' rule on the prior of first sight, 0.048 occupied, or on the log-odds grid's one half.

    Space that only beams pass is as unknown as before, where the package's own model calls it free.
    """
    p = occupied(kind, tracker_of(kind, HitsOnly()).step(WALL, PlanarMotion(), 0.1))
    prior = 0.5 if kind == "log-odds" else 0.045 + 0.003
    np.testing.assert_allclose(p[HIT], 0.8 * prior / (0.8 * prior + 0.05 * (1 - prior)), atol=1e-5)
    assert (p[BEFORE] == (0.5 if kind == "log-odds" else 0)).all()


@KINDS
def test_it_is_asked_in_the_frame_of_the_map_and_in_that_of_the_vehicle(kind):
    """A block that stands while the vehicle drives and turns is believed where each scan hits it."""
    tracker, pose, motion = tracker_of(kind, HitsOnly()), PlanarMotion(), PlanarMotion(0.33, 0.05, 0.01)
    block = np.stack([a.ravel() for a in np.mgrid[9:11.6:0.1, -3:3:0.1]], axis=1)
    inner = (np.abs(block - [10.3, 0]) < [0.6, 2.3]).all(axis=1)
    for _ in range(8):
        pose = pose.then(motion)
        seen = pose.child_from_parent(block)
        p = occupied(kind, tracker.step(np.pad(seen, ((0, 0), (0, 1)), constant_values=1.0), motion, 0.1))
    rows, cols, inside = SPEC.cells(seen[inner])
    assert inside.all()
    assert (p[rows, cols] > 0.9).all()


class Deaf:
    """Takes scans in, but forgets to return anything."""

    def scan(self, points):
        pass


class PairOfArrays(HitsOnly):
    def evidence(self, spec, pose):
        return np.ones(spec.shape), np.ones(spec.shape)


class OneGridOnly(HitsOnly):
    def evidence(self, spec, pose):
        return super().evidence(SPEC, pose)


@KINDS
@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        (Deaf(), r"^Deaf: expected \.scan\(points\) to return an object with a method \.evidence.*, found NoneType"),
        (PairOfArrays(), r"^PairOfArrays: expected \.evidence.* to return Evidence\(occupied, free\), found tuple"),
        (OneGridOnly(), r"^OneGridOnly: expected .*, found shape \(40, 20\).*its own map, which is larger"),
    ],
)
def test_an_answer_that_is_no_evidence_is_refused_with_the_name_of_its_class(kind, sensor, message):
    with pytest.raises(ArgumentError, match=message):
        tracker_of(kind, sensor).step(WALL, PlanarMotion(), 0.1)


@KINDS
def test_a_refused_answer_changes_nothing(kind):
    class BreaksOnce(HitsOnly):
        broken = True

        def evidence(self, spec, pose):
            evidence = super().evidence(spec, pose)
            return None if self.broken and spec != SPEC else evidence

    sensor = BreaksOnce()
    tracker, twin = tracker_of(kind, sensor), tracker_of(kind, HitsOnly())
    with pytest.raises(ArgumentError, match="NoneType"):
        tracker.step(WALL, PlanarMotion(1, 0, 0), 0.1)
    sensor.broken = False
    assert np.array_equal(*[occupied(kind, t.step(WALL, PlanarMotion(), 0.1)) for t in (tracker, twin)])


@pytest.mark.parametrize("params", [WorldModel, CmcdotParams, LogOddsParams])
@pytest.mark.parametrize(
    ("sensor", "found"), [(HitsOnly, r"the class HitsOnly itself: write HitsOnly\(\)"), (0.8, "float"), (None, "None")]
)
def test_what_takes_no_scans_is_refused_when_it_is_handed_over(params, sensor, found):
    with pytest.raises(ArgumentError, match=rf"^sensor: expected .*scan\(points\).*found {found}"):
        params(sensor=sensor)
