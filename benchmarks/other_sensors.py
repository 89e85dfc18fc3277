"""What to expect of a LIDAR in rain, and of one with 32 or 16 beams: `python benchmarks/other_sensors.py --out FILE`.

*Rain.* Returns are scattered within 15 m of the LIDAR into each scan of the shipped simulated drive; counted are the
cells that are FREE without them and STATIC with them. *Beams.* KITTI's scanner, with all of its 64 lasers, every second
or every fourth, looks along flat ground, or ground that rises by 10 % from 10 m on, with cars and poles on it: counted
are the cells of bare ground whose evidence says obstacle, and which cars and poles have a cell that says so.

Everything is counted twice: with all returns, and without those that are alone (`alone`), which a filter might trust
less.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.fast import track_drive
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import SensorModel, State, scan_evidence
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.simulation.sensors.rig import KITTI_ELEVATIONS, Lidar

SPEC = GridSpec.compact()
SEED = 0
DROPS = (30, 150, 600)
RAIN_REACH = 15.0
BEAMS = {64: 1, 32: 2, 16: 4}
SLOPES = (0.0, 0.1)
RISE_FROM = 10.0
PLACES = (10, 20, 30, 40, 50, 60)
"""Metres ahead: there is a car on the right and a pole, 0.1 m wide, on the left."""

CAR = (4.2, 1.8, 1.5)
POLE = (0.1, 0.1, 3.0)
NEIGHBOUR = 0.5
"""Metres to the nearest neighbour up to which a return isn't alone; further away, the spacing of columns and beams."""

SPACING = np.radians(1.8)


def alone(points: np.ndarray) -> np.ndarray:
    """Return which points (N, 3+) have no neighbour within `NEIGHBOUR`, nor in the neighbouring beams and columns."""
    distance, _ = KDTree(points[:, :3]).query(points[:, :3], k=2)
    return distance[:, 1] > np.maximum(NEIGHBOUR, SPACING * np.hypot(points[:, 0], points[:, 1]))


def rain(frame: Frame, drops: int, rng: np.random.Generator) -> Frame:
    """Add returns at random places within `RAIN_REACH`, from 0.3 to 2.5 m above the ground, weak ones."""
    direction = rng.uniform(-np.pi / 2, np.pi / 2, drops)
    distance = RAIN_REACH * np.sqrt(rng.random(drops))
    height = rng.uniform(0.3, 2.5, drops) - frame.camera.lidar_height
    scattered = np.column_stack(
        [distance * np.cos(direction), distance * np.sin(direction), height, np.full(drops, 0.05)]
    )
    return replace(frame, points=np.concatenate([frame.points, scattered.astype(np.float32)]))


def without_alone(frame: Frame) -> Frame:
    return replace(frame, points=frame.points[~alone(frame.points)])


def free_called_static(drops: int, keep: Callable[[Frame], Frame]) -> float:
    """Return the share of the dry filter's FREE cells within `RAIN_REACH` that are STATIC in rain, from frame 5 on."""
    drive = sample_drive()
    rng = np.random.default_rng(SEED)
    wet = [keep(rain(frame, drops, rng)) for frame in drive]
    near = SPEC.distances() < RAIN_REACH
    shares = []
    for dry, rainy in zip(track_drive(drive, SPEC, seed=SEED), track_drive(wet, SPEC, seed=SEED), strict=True):
        free = near & (dry.probability.argmax(axis=0) == State.FREE)
        shares.append((rainy.probability.argmax(axis=0)[free] == State.STATIC).mean())
    return float(np.mean(shares[5:]))


def boxes(slope: float) -> np.ndarray:
    """Return lower and upper corner of each car and pole, (B, 2, 3), metres above the foot of the LIDAR."""
    found = []
    for x in PLACES:
        ground = slope * max(x - RISE_FROM, 0.0)
        for y, (length, width, height) in ((-4.0, CAR), (4.0, POLE)):
            found.append([(x, y - width / 2, ground), (x + length, y + width / 2, ground + height)])
    return np.array(found)


def scan(beams: int, slope: float, things: np.ndarray) -> np.ndarray:
    """Return a scan (N, 4) in the grid frame: the nearest of ground and boxes along each ray, with 2 cm of noise."""
    lidar = Lidar(KITTI_ELEVATIONS[:: BEAMS[beams]], azimuth_step=0.18)
    rays = lidar.directions.astype(np.float64)
    eye = np.array([0.0, 0.0, KITTI_LIDAR_HEIGHT])
    with np.errstate(divide="ignore", invalid="ignore"):
        flat = np.where(rays[:, 2] < 0, -eye[2] / rays[:, 2], np.inf)
        falling = rays[:, 2] - slope * rays[:, 0]
        rising = np.where(falling < 0, (-eye[2] - slope * RISE_FROM) / falling, np.inf)
        distance = np.where(flat * rays[:, 0] <= RISE_FROM, flat, rising)
        for low, high in things:
            ends = np.stack([(low - eye) / rays, (high - eye) / rays])
            enter = ends.min(axis=0).max(axis=1)
            leave = ends.max(axis=0).min(axis=1)
            distance = np.where((enter < leave) & (enter > 0), np.minimum(distance, enter), distance)
    rng = np.random.default_rng(SEED)
    seen = (distance < 80) & (rng.random(len(rays)) > lidar.dropout)
    points = eye + rays[seen] * (distance[seen] + lidar.range_sigma * rng.standard_normal(seen.sum()))[:, None]
    return np.column_stack([points, np.full(len(points), 0.3)]).astype(np.float32)


def on_the_road(beams: int, slope: float, drop_alone: bool) -> dict[str, object]:
    """Count bare ground called obstacle, and the cars and poles that are found."""
    things = boxes(slope)
    points = scan(beams, slope, things)
    if drop_alone:
        points = points[~alone(points)]
    evidence = scan_evidence(points, SPEC, SensorModel())
    obstacle = evidence.occupied > evidence.free
    x, y = np.moveaxis(SPEC.centers(), -1, 0)
    covered = np.zeros(SPEC.shape, bool)
    found = []
    for low, high in things:
        here = (
            (x > low[0] - SPEC.cell) & (x < high[0] + SPEC.cell) & (y > low[1] - SPEC.cell) & (y < high[1] + SPEC.cell)
        )
        found.append(bool(obstacle[here].any()))
        covered |= here
    rows, cols, inside = SPEC.cells(points)
    ground = np.zeros(SPEC.shape, bool)
    ground[rows[inside], cols[inside]] = True
    ground &= ~covered
    return {
        "ground called obstacle": round(float(obstacle[ground].mean()), 4),
        "cars found up to (m)": max([p for p, ok in zip(PLACES, found[::2], strict=True) if ok], default=0),
        "cars found": sum(found[::2]),
        "poles found": sum(found[1::2]),
        "of": len(PLACES),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, type=Path, help="a JSON file")
    out = parser.parse_args().out
    ways = {"all returns": lambda frame: frame, "without those alone": without_alone}
    wet = {name: {drops: round(free_called_static(drops, keep), 4) for drops in DROPS} for name, keep in ways.items()}
    road = {
        name: {f"{beams} beams, {slope:.0%}": on_the_road(beams, slope, drop) for slope in SLOPES for beams in BEAMS}
        for name, drop in zip(ways, (False, True), strict=True)
    }
    result = {"rain: FREE cells called STATIC, by returns": wet, "beams and slope": road, "seed": SEED}
    write_json(out, result | made_by(f"python benchmarks/other_sensors.py --out {out.name}", "numpy", "scipy", "numba"))


if __name__ == "__main__":
    main()
