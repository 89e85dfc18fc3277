"""Scores of an occupancy filter on test streets: what stands and is called DYNAMIC, what moves and isn't found."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, State
from semgrid_edu.workshop.simulation.street.traffic import Actor
from semgrid_edu.workshop.simulation.things.materials import Kind
from semgrid_edu.workshop.studies.filter.cell_scores import FAR, NEAR, SCENERY, SETTLED_AFTER, share
from semgrid_edu.workshop.studies.filter.detection_latency import MoverTimes
from semgrid_edu.workshop.studies.filter.scenes import KnownScene, hit_cells

LEAST_DYNAMIC = 0.3
"""A phantom is a standing cell that is more DYNAMIC than STATIC, with more than this probability of DYNAMIC."""
LEAST_CELLS = 60
"""Number of hit cells of scenery from which on a frame is looked at for the worst frame."""
CARS_AFTER, OTHERS_AFTER = 0.8, 1.5
"""Time, seconds, after which a filter should have found a car that moves in view; and a pedestrian, or any speed."""
_HEIGHTS = {"low": 0.7, "high": 1.6}
_AHEAD, _RIGHT = (2.0, 40.0), -2.0


@dataclass(eq=False)
class StreetScores:
    """Counts over the frames of a street's drives, for one filter.

    What stands is scored from `SETTLED_AFTER` on, from 2 to 40 m ahead and from 2 m to the right, in cells with
    two returns or more between 0.7 and 1.6 m above the flat ground. What moves is scored in the hit cells of the
    `KnownScene`, up to 50 m away.

    Parameters
    ----------
    spec : GridSpec
        The grid of the frames.

    Attributes
    ----------
    cells : dict of str to [int, int]
        For each group of cells their number, and the number of those called DYNAMIC; in "left", called occupied.
    frames : list of (int, int)
        For each frame: hit cells of scenery, and phantoms among them.
    speed_errors : list of float
        For each car and each frame, `OTHERS_AFTER` in view: | |mean velocity in its hit cells| - its speed |, m/s.
    times : MoverTimes
        When each thing that moves is found.
    """

    spec: GridSpec
    cells: dict[str, list[int]] = field(default_factory=dict, init=False)
    frames: list[tuple[int, int]] = field(default_factory=list, init=False)
    speed_errors: list[float] = field(default_factory=list, init=False)
    times: MoverTimes = field(default_factory=MoverTimes, init=False)

    def begin(self, moving: list[Actor]) -> None:
        """Begin a drive.

        Parameters
        ----------
        moving : list of Actor
            What moves in it.
        """
        self.times.begin(moving)

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
        self.times.add(scene, moves)
        if scene.frame.time >= SETTLED_AFTER:
            self._add_standing(scene, moves & (p[State.DYNAMIC] > LEAST_DYNAMIC))
        self._add_moving(scene, moves, belief.velocity)
        self._count("left", scene.left, p[State.STATIC] + p[State.DYNAMIC] > 0.5)

    def end(self) -> None:
        """End a drive."""
        self.times.end()

    def _count(self, name: str, cells: NDArray, called: NDArray) -> None:
        count = self.cells.setdefault(name, [0, 0])
        count[0] += int(cells.sum())
        count[1] += int((cells & called).sum())

    def _add_standing(self, scene: KnownScene, called: NDArray) -> None:
        """Count what stands, and what of it is a phantom."""
        truth, (x, y) = scene.truth, np.moveaxis(self.spec.centers(), -1, 0)
        hit = hit_cells(scene.frame.points_grid, self.spec, least=2, **_HEIGHTS)
        stands = hit & (truth.state == State.STATIC) & (x > _AHEAD[0]) & (x < _AHEAD[1]) & (y < _RIGHT)
        scenery = stands & np.isin(truth.kind, list(SCENERY))
        self._count("scenery", scenery, called)
        self.frames.append((int(scenery.sum()), int((scenery & called).sum())))
        for kind, name in {**SCENERY, Kind.CAR: "standing cars"}.items():
            self._count(name, stands & (truth.kind == kind), called)

    def _add_moving(self, scene: KnownScene, moves: NDArray, velocity: NDArray) -> None:
        """Count what moves, and note the speed of each car."""
        truth, distance = scene.truth, np.hypot(*np.moveaxis(self.spec.centers(), -1, 0))
        moving = scene.hit & (truth.state == State.DYNAMIC) & (distance < FAR)
        cars, walkers = (moving & (truth.kind == kind) for kind in (Kind.CAR, Kind.PEDESTRIAN))
        self._count("moving cars", cars & np.isin(truth.instance, self.times.in_view_for(scene, CARS_AFTER)), moves)
        settled = self.times.in_view_for(scene, OTHERS_AFTER)
        for name, range_ in (("walkers, near", distance < NEAR), ("walkers, far", distance >= NEAR)):
            self._count(name, walkers & range_ & np.isin(truth.instance, settled), moves)
        for number in np.intersect1d(truth.instance[cars], settled):
            cells = cars & (truth.instance == number) & np.isfinite(velocity[0])
            if cells.any():
                speed, true_speed = (np.hypot(*v[:, cells].mean(axis=1)) for v in (velocity, truth.velocity))
                self.speed_errors.append(float(abs(speed - true_speed)))

    def summary(self) -> dict[str, object]:
        """Return all scores.

        Returns
        -------
        dict
            JSON can hold it. A share of no cells is None.
        """
        errors = np.array(self.speed_errors)
        return {
            "cells": {name: {"cells": n, "called": share(part, n)} for name, (n, part) in self.cells.items()},
            "worst frame": max((part / n for n, part in self.frames if n >= LEAST_CELLS), default=None),
            "speed error": {
                "cases": len(errors),
                "median": float(np.median(errors)) if len(errors) else None,
                "within 1.5 m/s": share(int((errors < 1.5).sum()), len(errors)),
            },
            **self.times.summary(),
        }
