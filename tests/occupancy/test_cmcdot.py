"""Whole filters on small worlds whose truth is known: the compiled one, and where it says so the book's and the BOF."""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds.lecture_02_boxes import Box, cells_in, scan_boxes
from worlds.lecture_04_scenes import hit_cells

from semgrid_edu import fast, occupancy
from semgrid_edu.camera import Camera, rigid_transform
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import Cmcdot, track_drive
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Bof, BofParams, CmcdotParams, PlanarMotion, State, VelocityLattice

SMALL = GridSpec(0, 40, -10, 10, 0.5)
PARAMS = CmcdotParams(n_particles=50_000)
STILL = PlanarMotion()
WALL, PARKED = Box(5, 60, 7.2, 7.7, 2.5), Box.around(22, -6, 4, 1.8, 1.5)


def street(time: float) -> list[Box]:
    """A wall, a parked car, a car that comes towards us at 8 m/s and one that drives ahead at 6 m/s."""
    return [WALL, PARKED, Box.around(36 - 8 * time, 3, 4, 1.8, 1.5), Box.around(12 + 6 * time, -2, 4, 1.8, 1.5)]


def drive(speed: float, steps: int, tracker: Cmcdot | Bof, seed: int = 0):
    """Yield time, the vehicle's x, the scan and the belief, for a vehicle that drives along x."""
    rng = np.random.default_rng(seed)
    for k in range(steps):
        x = speed * k * 0.1
        points = scan_boxes(street(k * 0.1), x=x, noise=0.02, rng=rng)
        yield k * 0.1, x, points, tracker.step(points, PlanarMotion(speed * 0.1, 0, 0), 0.1)


@pytest.fixture(
    scope="module",
    params=[
        (0.0, lambda: fast.Cmcdot(SMALL, PARAMS)),
        (4.0, lambda: occupancy.Cmcdot(SMALL, PARAMS)),
        (4.0, lambda: Bof(SMALL, BofParams(VelocityLattice(12.0, 2.0)))),
    ],
    ids=["standing", "driving, the book's filter", "driving, BOF"],
)
def street_seen(request):
    speed, tracker = request.param
    return list(drive(speed, 26, tracker()))


@pytest.fixture(scope="module")
def street_at_end(street_seen):
    return street_seen[-1]


def dynamic_share(box: Box, at_end) -> tuple[float, np.ndarray]:
    """Return the share of the box's hit cells that are more DYNAMIC than STATIC, and their mean velocity."""
    _, x, points, belief = at_end
    cells = cells_in(box, SMALL, x, margin=0.3) & hit_cells(points, SMALL)
    dynamic = belief.probability[State.DYNAMIC] > belief.probability[State.STATIC]
    assert cells.sum() >= 3
    return dynamic[cells].mean(), np.nanmean(belief.velocity[:, cells & dynamic], axis=1) if dynamic[
        cells
    ].any() else None


@pytest.mark.parametrize(("which", "speed"), [(2, -8), (3, 6)], ids=["oncoming", "ahead"])
def test_moving_cars_become_dynamic_with_the_right_velocity(street_at_end, which, speed):
    share, velocity = dynamic_share(street(street_at_end[0])[which], street_at_end)
    assert share >= 0.75
    assert np.abs(velocity - [speed, 0]).max() < 1.5


@pytest.mark.parametrize("box", [WALL, PARKED], ids=["wall", "parked"])
def test_what_stands_stays_static(street_seen, box):
    shares = [dynamic_share(box, seen)[0] for seen in street_seen[5:]]
    assert np.mean(shares) <= 0.03


def test_road_is_free_and_behind_a_wall_nobody_knows(street_at_end):
    _, x, _, belief = street_at_end
    most_likely = belief.probability.argmax(axis=0)
    road = cells_in(Box(x + 3, x + 8, -2, 2, 0), SMALL, x)
    behind = cells_in(Box(x + 8, x + 25, 8.5, 10, 0), SMALL, x)
    assert (most_likely[road] == State.FREE).all()
    assert (most_likely[behind] == State.UNKNOWN).all()


def test_velocity_and_its_covariance_are_known_where_dynamic_mass_is(street_at_end):
    belief = street_at_end[3]
    assert belief.probability.dtype == belief.velocity.dtype == np.float32
    assert belief.probability.shape == (4, *SMALL.shape)
    assert np.array_equal(np.isnan(belief.velocity[0]), np.isnan(belief.velocity[1]))
    known = ~np.isnan(belief.velocity[0])
    assert known[belief.probability[State.DYNAMIC] > 0.5].mean() > 0.95
    assert not known[belief.probability[State.DYNAMIC] == 0].any()
    covariance = np.moveaxis(belief.velocity_covariance, (0, 1), (-2, -1))
    assert covariance.shape == (*SMALL.shape, 2, 2)
    assert covariance.dtype == np.float32
    assert np.array_equal(np.isnan(covariance), np.broadcast_to(~known[..., None, None], covariance.shape))
    assert np.array_equal(covariance, covariance.swapaxes(-2, -1), equal_nan=True)
    assert np.linalg.eigvalsh(covariance[known].astype(float)).min() > -1e-4
    assert covariance[known].max() > 1


