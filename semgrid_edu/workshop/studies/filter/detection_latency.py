"""How long a filter takes to find what moves: after it has come into view, and after the car ahead of it was found."""

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


class DetectionLatency:
    """When cars and pedestrians are found, over several drives.

    Something is found in the first frame in which at least half of its hit cells are more DYNAMIC than STATIC.

    Attributes
    ----------
    waits : dict of str to list of float or None
        For "cars" and "pedestrians": seconds from when each has moved in view until it is found; None if it isn't.
    delays : list of float or None
        For each car that follows another one: seconds that it is found after the one ahead, counted from when it is hit
        itself if that is later; None if it isn't found.
    """

    def __init__(self) -> None:
        self.waits: dict[str, list[float | None]] = {"cars": [], "pedestrians": []}
        self.delays: list[float | None] = []

    def begin(self, moving: list[Actor]) -> None:
        """Begin a drive.

        Parameters
        ----------
        moving : list of Actor
            What moves in it.
        """
        self._kinds = {actor.instance: actor.kind for actor in moving}
        self._pairs = convoy_pairs(moving)
        self._moves_since, self._hit, self._found, self._last = {}, {}, {}, {}  # seconds by number

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
            self.waits[name] += self._delays({k: time for k, time in self._hit.items() if self._kinds[k] == kind})
        pairs = [(a, b) for a, b in self._pairs if a in self._found and b in self._hit]
        self.delays += self._delays({b: max(self._found[a], self._hit[b]) for a, b in pairs})

    def _delays(self, since: dict[int, float]) -> list[float | None]:
        """Return how much later than `since` each thing is found; what leaves the view too early is left out."""
        found = self._found
        seen = {k: t for k, t in since.items() if k in found or self._last[k] - t >= _LEAST_TIME}
        return [round(max(found[k] - t, 0.0), 3) if k in found else None for k, t in seen.items()]

    def summary(self) -> dict[str, object]:
        """Return all times.

        Returns
        -------
        dict
            "found after" and "found after the car ahead"; JSON can hold it.
        """
        return {"found after": self.waits, "found after the car ahead": self.delays}


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
    for path, number in ((actor.trajectory, actor.instance) for actor in moving if actor.kind == Kind.CAR):
        line = (path.along, path.across, path.d if path.along else path.s, path.pace)
        lines.setdefault(line, []).append((path.s * path.along + path.d * path.across, number))
    ordered = [[number for _, number in sorted(line, reverse=True)] for line in lines.values()]
    return [pair for line in ordered for pair in pairwise(line)]
