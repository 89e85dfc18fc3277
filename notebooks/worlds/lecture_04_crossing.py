"""The streets of lecture 04, simulated and real, and how much of what moves there is called DYNAMIC."""

import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from semgrid_edu import occupancy
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.fast import Cmcdot, SensorModel
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import Belief, CmcdotParams, FilterState, Particles, PlanarMotion, State
from worlds.lecture_02_boxes import Box, cells_in, scan_boxes
from worlds.lecture_04_scenes import hit_cells
from worlds.lecture_04_street_scores import StreetScores
from worlds.lecture_04_suspects import Suspect, counts, run_filter, scenes_of

SPEC = GridSpec(x_min=0, x_max=40, y_min=-12, y_max=12, cell=0.5)
PARAMS = CmcdotParams(sensor=SensorModel(), n_particles=30_000)
"""The default filter, with particles enough for this small map, and the fast twin of its sensor model."""
WALL, PARKED = Box(5, 60, 7.0, 7.5, 2.5), Box.around(22, -6, 4, 1.8, 1.5)
CAR, PERSON = 2, 3
"""Their places in the list of `crossing`."""

EVEN = (0.952, 0.024, 0.024)
"""Odds of first sight at which STATIC and DYNAMIC are equally probable."""
_MOVES_FIRST = {"first_sight": (0.952, 0.003, 0.045)}
_RESTS = {"max_speed": 0.0, "max_acceleration": 0.0, "stop_rate": 0.0}
ARRIVALS = {
    "as it is": {},
    "nothing arrives": {},
    "15:1 for DYNAMIC": _MOVES_FIRST,
    "15:1 for DYNAMIC, nothing stops": _MOVES_FIRST | {"stop_rate": 0.0},
    "15:1 for DYNAMIC, nothing stops or arrives": _MOVES_FIRST | {"stop_rate": 0.0},
    "15:1 for DYNAMIC, nothing stops or flies": _MOVES_FIRST | _RESTS,
}
"""What is changed to find out what tells STATIC from DYNAMIC: the odds of first sight, stopping, arriving, flying."""
DRIVES_AWAY = {
    "as it is": {},
    "without the rule": {"walls": None},
    "even odds at first sight": {"first_sight": EVEN},
    "both": {"walls": None, "first_sight": EVEN},
}
"""What is switched off to find out why the car F isn't DYNAMIC."""
KNOWN_FREE = "F's way known to be free"
"""The control: nothing is switched off, but the filter begins with the cells ahead of F's rear as FREE."""
WIDE = GridSpec(x_min=0, x_max=40, y_min=-12, y_max=16, cell=0.5)
BORDERS = (("mesh", 0), ("mesh", 1), ("mesh", 2), ("walls", 0), ("walls", 1), ("hedge", 0))
"""Simulated drives along fences, walls and hedges: the street and the seed of each."""


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


def large(t: float) -> list[Box]:
    """Return `crossing` with a walker four times as large across its way. Along its way it is what it was."""
    return [*crossing(t)[:PERSON], Box.around(11, -4 + 1.4 * t, 2.0, 0.5, 1.75)]


def parked(t: float) -> list[Box]:
    """Return `crossing` with a car that stands where it was at first."""
    return [*crossing(t)[:CAR], crossing(0)[CAR], crossing(t)[PERSON]]


ONE_CHANGE = {
    "the walker, large": (large, PERSON),
    "the walker, running": (hurrying, PERSON),
    "the walker, the car parked": (parked, PERSON),
}
"""What is changed, one thing at a time, to find out why the walker is missed: the scene, and the place in its list."""


