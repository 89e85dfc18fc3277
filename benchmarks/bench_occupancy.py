"""Time the occupancy filter, whole, in parts and as it grows: `python benchmarks/bench_occupancy.py [KITTI_ROOT]`.

With a KITTI root, on the real scans of drive 0013, along with the vehicle's own motion; without, on made-up scans
of the same size. First what a user waits for: the wall-clock time of every step of several drives, each from its first
scan on, with a median and what nine in ten steps stay below; then the same for the book's filter. A compiled step
computes the evidence of its scan beside its prediction, so with a second core it takes less time than its parts do
together. All other numbers are compared with each other, so they are processor time, of both cores: of each scan the
fastest of several passes, because a busy machine only slows; then the median of the scans.
"""

import sys
import time
import timeit
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu import fast, occupancy
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.fast.occupancy import cmcdot, sensor
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Bof, BofParams, CmcdotParams, PlanarMotion, SensorModel, VelocityLattice
from semgrid_edu.occupancy.cmcdot import LIDAR_PERIOD

Drive = list[tuple[NDArray, PlanarMotion]]
WHOLE = "whole step"
PARTS = {
    (sensor, "prepare_scan"): "ground",
    (sensor, "polar_profile"): "evidence",
    (sensor.Scan, "evidence"): "evidence",
    (cmcdot, "move"): "move",
    (cmcdot, "predict"): "predict",
    (cmcdot, "update"): "update",
    (cmcdot, "resample"): "resample",
    (cmcdot, "velocity_moments"): "belief",
    (cmcdot, "local_belief"): "belief",
}
"""The functions that a compiled step calls, each by the module or class that holds it, and the part it counts to."""


def real_drive(root: str) -> Drive:
    """Return the scans of drive 0013 in the grid frame, each with the motion since the last."""
    drive = KittiRawDrive(root, "2011_09_26", "0013")
    frames = [drive[k] for k in range(len(drive))]
    pairs = zip(frames[:1] + frames, frames, strict=False)
    motions = [PlanarMotion.from_poses(a.T_world_from_lidar, b.T_world_from_lidar) for a, b in pairs]
    return [(frame.points_grid, motion) for frame, motion in zip(frames, motions, strict=True)]


def made_up_drive(scans: int = 20, points: int = 120_000) -> Drive:
    """Return scans of a wavy wall around a plain."""
    rng = np.random.default_rng(0)
    drive = []
    for _ in range(scans):
        azimuth = rng.uniform(-np.pi, np.pi, points)
        distance = rng.uniform(4, 60, points)
        height = np.where(distance > 30 + 10 * np.sin(5 * azimuth), 1.0, 0.0)
        scan = np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth), height], axis=1)
        drive.append((scan.astype(np.float32), PlanarMotion(0.9, 0.01, 0.003)))
    return drive


def waiting_times(
    drive: Drive, spec: GridSpec, passes: int = 9, filter_class: type = fast.Cmcdot
) -> NDArray[np.float64]:
    """Return the milliseconds by the clock of every step of several drives, (passes, scans), after one to warm up."""
    rows = []
    for _ in range(1 + passes):
        tracker = filter_class(spec)
        clock = [time.perf_counter()]
        for points, motion in drive:
            tracker.step(points, motion, LIDAR_PERIOD)
            clock.append(time.perf_counter())
        rows.append(np.diff(clock))
    return 1e3 * np.array(rows[1:])


def step_times(drive: Drive, spec: GridSpec, particles: int, passes: int = 9) -> dict[str, float]:
    """Return the milliseconds of a whole step and of its parts, medians over the drive after a pass to warm up."""
    tracker = fast.Cmcdot(spec, replace(CmcdotParams(), n_particles=particles))
    spent = defaultdict(float)
    rows = []
    with stopwatches(spent, time.thread_time):
        for points, motion in drive * passes:
            spent.clear()
            stopwatch(tracker.step, WHOLE, spent, time.process_time)(points, motion, LIDAR_PERIOD)
            rows.append([spent[name] for name in (WHOLE, *dict.fromkeys(PARTS.values()))])
    fastest = np.reshape(rows, (passes, len(drive), -1))[1:].min(axis=0)
    return dict(zip((WHOLE, *dict.fromkeys(PARTS.values())), 1e3 * np.median(fastest, axis=0), strict=True))


@contextmanager
def stopwatches(spent: dict[str, float], clock: Callable[[], float]) -> Iterator[None]:
    """Time the parts of every step that is made inside, adding up the seconds of each."""
    originals = {place: getattr(*place) for place in PARTS}
    for place, part in PARTS.items():
        setattr(*place, stopwatch(originals[place], part, spent, clock))
    try:
        yield
    finally:
        for place, original in originals.items():
            setattr(*place, original)