def test_a_mirrored_world_is_believed_mirrored():
    """Except for cells whose centre lies on the border of two beams; no return lies there."""
    points = scan_boxes(street(0.0), columns=360)
    beliefs = [Cmcdot(SMALL, PARAMS).step(p, STILL, 0.1).probability for p in (points, points * [1, -1, 1])]
    assert (np.abs(beliefs[0] - beliefs[1][:, :, ::-1]).max(axis=0) > 0.05).mean() < 0.02


def test_same_seed_same_bits_other_seed_other_bits():
    first, again, other = (list(drive(4.0, 4, Cmcdot(SMALL, PARAMS, seed), seed))[-1] for seed in (1, 1, 2))
    assert np.array_equal(first[3].probability, again[3].probability)
    assert np.array_equal(first[3].velocity, again[3].velocity, equal_nan=True)
    assert not np.array_equal(first[3].probability, other[3].probability)


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 10_000),
    st.integers(0, 300),
    st.sampled_from([1e-3, 1.0, 30.0, 1e6]),
    st.sampled_from([0.0, 0.1, 5.0]),
    st.floats(-100, 100),
    st.floats(-7, 7),
    st.sampled_from([1, 2, 3, 2000]),
    st.sampled_from([fast.Cmcdot, occupancy.Cmcdot]),
)
def test_any_scans_keep_every_cell_a_distribution(seed, count, spread, dt, shift, yaw, n_particles, filter_class):
    rng = np.random.default_rng(seed)
    tracker = filter_class(SMALL, CmcdotParams(n_particles=n_particles), seed)
    for _ in range(3):
        points = rng.normal(0, 1, (count, 4)) * [spread, spread, 1, 1] + [10, 0, 0.5, 0]
        belief = tracker.step(points, PlanarMotion(shift, 0, yaw), dt)
        assert np.abs(belief.probability.sum(axis=0) - 1).max() < 1e-5
        assert belief.probability.min() >= -1e-6


def frames(count: int) -> list[Frame]:
    """Return the frames of a LIDAR that drives along the world's y axis at 5 m/s."""
    camera = Camera(np.diag([100.0, 100.0, 1.0]), np.eye(4), size=(10, 20))
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    result = []
    for k in range(count):
        points = np.pad(scan_boxes(street(0.1 * k), x=0.5 * k), ((0, 0), (0, 1))) - np.float32([0, 0, 1.73, 0])
        result.append(Frame(None, points, camera, rigid_transform(turn, np.array([3.0, 0.5 * k, 0])), 0.1 * k))
    return result


def test_track_drive_takes_motion_and_time_from_the_frames():
    tracker = Cmcdot(SMALL, PARAMS, seed=5)
    for k, belief in enumerate(track_drive(frames(3), SMALL, PARAMS, seed=5)):
        expected = tracker.step(scan_boxes(street(0.1 * k), x=0.5 * k), PlanarMotion(0.5 * min(k, 1), 0, 0), 0.1)
        assert np.abs(belief.probability - expected.probability).max() < 0.05
    assert len(list(track_drive([], SMALL))) == 0


def test_track_drive_refuses_frames_out_of_order():
    with pytest.raises(ArgumentError, match="dt"):
        list(track_drive(frames(3)[::-1], SMALL, PARAMS))


ALONE = """
import resource, sys
import semgrid_edu.occupancy
print(*{"torch", "matplotlib", "scipy.stats", "numba"} & set(sys.modules))
import numpy as np
from semgrid_edu.grid import GridSpec
from semgrid_edu.fast import Cmcdot
from semgrid_edu.occupancy import PlanarMotion

wall = np.array([[20.0 + x, y, 1.0] for x in range(30) for y in np.arange(-10, 10, 0.1)], np.float32)
tracker = Cmcdot(GridSpec.paper())
for step in range(24):
    tracker.step(wall, PlanarMotion(0.9, 0.0, 0.001), 0.1)
    if step == 11:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.fixture(scope="module")
def printed() -> list[str]:
    """What `ALONE` prints; the environment asks to return memory as soon as it is freed."""
    variables = os.environ | {"MALLOC_TRIM_THRESHOLD_": "131072"}
    done = subprocess.run([sys.executable, "-c", ALONE], capture_output=True, text=True, check=True, env=variables)
    return done.stdout.splitlines()


@pytest.mark.skipif(sys.platform != "linux", reason="other systems' allocators are left as they are")
def test_the_memory_of_one_step_serves_the_next(printed):
    """What the filter keeps, 200,000 particles of 20 bytes and four states of 70,000 cells, is 1,250 pages of 4 kB.

    Twelve steps that were lent only as much memory anew as that would touch 15,000 pages. In a process of its own, in
    which nothing else has freed large buffers.
    """
    assert int(printed[1]) < 1250


def test_importing_the_filter_loads_nothing_heavy(printed):
    assert printed[0] == ""
