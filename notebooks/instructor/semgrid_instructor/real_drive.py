"""Hidden tests of exercise 13, a real drive: other numbers, other cameras, other frames of the sample drive."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from semgrid_edu.answers import answer_array, answer_number
from semgrid_edu.camera import Camera, project, rigid_transform, transform_points
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.workshop.studies.new_drive.drive_checks import time_gaps
from semgrid_edu.workshop.studies.new_drive.faults import FAULTS
from semgrid_instructor import close, generator, hidden


@hidden
def check_find_gaps(find_gaps: Callable) -> None:
    """Other sensors' periods, a long first step, clocks that waver; steps of 1.4 and of 1.6 times the median."""
    for seed, period in enumerate((0.02, 0.1036, 0.5, 3.0)):
        rng = generator(1300 + seed)
        steps = period * rng.uniform(0.8, 1.2, 40)
        steps[[0, 11, 30]] = period * np.array([2.2, 3.0, 2.0])
        above = np.argsort(steps)[[22, 25, 28, 31]]  # longer than the median, which stays
        steps[above] = np.median(steps) * np.array([1.4, 1.45, 1.55, 1.6])
        times = 100 + np.concatenate([[0.0], np.cumsum(steps)])
        got = answer_array(find_gaps(times.tolist())).ravel()
        wanted = time_gaps(times)
        assert got.shape == wanted.shape, f"{len(got)} gaps instead of {len(wanted)} for a period of {period} s"
        assert np.array_equal(got, wanted), f"other gaps for a period of {period} s"


@hidden
def check_share_on_image(share_on_image: Callable) -> None:
    """Cameras that are turned and stand elsewhere, and images of other sizes."""
    for seed, size in enumerate(((375, 1242), (188, 621), (400, 300))):
        rng = generator(1310 + seed)
        axes = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
        turn = Rotation.from_euler("xyz", rng.normal(0, 8, 3), degrees=True).as_matrix()
        T = rigid_transform(turn @ axes, rng.normal(0, 0.5, 3))
        K = np.array([[500.0, 0, size[1] / 2 + 25], [0, 480, size[0] / 2 - 20], [0, 0, 1]])
        points = rng.normal(0, (15, 8, 2), (2000, 3))
        seen = project(transform_points(T, points[points[:, 0] > 0]), Camera(K, T, size))[1]
        got = answer_number(share_on_image(points.copy(), T, K, size))
        assert close(got, seen.mean(), atol=2e-3), "another share for a camera that is turned and stands elsewhere"


def _road(seed: int) -> tuple[NDArray, float, float]:
    """Return returns of a road that is seen from anywhere ahead, its height and its rise."""
    rng = generator(seed)
    height, p, r = rng.uniform(1.2, 2.2), rng.uniform(-0.05, 0.05), rng.uniform(-0.03, 0.03)
    x, y = rng.uniform(3, 20, 300), rng.uniform(-1.5, 1.5, 300)
    return np.column_stack([x, y, -height + p * x + r * y]), height, float(np.degrees(np.arctan(p)))


@hidden
def check_ground(ground: Callable) -> None:
    """Other heights, and roads that fall or lean."""
    for seed in range(1320, 1326):
        road, height, rise = _road(seed)
        got = answer_array(ground(road.copy())).ravel()
        assert got.shape == (2,), f"{got.size} numbers instead of 2"
        assert close(got[0], height, atol=0.01), "another height: does the road fall or lean to a side?"
        assert close(got[1], rise, atol=0.05), "another rise: does the road fall or lean to a side?"


@hidden
def check_ground_with_cars(ground: Callable) -> None:
    """Cars elsewhere and of other sizes: they must change nothing, whatever the answer says without them."""
    for seed, (start, high) in enumerate(((5.0, 0.5), (10.0, 1.5), (15.0, 3.0))):
        road, height, rise = _road(1330 + seed)
        rng = generator(1340 + seed)
        road[:, 2] += rng.normal(0, 0.01, len(road))
        road[:60, 0] = rng.uniform(start, start + 4, 60)
        road[:60, 2] = -height + road[:60, 0] * np.tan(np.radians(rise)) + rng.uniform(0.3, high, 60)
        clear, got = (answer_array(ground(points.copy())).ravel() for points in (road[60:], road))
        raised = answer_array(ground(road[60:] + np.array([0, 0, 0.3]))).ravel()
        assert close(abs(raised[0] - clear[0]), 0.3, atol=0.02), "the same height for a road that lies higher up"
        assert abs(got[0] - clear[0]) < 0.02, f"a car {start:g} m ahead changes the height"
        assert abs(got[1] - clear[1]) < 0.2, f"a car {start:g} m ahead changes the rise"


@hidden
def check_overlay(overlay: Callable) -> None:
    """Other sizes of scans, and motions in three dimensions."""
    for seed, (n, m) in enumerate(((50, 80), (300, 40), (1, 5))):
        rng = generator(1350 + seed)
        T = rigid_transform(
            Rotation.from_euler("xyz", rng.normal(0, 20, 3), degrees=True).as_matrix(), rng.normal(0, 2, 3)
        )
        before, now = rng.normal(0, 10, (n, 3)), rng.normal(0, 10, (m, 3))
        wanted = np.median(KDTree(before).query(transform_points(T, now))[0])
        got = answer_number(overlay(before.copy(), now.copy(), T.copy()))
        assert close(got, wanted), f"another distance for scans of {n} and {m} returns"


@hidden
def check_find_fault(find_fault: Callable) -> None:
    """Other frames of the drive, all of the faults in any order, one of them twice."""
    rng, faults = generator(1360), ["none", "two frames lost", "camera turned", "LIDAR tilted", "poses backwards"]
    for fault in rng.permutation([*faults, rng.choice(faults)]).tolist():
        start = int(rng.integers(5, 10))
        said = find_fault(FAULTS[fault](sample_drive()[start : start + 11]))
        assert said == fault, f"in other frames {fault!r} is called {said!r}"
