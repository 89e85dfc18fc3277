"""Which ground is least wrong: `python benchmarks/compare_ground.py [--semantickitti DIR] [--kitti DIR] [--tune]`.

Each table is a set of scans whose truth is known, each row a way to find heights above the ground; a pair "a/b" says
how many per cent of the cells of bare ground are taken for obstacles, and of the cells with obstacles, for ground.
"""

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from scipy.ndimage import grey_erosion, map_coordinates
from scipy.spatial import cKDTree

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, transform_points
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.fast import height_above_ground
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.polar import GroundParams
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.raycast import RayMesh
from semgrid_edu.workshop.simulation.sensors.rig import Lidar, Rig
from semgrid_edu.workshop.simulation.street.ground import ground_mesh
from semgrid_edu.workshop.simulation.street.plan import Wishes

Scan = tuple[np.ndarray, np.ndarray]
"""Points (N, 3) in the grid frame, and their true heights above the ground (N,), NaN where unknown; metres."""

SPEC = GridSpec.paper()
OBSTACLE = (0.3, 2.5)
BANDS = ((0, 15), (15, 30), (30, 50), (50, 72))
COARSE, DENSE = Rig(), Rig(lidar=Lidar(azimuth_min=-180, azimuth_max=180, azimuth_step=0.18))
SIDES = (("park", "park"), ("suburb", "park"), ("town", "suburb"), ("suburb", "suburb"), None, ("park", "town"))
TUNING, HELD_OUT = range(10), range(1000, 1010)
"""Seeds of the streets by which parameters were chosen, and of those by which results are reported."""
GROUND_LABELS, FIRST_THING = (40, 44, 48, 49, 60, 72), 10
"""SemanticKITTI: road, parking, sidewalk, other ground, lane marking, terrain; smaller numbers are no things."""


def flat(points: np.ndarray) -> np.ndarray:
    """Take the ground to be flat."""
    return points[:, 2]


def lowest_in_cells(points: np.ndarray, slope: float | None = None, reach: int = 80) -> np.ndarray:
    """Take the lowest return of each 1 m cell; with a slope (m/m), what lies below the cones over all of these."""
    lowest = np.full((2 * reach, 2 * reach), 1e3)
    cells = np.clip(np.floor(points[:, :2]).astype(int) + reach, 0, 2 * reach - 1)
    np.minimum.at(lowest, (cells[:, 0], cells[:, 1]), points[:, 2])
    if slope is None:
        return points[:, 2] - lowest[cells[:, 0], cells[:, 1]]
    away = np.arange(-12, 13)
    envelope = grey_erosion(lowest, structure=-slope * np.hypot(away[:, None], away))
    between = np.clip(points[:, :2].T + reach - 0.5, 0, 2 * reach - 1)
    return points[:, 2] - map_coordinates(envelope, between, order=1)


def walked(points: np.ndarray) -> np.ndarray:
    """Take the package's: walked outward, sector by sector."""
    return height_above_ground(points, GroundParams())


WAYS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "flat": flat,
    "lowest of 1 m cells": lowest_in_cells,
    "the same, slope 0.1": lambda points: lowest_in_cells(points, 0.1),
    "the same, slope 0.2": lambda points: lowest_in_cells(points, 0.2),
    "walked in sectors": walked,
}


def simulated(rig: Rig, seeds: Iterable[int]) -> list[Scan]:
    """Scan simulated streets twice each, and measure heights to their mesh of the ground by rays from above."""
    scans = []
    for seed in seeds:
        drive = SimulatedDrive(seed, 20, Wishes(styles=SIDES[seed % len(SIDES)]), rig=rig)
        ground = RayMesh.of([ground_mesh(drive.plan.road, drive.plan.start, drive.plan.end)], [0])
        for k in (3, 15):
            frame = drive.scan(k)
            world = transform_points(frame.T_world_from_lidar, frame.points[:, :3].astype(np.float64))
            above = np.ascontiguousarray(world * [1, 1, 0] + [0, 0, 60], dtype=np.float32)
            hits = ground.embree.run(above, np.tile(np.float32([0, 0, -1]), (len(above), 1)), output=1)
            height = np.where(hits["primID"] >= 0, world[:, 2] - (60 - hits["tfar"]), np.nan)
            scans.append((frame.points_grid[:, :3], height))
    return scans


def lifted(scans: list[Scan], surface: Callable[[np.ndarray], np.ndarray]) -> list[Scan]:
    """Lift scans onto a surface z(points); their heights above it stay."""
    return [(points + surface(points)[:, None] * np.float32([0, 0, 1]), height) for points, height in scans]


def with_mirrored(scans: list[Scan]) -> list[Scan]:
    """Push 3 returns in 1000 below the ground, as puddles and glass do; their truth is unknown."""
    rng = np.random.default_rng(0)
    mirrored = []
    for points, height in scans:
        bad = rng.random(len(points)) < 0.003
        depth = np.where(bad, rng.uniform(0.3, 3, len(points)), 0).astype(np.float32)
        mirrored.append((points - depth[:, None] * np.float32([0, 0, 1]), np.where(bad, np.nan, height)))
    return mirrored


