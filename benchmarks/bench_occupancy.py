"""Times of the occupancy stage, as ratios: `python benchmarks/bench_occupancy.py [KITTI_ROOT]`.

With a KITTI root, on a real scan of drive 0013; without, on a made-up scan of the same size.
"""

import sys
import timeit
from dataclasses import replace

import numpy as np

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Cmcdot, CmcdotParams, PlanarMotion, SensorModel, scan_evidence, scan_evidence_literal
from semgrid_edu.occupancy.tracking import LIDAR_PERIOD


def a_scan() -> np.ndarray:
    """Return a scan in the grid frame, (N, 3+)."""
    if len(sys.argv) > 1:
        from semgrid_edu.datasets import KittiRawDrive

        return KittiRawDrive(sys.argv[1], "2011_09_26", "0013")[10].points_grid
    rng = np.random.default_rng(0)
    azimuth, distance = rng.uniform(-np.pi, np.pi, 120_000), rng.uniform(4, 60, 120_000)
    height = np.where(distance > 30 + 10 * np.sin(5 * azimuth), 1.0, 0.0)
    return np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth), height], axis=1).astype(np.float32)


def best(call, repeats: int) -> float:
    """Return the seconds of the fastest of some calls: the others were disturbed."""
    call()
    return min(timeit.repeat(call, number=1, repeat=repeats))


def step_time(points: np.ndarray, spec: GridSpec, particles: int) -> float:
    """Return the seconds of one whole step of a filter that has settled."""
    tracker = Cmcdot(spec, replace(CmcdotParams(), particles=particles))
    for _ in range(5):
        tracker.step(points, PlanarMotion(), LIDAR_PERIOD)
    return best(lambda: tracker.step(points, PlanarMotion(0.9, 0.01, 0.001), LIDAR_PERIOD), 30)


def main() -> None:
    points, paper, sensor = a_scan(), GridSpec.paper(), SensorModel()
    literal = best(lambda: scan_evidence_literal(points, paper, sensor), 1)
    fast = best(lambda: scan_evidence(points, paper, sensor), 20)
    print(
        f"evidence of {len(points):,} points: literal {literal:.2f} s, fast {fast * 1e3:.1f} ms, {literal / fast:.0f}x"
    )
    print("one whole step, and its share of the LIDAR's period:")
    compact, few = GridSpec.compact(), points[::4]
    cases = [
        ("paper grid, 200,000 particles", points, paper, 200_000),
        ("paper grid, 50,000 particles", points, paper, 50_000),
        ("paper grid, 200,000 particles, a quarter of the points", few, paper, 200_000),
        ("compact grid, 200,000 particles", points, compact, 200_000),
        ("compact grid, 50,000 particles", points, compact, 50_000),
    ]
    for name, scan, spec, particles in cases:
        seconds = step_time(scan, spec, particles)
        print(f"  {seconds * 1e3:5.1f} ms  {seconds / LIDAR_PERIOD:4.0%}  {name}")


if __name__ == "__main__":
    main()
