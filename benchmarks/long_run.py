"""Run filter and memory of classes along a made-up drive, twice: `python benchmarks/long_run.py [--steps 10000]`.

Prints what each stretch found: cells that don't sum to 1, memory, and whether the second run gave the same bits.
"""

import argparse
import hashlib
import math
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from time import process_time

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import Cmcdot
from semgrid_edu.grid import GridSpec
from semgrid_edu.memory import ClassMemory, MemoryParams
from semgrid_edu.occupancy import Belief, CmcdotParams, PlanarMotion
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import versions

sys.path.append(str(Path(__file__).resolve().parents[1] / "notebooks"))

from worlds.lecture_02_boxes import Box, scan_boxes

RADIUS, SPEED = 25.0, 5.0
"""Of the circle on which the vehicle drives, metres, and how fast, m/s: one lap takes half a minute."""
LAP = 2 * np.pi * RADIUS / SPEED
STANDING = [
    Box.around(RADIUS * np.sin(angle) * far, RADIUS - RADIUS * np.cos(angle) * far, size, size, height)
    for count, far, size, height in ((12, 1.45, 6.0, 5.0), (9, 1.25, 1.8, 1.5), (7, 0.8, 0.4, 2.5))
    for angle in 2 * np.pi / count * np.arange(count)
]
"""Houses and parked cars outside the circle, posts inside."""


@dataclass(frozen=True)
class Checkpoint:
    """What was found since the last one.

    Parameters
    ----------
    step : int
        Steps done.
    worst_sum : float
        Largest distance of a cell's four probabilities from summing to 1; NaN if a cell held one.
    lowest : float
        Smallest probability of all.
    worst_class_sum : float
        Largest distance of a cell's class probabilities, with memory, from summing to 1.
    class_milliseconds : float
        Mean processor time of a step of the memory of classes.
    velocities : int
        Cells that had a velocity in the last step.
    memory : float
        Resident memory of the process, MB; NaN where the system doesn't tell.
    digest : str
        SHA-256 of all beliefs and remembered classes since the start.
    """

    step: int
    worst_sum: float
    lowest: float
    worst_class_sum: float
    class_milliseconds: float
    velocities: int
    memory: float
    digest: str


def long_run(
    steps: int, every: int, spec: GridSpec, params: CmcdotParams | None = None, seed: int = 0
) -> Iterator[Checkpoint]:
    """Drive round and round through a toy world, and look at every belief.

    The scanner's period wavers by some milliseconds, as real ones do, so no lap is like another.

    Parameters
    ----------
    steps : int
        Scans.
    every : int
        Steps between checkpoints; the last comes after the last step.
    spec : GridSpec
    params : CmcdotParams, optional
    seed : int
        Decides the filter's draws, the noise of ranges and the times of scans.

    Yields
    ------
    Checkpoint

    Raises
    ------
    ArgumentError
        When there is no step, or none between checkpoints.
    """
    if min(steps, every) < 1:
        raise ArgumentError("steps, every", "at least one", f"{steps}, {every}")
    tracker = Cmcdot(spec, params, seed)
    rng = np.random.default_rng(seed)
    digest = hashlib.sha256()
    classes = ClassMemory(spec, MemoryParams(movable=(1,)))
    time = 0.0
    before = pose_at(0.0)
    worst_sum = 0.0
    lowest = 1.0
    worst_class_sum = 0.0
    spent = 0.0
    done = 0
    for step in range(1, steps + 1):
        dt = 0.1 + rng.uniform(-0.004, 0.004)
        time += dt
        pose = pose_at(time)
        points = scan_boxes(
            scene_at(time), pose.dx, pose.dy, pose.dyaw, columns=150, rings=24, field=120, noise=0.02, rng=rng
        )
        motion = PlanarMotion(*before.child_from_parent(np.array([pose.dx, pose.dy])), pose.dyaw - before.dyaw)
        belief = tracker.step(points, motion, dt)
        before = pose
        worst_sum = np.maximum(worst_sum, np.abs(belief.probability.sum(axis=0, dtype=np.float64) - 1).max())
        lowest = np.minimum(lowest, belief.probability.min())
        began = process_time()
        remembered = classes.advance(seen_ahead(belief, spec), belief, motion, dt)
        spent += process_time() - began
        worst_class_sum = np.maximum(worst_class_sum, np.abs(remembered.sum(axis=0, dtype=np.float64) - 1).max())
        _add(digest, belief, remembered)
        if step % every == 0 or step == steps:
            known = int(np.isfinite(belief.velocity[0]).sum())
            milliseconds = 1e3 * spent / (step - done)
            sums = float(worst_sum), float(lowest), float(worst_class_sum), milliseconds
            yield Checkpoint(step, *sums, known, resident_memory(), digest.hexdigest())
            worst_sum = 0.0
            lowest = 1.0
            worst_class_sum = 0.0
            spent = 0.0
            done = step


