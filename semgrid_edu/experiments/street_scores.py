"""Scores of an occupancy filter on test streets: what stands and is taken for moving, and what moves and isn't found."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.experiments.cell_scores import FAR, NEAR, SCENERY, SETTLED_AFTER, share
from semgrid_edu.experiments.scenes import KnownScene, hit_cells
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, State
from semgrid_edu.simulation.drive import PERIOD
from semgrid_edu.simulation.street.actors import Actor
from semgrid_edu.simulation.things.materials import Kind

LEAST_DYNAMIC = 0.3
"""What stands counts as called DYNAMIC when this is more likely than STATIC and more likely than that."""
LEAST_CELLS = 60
"""A frame with fewer hit cells of scenery isn't looked at for the worst frame."""
CARS_AFTER, OTHERS_AFTER = 0.8, 1.5
"""Times, seconds, after which something that moves in view should be found: a car; a pedestrian, and any speed."""
_AHEAD = (2.0, 40.0)
"""Cells that stand are scored between these x, metres."""
_FOUND_CELLS = 3
"""A car can be found in a frame that hits this number of its cells."""


@dataclass(eq=False)
class StreetScores:
    """Counts over the frames of a street's drives, for one filter.

    Parameters
    ----------
    spec : GridSpec
        The grid of the frames.

    Attributes
    ----------
    cells : dict of str to [int, int]
        For each group of cells their number, and the number of those called DYNAMIC; for "left", called occupied.
    frames : list of (int, int)
        For each frame from `SETTLED_AFTER` on: hit cells of scenery, and those of them called DYNAMIC.
    speed_errors : list of float
        For each car and each frame, `OTHERS_AFTER` in view: |speed of its mean velocity - its speed|, m/s.
    delays : list of float
        For each car that follows another: seconds that it is found later than the one ahead, from when it is hit itself;
        infinite if it never is.
    """

    spec: GridSpec
    cells: dict[str, list[int]] = field(default_factory=dict, init=False)
    frames: list[tuple[int, int]] = field(default_factory=list, init=False)
    speed_errors: list[float] = field(default_factory=list, init=False)
    delays: list[float] = field(default_factory=list, init=False)

    def begin(self, moving: list[Actor]) -> None:
        """Begin a drive.

        Parameters
        ----------
        moving : list of Actor
            What moves in it.
        """
        self._followers = convoy_pairs(moving)
        self._moves_since: dict[int, float] = {}
        self._hit_at: dict[int, float] = {}
        self._found_at: dict[int, float] = {}

    def add(self, scene: KnownScene, belief: Belief) -> None:
        """Score one frame.

        Parameters
        ----------
        scene : KnownScene
            What is true.
        belief : Belief
            What the filter says.
        """
        p = belief.probability
        moves = p[State.DYNAMIC] > p[State.STATIC]
        self._add_standing(scene, moves & (p[State.DYNAMIC] > LEAST_DYNAMIC))
        self._add_moving(scene, moves)
        self._add_cars(scene, moves, belief.velocity)
        self._count("left", scene.left, p[State.STATIC] + p[State.DYNAMIC] > 0.5)

    def _count(self, name: str, cells: NDArray, called: NDArray) -> None:
        count = self.cells.setdefault(name, [0, 0])
        count[0] += int(cells.sum())
        count[1] += int((cells & called).sum())

    def _add_standing(self, scene: KnownScene, called: NDArray) -> None:
        """Count what stands."""
        if scene.frame.time < SETTLED_AFTER:
            return
        truth, x = scene.truth, self.spec.centers()[..., 0]
        hit = hit_cells(scene.frame.points_grid, self.spec, least=2, low=0.7, high=1.6)
        stands = hit & (truth.state == State.STATIC) & (x > _AHEAD[0]) & (x < _AHEAD[1])
        self._count("standing cars", stands & (truth.kind == Kind.CAR), called)
        for kind, name in SCENERY.items():
            self._count(name, stands & (truth.kind == kind), called)
        scenery = stands & np.isin(truth.kind, list(SCENERY))
        self._count("scenery", scenery, called)
        self.frames.append((int(scenery.sum()), int((scenery & called).sum())))

    def _add_moving(self, scene: KnownScene, moves: NDArray) -> None:
        """Count what moves."""
        truth, distance = scene.truth, np.hypot(*np.moveaxis(self.spec.centers(), -1, 0))
        moving = scene.hit & (truth.state == State.DYNAMIC)
        for number in np.unique(truth.instance[truth.state == State.DYNAMIC]):
            self._moves_since.setdefault(int(number), scene.frame.time)
        cars = np.isin(truth.instance, self._long_in_view(scene, CARS_AFTER)) & (truth.kind == Kind.CAR)
        self._count("moving cars", moving & cars & (distance < FAR), moves)
        walkers = np.isin(truth.instance, self._long_in_view(scene, OTHERS_AFTER)) & (truth.kind == Kind.PEDESTRIAN)
        self._count("walkers, near", moving & walkers & (distance < NEAR), moves)
        self._count("walkers, far", moving & walkers & (distance >= NEAR) & (distance < FAR), moves)

    def _long_in_view(self, scene: KnownScene, least: float) -> list[int]:
        """Return the things that have moved, and have been in view, for at least this time."""
        now = scene.frame.time
        times = {k: min(frames * PERIOD, now - self._moves_since.get(k, now)) for k, frames in scene.in_view.items()}
        return [number for number, time in times.items() if time >= least - 1e-6]

    def _add_cars(self, scene: KnownScene, moves: NDArray, velocity: NDArray) -> None:
        """Note the speed of each moving car, and when it is hit and found for the first time."""
        truth, settled = scene.truth, self._long_in_view(scene, OTHERS_AFTER)
        cars = scene.hit & (truth.state == State.DYNAMIC) & (truth.kind == Kind.CAR)
        for number in map(int, np.unique(truth.instance[cars])):
            cells = cars & (truth.instance == number)
            if cells.sum() < _FOUND_CELLS:
                continue
            self._hit_at.setdefault(number, scene.frame.time)
            if moves[cells].mean() >= 0.5:
                self._found_at.setdefault(number, scene.frame.time)
            if number in settled and np.isfinite(velocity[0, cells]).any():
                speed, true_speed = (np.hypot(*np.nanmean(v[:, cells], axis=1)) for v in (velocity, truth.velocity))
                self.speed_errors.append(float(abs(speed - true_speed)))

    def end(self) -> None:
        """End a drive: note how much later than the car ahead each car of a convoy was found."""
        for ahead, follower in self._followers:
            if ahead in self._found_at and follower in self._hit_at:
                since = max(self._found_at[ahead], self._hit_at[follower])
                self.delays.append(max(self._found_at.get(follower, np.inf) - since, 0.0))

    def summary(self) -> dict[str, object]:
        """Return all scores.

        Returns
        -------
        dict
            JSON can hold it. A share of no cells is None; so is the delay of a car that was never found.
        """
        worst = max((share(part, whole) for whole, part in self.frames if whole >= LEAST_CELLS), default=None)
        errors = np.array(self.speed_errors)
        return {
            "cells": {name: {"cells": n, "called": share(part, n)} for name, (n, part) in self.cells.items()},
            "worst frame": worst,
            "speed error": {
                "cases": len(errors),
                "median": float(np.median(errors)) if len(errors) else None,
                "within 1.5 m/s": share(int((errors < 1.5).sum()), len(errors)),
            },
            "delays": [delay if np.isfinite(delay) else None for delay in self.delays],
        }


def convoy_pairs(moving: list[Actor]) -> list[tuple[int, int]]:
    """Return which cars follow which: those that drive along one line at one pace.

    Parameters
    ----------
    moving : list of Actor
        What moves in a drive.

    Returns
    -------
    list of (int, int)
        The numbers of a car and of the next one behind it.
    """
    lines: dict[object, list[tuple[float, int]]] = {}
    for actor in moving:
        way = actor.trajectory
        if actor.kind == Kind.CAR:
            line = (way.along, way.across, way.d if way.along else way.s, way.pace)
            lines.setdefault(line, []).append((way.s * way.along + way.d * way.across, actor.instance))
    ordered = [[number for _, number in sorted(line, reverse=True)] for line in lines.values()]
    return [pair for line in ordered for pair in zip(line[:-1], line[1:], strict=True)]