def semantic_kitti(folder: Path) -> list[Scan]:
    """Read labelled scans: a thing's height is that above the labelled ground within 2 m."""
    scans = []
    for scan in sorted(folder.glob("sequences/*/velodyne/*.bin")):
        points = np.fromfile(scan, np.float32).reshape(-1, 4)[:, :3] + np.float32([0, 0, KITTI_LIDAR_HEIGHT])
        labels = np.fromfile(scan.parents[1] / "labels" / f"{scan.stem}.label", np.uint32) & 0xFFFF
        ground = np.isin(labels, GROUND_LABELS)
        away, nearest = cKDTree(points[ground, :2]).query(points[:, :2], k=8)
        height = points[:, 2] - np.median(points[ground, 2][nearest], axis=1)
        height[(away[:, 0] > 2) | (labels < FIRST_THING)] = np.nan
        height[ground] = 0
        scans.append((points, height))
    return scans


def holds(points: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return which cells hold a chosen point, (H, W) bool."""
    rows, cols, inside = SPEC.cells(points[chosen])
    cells = np.zeros(SPEC.shape, bool)
    cells[rows[inside], cols[inside]] = True
    return cells


def errors(scans: list[Scan], way: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Count by range: cells of bare ground, of them taken for obstacles, cells with obstacles, of them missed."""
    distance = np.linalg.norm(SPEC.centers(), axis=2)
    counts = np.zeros((len(BANDS), 4))
    for points, true in scans:
        found = way(points)
        said = holds(points, (found >= OBSTACLE[0]) & (found <= OBSTACLE[1]))
        bare = holds(points, np.abs(true) < 0.15) & ~holds(points, (true > OBSTACLE[0]) & (true < OBSTACLE[1]))
        thing = holds(points, (true > 0.4) & (true < 2.3))  # what is nearer to a limit may fall on either side
        for band, (near, far) in enumerate(BANDS):
            here = (distance >= near) & (distance < far)
            counts[band] += [np.sum(cells & here) for cells in (bare, bare & said, thing, thing & ~said)]
    return counts


def percent(counts: np.ndarray) -> str:
    """Return false obstacles / missed obstacles in per cent."""
    ground, false, things, missed = counts
    return f"{100 * false / max(ground, 1):.1f}/{100 * missed / max(things, 1):.1f}"


def print_table(sets: dict[str, list[Scan]]) -> None:
    """Print a row for each way and a pair for each set of scans, then the pairs by range."""
    for name, scans in sets.items():
        print(f"\n{name}, {len(scans)} scans" + " " * 4 + "all" + "".join(f"{near:>8}..{far} m" for near, far in BANDS))
        for way, function in WAYS.items():
            counts = errors(scans, function)
            print(f"  {way:22}" + "".join(f"{percent(c):>13}" for c in [counts.sum(axis=0), *counts]))


def print_road_ahead(root: Path) -> None:
    """Print how many cells of the free road ahead on drive 0013 are taken for obstacles, a scan."""
    drive = KittiRawDrive(root, "2011_09_26", "0013")
    x, y = np.moveaxis(SPEC.centers(), -1, 0)
    road = (x > 5) & (x < 60) & (np.abs(y) < 1.8)
    slope = (x > 5) & (x < 20) & (y > 3) & (y < 9)
    print(f"\ndrive 0013, {len(drive)} scans: cells a scan taken for obstacles    road ahead    grass slope")
    for way, function in WAYS.items():
        said = []
        for frame in drive:
            found = function(frame.points_grid[:, :3])
            said.append(holds(frame.points_grid, (found >= OBSTACLE[0]) & (found <= OBSTACLE[1])))
        print(f"  {way:60}" + "".join(f"{np.mean([np.sum(s & area) for s in said]):14.1f}" for area in (road, slope)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0])
    parser.add_argument("--semantickitti", type=Path, help="folder that holds sequences/")
    parser.add_argument("--kitti", type=Path, help="folder that holds 2011_09_26/")
    parser.add_argument("--tune", action="store_true", help="the streets by which parameters were chosen")
    given = parser.parse_args()
    seeds = TUNING if given.tune else HELD_OUT
    dense = simulated(DENSE, seeds)
    sets = {
        "simulated, HDL-64E": dense,
        "simulated, 0.9 degree columns": simulated(COARSE, seeds),
        "tilted by 0.9 and 0.6 degrees": lifted(dense, lambda p: 0.015 * p[:, 0] + 0.01 * p[:, 1]),
        "in a dip of radius 1 km": lifted(dense, lambda p: p[:, 0] ** 2 / 2000),
        "on a crest of radius 1 km": lifted(dense, lambda p: -(p[:, 0] ** 2) / 2000),
        "3 in 1000 returns below ground": with_mirrored(dense),
    }
    if given.semantickitti:
        sets["SemanticKITTI"] = semantic_kitti(given.semantickitti)
    print_table(sets)
    if given.kitti:
        print_road_ahead(given.kitti)


if __name__ == "__main__":
    main()
