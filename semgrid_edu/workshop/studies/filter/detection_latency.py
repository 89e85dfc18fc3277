"""How long a filter takes to find what moves: after it has come into view, and after the car ahead of it was found."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.occupancy import State
from semgrid_edu.workshop.simulation.drive import PERIOD
from semgrid_edu.workshop.simulation.street.traffic import Actor
from semgrid_edu.workshop.simulation.things.materials import Kind
from semgrid_edu.workshop.studies.filter.scenes import KnownScene

_FOUND_CELLS = {Kind.CAR: 3, Kind.PEDESTRIAN: 1}
"""Number of its cells that a frame has to hit for a car or a pedestrian to be found in it."""
_LEAST_TIME = 1.0
"""Something never found counts only if it could have been found for this time, seconds."""


@dataclass(eq=False)
class DetectionLatency:
    """When cars and pedestrians are found, over several drives.

    Something is found in the first frame in which at least half of its hit cells are more DYNAMIC than STATIC.

    Attributes
    ----------
    waits : dict of str to list of float
        For "cars" and "pedestrians": seconds from when each has moved in view until it is found; infinite if it isn't.
    delays : list of float
        For each car that follows another one: seconds that it is found after the one ahead, counted from when it is hit
        itself if that is later; infinite if it isn't found.
    """

    waits: dict[str, list[float]] = field(default_factory=lambda: {"cars": [], "pedestrians": []}, init=False)
    delays: list[float] = field(default_factory=list, init=False)

    def begin(self, moving: list[Actor]) -> None:
        """Begin a drive.

        Parameters
        ----------
        moving : list of Actor
            What moves in it.
        """
        self._kinds = {actor.instance: actor.kind for actor in moving}
        self._pairs = convoy_pairs(moving)
        self._moves_since: dict[int, float] = {}
        self._hit, self._found, self._last = {}, {}, {}

    def add(self, scene: KnownScene, moves: NDArray) -> None:
        """Note what is hit and what is found in one frame.

        Parameters
        ----------
        scene : KnownScene
            What is true.
        moves : (H, W) bool
            Whether the filter holds each cell more DYNAMIC than STATIC.
        """
        truth, now = scene.truth, scene.frame.time
        moving = truth.state == State.DYNAMIC
        for number in map(int, np.unique(truth.instance[moving])):
            self._moves_since.setdefault(number, now)
            cells = scene.hit & moving & (truth.instance == number)
            if cells.sum() < _FOUND_CELLS.get(self._kinds[number], 1):
                continue
            self._hit.setdefault(number, now)
            self._last[number] = now
            if moves[cells].mean() >= 0.5:
                self._found.setdefault(number, now)

    def in_view_for(self, scene: KnownScene, least: float) -> list[int]:
        """Return what has moved in view for some time.

        Parameters
        ----------
        scene : KnownScene
            The frame that was added last.
        least : float
            The time, seconds.

        Returns
        -------
        list of int
            Numbers of things.
        """
        now = scene.frame.time
        times = {k: min(frames * PERIOD, now - self._moves_since.get(k, now)) for k, frames in scene.in_view.items()}
        return [number for number, time in times.items() if time >= least - 1e-6]

    def end(self) -> None:
        """End a drive: work out its times."""
        for kind, name in ((Kind.CAR, "cars"), (Kind.PEDESTRIAN, "pedestrians")):
            numbers = [number for number in self._hit if self._kinds[number] == kind]
            self.waits[name] += self._delays({number: self._hit[number] for number in numbers})
        found = self._found
        self.delays += self._delays(
            {b: max(found[a], self._hit[b]) for a, b in self._pairs if a in found and b in self._hit}
        )

    def _delays(self, since: dict[int, float]) -> list[float]:
        """Return how much later than `since` each thing is found; what leaves the view too early is left out."""
        seen = {k: t for k, t in since.items() if k in self._found or self._last[k] - t >= _LEAST_TIME}
        return [round(max(self._found.get(number, np.inf) - time, 0.0), 3) for number, time in seen.items()]

    def summary(self) -> dict[str, object]:
        """Return all times.

        Returns
        -------
        dict
            "found after" and "found after the car ahead"; JSON can hold it: an infinite time is None.
        """
        waits = {name: _for_json(times) for name, times in self.waits.items()}
        return {"found after": waits, "found after the car ahead": _for_json(self.delays)}


def _for_json(times: list[float]) -> list[float | None]:
    """Write infinite times as None."""
    return [time if np.isfinite(time) else None for time in times]


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
        path = actor.trajectory
        if actor.kind == Kind.CAR:
            line = (path.along, path.across, path.d if path.along else path.s, path.pace)
            lines.setdefault(line, []).append((path.s * path.along + path.d * path.across, actor.instance))
    ordered = [[number for _, number in sorted(line, reverse=True)] for line in lines.values()]
    return [pair for line in ordered for pair in pairwise(line)]