def watch(
    scene: Callable[[float], list[Box]],
    seconds: float,
    speed: float = 0.0,
    params: CmcdotParams = PARAMS,
    seed: int = 0,
    kind: type[occupancy.Cmcdot] = Cmcdot,
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
    kind : type
        The compiled filter, or the package's.
    """
    tracker = kind(SPEC, params, seed=seed)
    rng = np.random.default_rng(seed)
    for k in range(round(seconds * 10)):
        t = k / 10
        x = speed * k / 10
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


def measure_arrivals(seeds: Sequence[int]) -> dict[str, NDArray[np.float64]]:
    """Return how much of wall, parked car and coming car of `street` is called DYNAMIC, (seeds, 3) per cent.

    From 0.5 s to 1.5 s, while we drive 5 m/s, for each filter of `ARRIVALS`.
    """
    found = {}
    for name, changed in ARRIVALS.items():
        params = replace(PARAMS, **changed)
        if "arrives" in name:
            with patch("semgrid_edu.occupancy.steps.collide", _only_leave):
                runs = [list(watch(street, 1.5, 5.0, params, seed, occupancy.Cmcdot)) for seed in seeds]
        else:
            runs = [list(watch(street, 1.5, 5.0, params, seed)) for seed in seeds]
        found[name] = np.array(
            [[called_moving(run, lambda t, k=k: street(t)[k], since=0.5) for k in range(3)] for run in runs]
        )
    return found


def _only_leave(
    mixed: NDArray,
    newborn: NDArray,
    particles: Particles,
    start: NDArray,
    end: NDArray,
    vacated: NDArray,
    blocked: NDArray,
) -> FilterState:
    """Stand in for `occupancy.steps.collide`: what leaves a cell makes it FREE, and arrives nowhere."""
    weight = particles.weight * (end == start)
    probability = mixed.copy()
    probability[State.FREE] += vacated
    probability[State.DYNAMIC] = newborn + occupancy.steps.weight_in_cells(weight, end, newborn.shape)
    return FilterState(probability, replace(particles, weight=weight), newborn)


def measure_drives_away(frames: Sequence[Frame], seeds: Sequence[int]) -> dict[str, NDArray[np.float64]]:
    """Return the share of the cells of the car F that are DYNAMIC after each scan, (seeds, scans) per cent.

    For each filter of `DRIVES_AWAY`, and for the control `KNOWN_FREE`.
    """
    filters = DRIVES_AWAY | {KNOWN_FREE: {}}
    found = {name: [] for name in filters}
    for name, changed in filters.items():
        for seed in seeds:
            tracker = Cmcdot(WIDE, CmcdotParams(sensor=SensorModel(), **changed), seed=seed)
            if name == KNOWN_FREE:
                tracker._state = _free_ahead(tracker.map_spec)
            beliefs = []
            for before, now in pairwise([frames[0], *frames]):
                motion = PlanarMotion.from_poses(before.T_world_from_lidar, now.T_world_from_lidar)
                beliefs.append(tracker.step(now.points_grid, motion, now.time - before.time or 0.1))
            found[name].append(dynamic_shares(WIDE, frames, beliefs, "the car F"))
    return {name: np.array(shares) for name, shares in found.items()}


def _free_ahead(spec: GridSpec) -> FilterState:
    """Return a state that knows nothing but that the 12 m ahead of F's rear, in its lane, are FREE."""
    x, y = np.moveaxis(spec.centers(), -1, 0)
    way = (x > 10.5) & (x < 22) & (np.abs(y) < 1.75)
    state = FilterState.unknown(spec)
    probability = np.where(way, np.eye(4)[State.FREE][:, None, None], state.probability)
    return replace(state, probability=probability.astype(np.float32))


def measure_borders(drives: Sequence[tuple[str, int]] = BORDERS) -> dict[str, NDArray[np.float64]]:
    """Return how much of what stands at the border of simulated streets is called DYNAMIC, (drives,) per cent.

    For each filter of `DRIVES_AWAY`. A drive takes half a minute.
    """
    spec = GridSpec.compact()
    found = {name: [] for name in DRIVES_AWAY}
    for street_name, number in drives:
        drive, scenes = scenes_of(street_name, number, spec, Suspect())
        for name, changed in DRIVES_AWAY.items():
            scores = StreetScores(spec)
            run_filter(drive, scenes, Suspect(params=CmcdotParams(**changed)), scores)
            cells, called = counts(scores)["scenery"]
            found[name].append(100 * called / cells)
    return {name: np.array(shares) for name, shares in found.items()}


def arrivals() -> dict[str, NDArray[np.float64]]:
    """Return what `measure_arrivals` found, (8 seeds, 3: wall, parked car, coming car) per cent, by filter."""
    return {
        name: np.array([shares[thing] for thing in ("wall", "parked", "coming")]).T
        for name, shares in _measured()["arrivals"].items()
    }


def drives_away() -> dict[str, NDArray[np.float64]]:
    """Return what `measure_drives_away` found, the mean of 12 seeds after each of ten scans, per cent, by filter."""
    return {name: np.array(shares) for name, shares in _measured()["drives away"].items()}


def borders() -> dict[str, NDArray[np.float64]]:
    """Return what `measure_borders` found, (6 drives,) per cent, by filter."""
    return {name: np.array(shares) for name, shares in _measured()["borders"].items()}


def luck() -> dict[int, NDArray[np.float64]]:
    """Return the measured shares, (24 seeds, 2: car and person) per cent, by number of particles."""
    table = _measured()
    return {
        number: np.array([table[f"{number}"]["car"], table[f"{number}"]["person"]]).T for number in (300, 3000, 30_000)
    }


def luck_of_one_change() -> dict[str, NDArray[np.float64]]:
    """Return the measured shares of the thing that `ONE_CHANGE` changes, with 3,000 particles, (24 seeds,) per cent."""
    return {name: np.array(_measured()["3000"][name]) for name in ONE_CHANGE}


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
    calm = CmcdotParams(rates=((0.0,) * 4,) * 4, max_acceleration=0.0, walls=None)
    b = np.zeros((4, 6))
    b[State.DYNAMIC] = np.bincount(x.astype(int), weight, minlength=6)
    b[State.STATIC, fence] = b_s
    b[State.FREE] = 1 - b.sum(axis=0)
    position = np.column_stack([x, np.full(len(x), 0.5)])
    velocity = np.column_stack([v, np.zeros(len(v))])
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
    times = []
    means = []
    for seen in watch(scene, seconds, params=params, seed=seed):
        cells = cells_in(scene(seen.time)[thing], SPEC, seen.x, margin=0.3) & hit_cells(seen.points, SPEC)
        times.append(seen.time)
        means.append(seen.belief.probability[State.DYNAMIC, cells].mean() if cells.any() else np.nan)
    return np.array(times), np.array(means)