def seen_ahead(belief: Belief, spec: GridSpec) -> np.ndarray:
    """Return a semantic grid as a camera might make it: ground and things where it looks, unknown elsewhere.

    Parameters
    ----------
    belief : Belief
        What the filter believes.
    spec : GridSpec
        The grid, (H, W).

    Returns
    -------
    (6, H, W) float32
        Ground, things, and the four unknown classes.
    """
    free, static, dynamic, _ = belief.probability
    x, y = np.moveaxis(spec.centers(), -1, 0)
    looks = (x > 5) & (np.abs(y) < 0.8 * x)
    seen = looks * np.stack([free, static + dynamic])
    return np.concatenate([seen, belief.probability * (1 - seen.sum(axis=0))])


def pose_at(time: float) -> PlanarMotion:
    """Return where the vehicle is on its circle: it starts at the origin of the world, looks along x and turns left.

    Parameters
    ----------
    time : float
        Seconds.

    Returns
    -------
    PlanarMotion
        Its pose in the world.
    """
    yaw = SPEED * time / RADIUS
    return PlanarMotion(float(RADIUS * np.sin(yaw)), float(RADIUS - RADIUS * np.cos(yaw)), yaw)


def scene_at(time: float) -> list[Box]:
    """Return what stands, a car ahead on the circle, one that comes towards us outside it, and a pedestrian.

    Parameters
    ----------
    time : float
        Seconds.

    Returns
    -------
    list of Box
        In the world.
    """
    angles = 2 * np.pi * np.array([time / LAP + 0.11, 0.3 - time / LAP])
    x = np.array([1.0, 1.12]) * RADIUS * np.sin(angles)
    y = RADIUS * (1 - np.array([1.0, 1.12]) * np.cos(angles))
    cars = [Box.around(x[k], y[k], 3, 3, 1.5) for k in range(2)]
    walked = abs(1.4 * time % 24 - 12)  # to and fro inside the circle
    return [*STANDING, *cars, Box.around(RADIUS - 16 + walked, RADIUS, 0.5, 0.5, 1.75)]


def resident_memory() -> float:
    """Return the memory that this process holds now, MB; NaN where the system doesn't keep it in /proc."""
    if not (numbers := Path("/proc/self/statm")).exists():
        return math.nan
    pages = int(numbers.read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _add(digest, belief: Belief, remembered: np.ndarray) -> None:
    """Add the bits of a belief and of what is remembered to what has been digested."""
    for field in (belief.probability, belief.velocity, belief.velocity_covariance, remembered):
        digest.update(np.ascontiguousarray(field))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--grid", choices=("compact", "paper"), default="compact")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", help="a JSON file for the figures")
    arguments = parser.parse_args()
    began = datetime.now(UTC)
    first, second = (run(arguments.steps, arguments.grid, arguments.seed) for _ in range(2))
    same = [a.digest == b.digest for a, b in zip(first, second, strict=True)]
    print("bit-identical in both runs" if all(same) else f"the runs differ from checkpoint {same.index(False)} on")
    if arguments.out:
        result = {
            "checkpoints": [asdict(checkpoint) for checkpoint in first],
            "memory of second run": [round(checkpoint.memory, 1) for checkpoint in second],
            "bit-identical": all(same),
            "command": f"python benchmarks/long_run.py --steps {arguments.steps} --grid {arguments.grid}",
            "seed": arguments.seed,
            "date": f"{began:%Y-%m-%d}",
            "minutes": round((datetime.now(UTC) - began).total_seconds() / 60, 1),
            "versions": versions("numpy", "numba"),
        }
        write_json(arguments.out, result)


def run(steps: int, grid: str, seed: int) -> list[Checkpoint]:
    """Run once and print a row for each tenth."""
    print("   steps  worst |sum - 1|  lowest P  of classes  ms a step  cells with velocity  memory (MB)  s    digest")
    began = time.perf_counter()
    checkpoints = []
    for found in long_run(steps, max(1, steps // 10), getattr(GridSpec, grid)(), seed=seed):
        checkpoints.append(found)
        print(
            f"{found.step:8,}  {found.worst_sum:15.1e}  {found.lowest:8.0e}  {found.worst_class_sum:10.1e}"
            f"  {found.class_milliseconds:9.1f}  {found.velocities:19,}"
            f"  {found.memory:11.1f}  {time.perf_counter() - began:4.0f}  {found.digest[:12]}"
        )
    return checkpoints


if __name__ == "__main__":
    main()
