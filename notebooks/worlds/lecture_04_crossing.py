"""The streets of lecture 04, simulated and real, and how much of what moves there is called DYNAMIC."""

import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.fast import Cmcdot, SensorModel
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import Belief, CmcdotParams, FilterState, Particles, PlanarMotion, State
from worlds.lecture_02_boxes import Box, cells_in, scan_boxes
from worlds.lecture_04_scenes import hit_cells

SPEC = GridSpec(x_min=0, x_max=40, y_min=-12, y_max=12, cell=0.5)
PARAMS = CmcdotParams(sensor=SensorModel(), n_particles=30_000)
"""The default filter, with particles enough for this small map, and the fast twin of its sensor model."""
WALL, PARKED = Box(5, 60, 7.0, 7.5, 2.5), Box.around(22, -6, 4, 1.8, 1.5)
CAR, PERSON = 2, 3
"""Their places in the list of `crossing`."""


class Seen(NamedTuple):
    """One scan and what the filter believes after it: time in seconds, x of the vehicle in metres."""

    time: float
    x: float
    points: NDArray
    belief: Belief


def street(t: float) -> list[Box]:
    """Return a wall, a parked car and a car that comes towards us at 8 m/s."""
    return [WALL, PARKED, Box.around(38 - 8 * t, 3, 4, 1.8, 1.5)]


def crossing(t: float) -> list[Box]:
    """Return a wall, a parked car, a car that comes towards us at 8 m/s, and a person who crosses at 1.4 m/s."""
    return [WALL, PARKED, Box.around(34 - 8 * t, 3, 4, 1.8, 1.5), Box.around(11, -4 + 1.4 * t, 0.5, 0.5, 1.75)]


def hurrying(t: float) -> list[Box]:
    """Return `crossing` with a person who runs at 3 m/s."""
    return [*crossing(t)[:PERSON], Box.around(11, -6 + 3 * t, 0.5, 0.5, 1.75)]


def watch(
    scene: Callable[[float], list[Box]],
    seconds: float,
    speed: float = 0.0,
    params: CmcdotParams = PARAMS,
    seed: int = 0,
) -> Iterator[Seen]:
    """Drive along boxes with ten scans a second, and yield what the filter believes after each.

    Parameters
    ----------
    scene : callable
        Returns the boxes at a time in seconds.
    seconds, speed : float
        How long, and how fast the vehicle drives, m/s.
    params, seed : CmcdotParams, int
        The filter, and the seed of its particles and of the scans' noise.
    """
    tracker, rng = Cmcdot(SPEC, params, seed=seed), np.random.default_rng(seed)
    for k in range(round(seconds * 10)):
        t, x = k / 10, speed * k / 10
        points = scan_boxes(scene(t), x=x, columns=450, noise=0.02, rng=rng)
        yield Seen(t, x, points, tracker.step(points, PlanarMotion(dx=0.1 * speed if k else 0.0), 0.1))


def called_moving(run: Sequence[Seen], box_of: Callable[[float], Box], since: float) -> float:
    """Return the share of a thing's hit cells that are more DYNAMIC than STATIC since a time, per cent."""
    moving = []
    for seen in run:
        if seen.time >= since:
            cells = cells_in(box_of(seen.time), SPEC, seen.x, margin=0.3) & hit_cells(seen.points, SPEC)
            p = seen.belief.probability[:, cells]
            moving.append(p[State.DYNAMIC] > p[State.STATIC])
    return 100 * float(np.concatenate(moving).mean())


def measure_luck(
    number: int, seeds: Sequence[int], scene: Callable[[float], list[Box]] = crossing
) -> NDArray[np.float64]:
    """Return how much of the car and of the person of a scene is called DYNAMIC, (seeds, 2) per cent.

    Over the last of 2.5 s, with `number` particles.
    """
    found = []
    for seed in seeds:
        run = list(watch(scene, 2.5, params=replace(PARAMS, n_particles=number), seed=seed))
        found.append([called_moving(run, lambda t, k=k: scene(t)[k], since=1.5) for k in (CAR, PERSON)])
    return np.array(found)


def luck() -> dict[int, NDArray[np.float64]]:
    """Return the measured shares, (24 seeds, 2: car and person) per cent, by number of particles."""
    table = _measured()
    return {
        number: np.array([table[f"{number}"]["car"], table[f"{number}"]["person"]]).T for number in (300, 3000, 30_000)
    }