def stopwatch(function: Callable, part: str, spent: dict[str, float], clock: Callable[[], float]) -> Callable:
    """Return the function, that then adds the seconds it takes to a part's."""

    def timed(*arguments):
        start = clock()
        result = function(*arguments)
        spent[part] += clock() - start
        return result

    return timed


def best_of(call: Callable, repeats: int) -> float:
    """Return the milliseconds of the fastest of some calls, after one that doesn't count."""
    call()
    return 1e3 * min(timeit.repeat(call, number=1, repeat=repeats))


def print_parts(times: dict[str, float]) -> None:
    """Print what a step spends on what, and its share of the time between scans."""
    for name, milliseconds in times.items():
        print(f"  {name:12} {milliseconds:6.1f} ms  {milliseconds / times[WHOLE]:4.0%} of the step", end="")
        print(f"  {milliseconds / 1e3 / LIDAR_PERIOD:4.0%} of the LIDAR's period" if name == WHOLE else "")


def print_growth(drive: Drive, base: float) -> None:
    """Print how long a step takes with more and fewer points, cells and particles, beside the same at full size."""
    rng = np.random.default_rng(0)
    paper = GridSpec.paper()
    usual = CmcdotParams().n_particles
    twice = [(np.concatenate([p, p + rng.normal(0, 0.02, p.shape).astype(p.dtype)]), m) for p, m in drive]
    finer = GridSpec(paper.x_min, paper.x_max, paper.y_min, paper.y_max, paper.cell / 2)
    coarser = replace(finer, y_min=-15.6, y_max=15.6, x_max=71.2, cell=2 * paper.cell)
    cases = [
        ("points x 1/4", [(points[::4], motion) for points, motion in drive], paper, usual),
        ("points x 1/2", [(points[::2], motion) for points, motion in drive], paper, usual),
        ("points x 2", twice, paper, usual),
        ("cells x 1/4", drive, coarser, usual),
        ("cells x 4", drive, finer, usual),
        ("particles x 1/4", drive, paper, usual // 4),
        ("particles x 1/2", drive, paper, usual // 2),
        ("particles x 2", drive, paper, usual * 2),
    ]
    for name, scans, spec, particles in cases:
        milliseconds = step_times(scans, spec, particles, passes=5)[WHOLE]
        print(f"  {name:16} {milliseconds:6.1f} ms  time x {milliseconds / base:.2f}")


def print_lattices(drive: Drive, base: float) -> None:
    """Print how long a step of the BOF takes, the exact filter, with more and fewer velocities."""
    for spacing in (4.0, 2.0, 1.0):
        lattice = VelocityLattice(spacing=spacing)
        rows = []
        tracker = Bof(GridSpec.paper(), BofParams(lattice))
        for points, motion in drive * 3:
            start = time.process_time()
            tracker.step(points, motion, LIDAR_PERIOD)
            rows.append(time.process_time() - start)
        milliseconds = 1e3 * np.median(np.reshape(rows, (3, -1)).min(axis=0))
        print(f"  {len(lattice):3} velocities   {milliseconds:6.1f} ms  time x {milliseconds / base:.2f}")


def main() -> None:
    drive = real_drive(sys.argv[1]) if len(sys.argv) > 1 else made_up_drive()
    points = drive[len(drive) // 2][0]
    paper = GridSpec.paper()
    model = SensorModel()
    size = f"grid {paper.shape}, {CmcdotParams().n_particles:,} particles"
    print(f"{len(drive)} scans of about {len(points):,} points; {size}")
    waits = waiting_times(drive, paper)
    print(f"every compiled step of {len(waits)} drives, by the clock: median {np.median(waits):.1f} ms, ", end="")
    print(f"nine in ten below {np.quantile(waits, 0.9):.1f} ms, the slowest {waits.max():.1f} ms")
    for name, spec in {"compact": GridSpec.compact(), "paper": paper}.items():
        book = np.median(waiting_times(drive[:12], spec, 2, occupancy.Cmcdot))
        compiled = np.median(waiting_times(drive[:12], spec, 2))
        print(f"a step by the book / compiled, {name} grid: {book:.0f} ms / {compiled:.0f} ms = {book / compiled:.1f}")
    book = best_of(lambda: occupancy.scan_evidence(points, paper, model), 5)
    compiled = best_of(lambda: fast.scan_evidence(points, paper, model), 20)
    print(f"evidence by the book / compiled: {book:.0f} ms / {compiled:.1f} ms = {book / compiled:.0f}")
    times = step_times(drive, paper, CmcdotParams().n_particles)
    print("one step in its parts, processor time:")
    print_parts(times)
    print("as one thing grows and the others stay:")
    print_growth(drive, times[WHOLE])
    print("the BOF on the same grid, against CMCDOT's step:")
    print_lattices(drive[:8], times[WHOLE])


if __name__ == "__main__":
    main()
