"""Count phantoms beside a hedge that stands 1.6 to 3 m beside the LIDAR, with beams that the vehicle's edge splits.

    python benchmarks/near_hedge.py [--drives 6] [--grid compact]

The simulator's hedges stand farther away, and its LIDAR splits no beam. So the street's right side is narrowed here,
and 60 returns without reflectance are added between the vehicle's outline and 0.65 m beside it, which stay where they
are in the vehicle's frame. They are told by `SensorModel.edge`; with an edge of 0 they are things that keep pace.
"""

import argparse
import sys
from pathlib import Path
from unittest import mock

import numpy as np

from semgrid_edu.fast import Cmcdot
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import CmcdotParams, SensorModel, State
from semgrid_edu.plotting.grids import velocity_arrows
from semgrid_edu.workshop.simulation import simulate
from semgrid_edu.workshop.simulation.street import plan

sys.path.append(str(Path(__file__).resolve().parents[1] / "notebooks"))

from worlds.lecture_04_scenes import known_scenes
from worlds.lecture_04_street_scores import LEAST_DYNAMIC

SPLIT, FAST, PERIOD, FRAMES = 60, 6.0, 0.1, 30
DRAWN = plan._side


def near_hedge(number: int):
    """Return a drive along a hedge, and how far to the right of the LIDAR its surface is, metres."""
    wanted = np.random.default_rng(number).uniform(1.6, 3.0)

    def narrow(*arguments):
        side = DRAWN(*arguments)
        return side._replace(edge=wanted - 0.35 + arguments[2] / 2, strip=0.0, walk=0.0, bank_rise=0.0)

    with mock.patch.object(plan, "_side", narrow):
        drive = simulate(number, FRAMES, "hedge")
        return drive, drive.plan.road.right.edge + 0.35 + drive.ego.trajectory.d


def with_split_beams(points: np.ndarray, rng: np.random.Generator, vehicle: tuple) -> np.ndarray:
    """Add returns that bring no light back, to the right of the vehicle's outline."""
    x = rng.uniform(0, vehicle[1], SPLIT)
    y = vehicle[2] - 0.65 * rng.random(SPLIT)
    return np.vstack([points, np.column_stack([x, y, np.ones(SPLIT), np.zeros(SPLIT)])]).astype(np.float32)


def count(spec: GridSpec, number: int, edge: float) -> tuple[float, int, int, int]:
    """Return the hedge's distance, the frames with a fast arrow, and the hedge's hit cells: called DYNAMIC, and all."""
    (drive, distance) = near_hedge(number)
    sensor = SensorModel(edge=edge)
    rng = np.random.default_rng(number)
    tracker = Cmcdot(spec, CmcdotParams(sensor=sensor))
    (x, y) = np.moveaxis(spec.centers(), -1, 0)
    arrows = called = cells = 0
    for scene in known_scenes(drive, spec, f"{number}, edge {edge}"):
        belief = tracker.step(with_split_beams(scene.frame.points_grid, rng, sensor.vehicle), scene.motion, PERIOD)
        start, velocity = velocity_arrows(spec, belief.probability, belief.velocity, belief.velocity_covariance)
        beside = (start[:, 0] <= 40) & (start[:, 1] <= sensor.vehicle[2]) & (start[:, 1] >= -15)
        arrows += bool((beside & (np.hypot(*velocity.T) >= FAST)).any())
        if scene.frame.time >= 1:
            hedge = scene.hit & (scene.truth.state == State.STATIC) & (x > 2) & (x < 40) & (y < 0.4 - distance)
            dynamic = belief.probability[State.DYNAMIC]
            called += int((hedge & (dynamic > belief.probability[State.STATIC]) & (dynamic > LEAST_DYNAMIC)).sum())
            cells += int(hedge.sum())
    return distance, arrows, called, cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=6)
    parser.add_argument("--grid", default="compact", choices=["compact", "paper"])
    arguments = parser.parse_args()
    for edge in (SensorModel().edge, 0.0):
        rows = np.array([count(getattr(GridSpec, arguments.grid)(), n, edge) for n in range(arguments.drives)])
        distances = rows[:, 0]
        (arrows, called, cells) = rows[:, 1:].sum(axis=0)
        frames = FRAMES * arguments.drives
        away = f"{distances.min():.1f} to {distances.max():.1f} m beside"
        print(
            f"{arguments.grid} grid, edge {edge} m, hedge {away}: an arrow of {FAST:g} m/s or more in {arrows:.0f} of "
            f"{frames} frames; {100 * called / cells:.2f} % of the hedge's {cells:.0f} hit cells called DYNAMIC"
        )


if __name__ == "__main__":
    main()