def luck_of_who_runs() -> NDArray[np.float64]:
    """Return the measured shares of the person of `hurrying` with 3,000 particles, (24 seeds,) per cent."""
    return np.array(_measured()["3000"]["running"])


def _measured() -> dict:
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def on_a_line(
    x: NDArray, v: NDArray, weight: NDArray, fence: int, b_s: float = 0.5
) -> tuple[GridSpec, CmcdotParams, FilterState]:
    """Return six cells of 1 m ahead of us, a filter in which nothing changes but motion, and what it believes.

    Parameters
    ----------
    x, v, weight : (N,) float
        Places in metres, velocities in m/s and weights of the particles.
    fence, b_s : int, float
        The cell that may hold a fence, and the probability that it does. All else is FREE.
    """
    line = GridSpec(x_min=0, x_max=6, y_min=0, y_max=1, cell=1)
    calm = CmcdotParams(rates=((0.0,) * 4,) * 4, stop_rate=0.0, max_acceleration=0.0, walls=None)
    b = np.zeros((4, 6))
    b[State.DYNAMIC] = np.bincount(x.astype(int), weight, minlength=6)
    b[State.STATIC, fence] = b_s
    b[State.FREE] = 1 - b.sum(axis=0)
    position, velocity = np.column_stack([x, np.full(len(x), 0.5)]), np.column_stack([v, np.zeros(len(v))])
    particles = Particles(position, velocity.astype(float), weight)
    return line, calm, FilterState(b[:, ::-1, None], particles, np.zeros(line.shape))


def road_held(spec: GridSpec, frame: Frame, log_odds: NDArray, bof: Belief, cmcdot: Belief) -> dict[str, float]:
    """Return which share of the free road in the lane of the oncoming cars each filter holds occupied."""
    x, y = np.moveaxis(spec.centers(), -1, 0)
    road = grid_truth(frame.labels, cmcdot.probability, spec) == KITTI_14.names.index("road")
    road &= (y > 4.5) & (y < 8.5) & (x < 40)
    occupied = {"log-odds grid": log_odds > 0.5}
    for name, belief in (("BOF", bof), ("CMCDOT", cmcdot)):
        occupied[name] = belief.probability[State.STATIC] + belief.probability[State.DYNAMIC] > 0.5
    return {name: float(cells[road].mean()) for name, cells in occupied.items()}


def dynamic_shares(
    spec: GridSpec, frames: Sequence[Frame], beliefs: Sequence[Belief], part: str
) -> NDArray[np.float64]:
    """Return the share of the hit cells of a part of the real street that are DYNAMIC, scan by scan, per cent."""
    x, y = np.moveaxis(spec.centers(), -1, 0)
    parts = {"lane E": (y > 6.5) & (y < 11), "the car F": (x > 9) & (x < 20) & (np.abs(y) < 1.5), "right of us": y < -2}
    shares = []
    for frame, belief in zip(frames, beliefs, strict=True):
        cells = hit_cells(frame.points_grid, spec) & parts[part]
        shares.append(100 * (belief.probability[State.DYNAMIC] > belief.probability[State.STATIC])[cells].mean())
    return np.array(shares)


def speed_ahead(frames: Sequence[Frame]) -> float:
    """Return the mean speed of the car F ahead of us, m/s, from the places of its rear in the first and last scan."""
    rear = []
    for frame in (frames[0], frames[-1]):
        points = frame.points_grid[(np.abs(frame.points_grid[:, 1]) < 1) & (frame.points_grid[:, 2] > 0.4)]
        rear.append(np.percentile(points[(points[:, 0] > 3) & (points[:, 2] < 2), 0], 2))
    return float((rear[1] - rear[0]) / (frames[-1].time - frames[0].time))


def mean_dynamic(
    scene: Callable[[float], list[Box]], thing: int, seconds: float, params: CmcdotParams = PARAMS, seed: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the times of the scans, and the mean P(DYNAMIC) over the hit cells of a thing; NaN while it isn't seen."""
    times, means = [], []
    for seen in watch(scene, seconds, params=params, seed=seed):
        cells = cells_in(scene(seen.time)[thing], SPEC, seen.x, margin=0.3) & hit_cells(seen.points, SPEC)
        times.append(seen.time)
        means.append(seen.belief.probability[State.DYNAMIC, cells].mean() if cells.any() else np.nan)
    return np.array(times), np.array(means)
