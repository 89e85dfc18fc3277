"""Count phantoms and detected movers on one of the named streets, for `lecture_04_suspects`."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, State
from semgrid_edu.workshop.simulation.drive import PERIOD
from semgrid_edu.workshop.simulation.things.materials import Kind
from worlds.lecture_04_cell_scores import FAR, NEAR, SCENERY, SETTLED_AFTER
from worlds.lecture_04_scenes import KnownScene, hit_cells

LEAST_DYNAMIC = 0.3
"""A phantom is a static cell that is more DYNAMIC than STATIC, and DYNAMIC with more than this probability."""
CARS_AFTER = 0.8
"""Time in view, seconds, after which a filter should have detected a moving car."""
WALKERS_AFTER = 1.5
"""The same for a pedestrian."""
_LOW, _AHEAD, _RIGHT = 0.7, (2.0, 40.0), -2.0


class StreetScores:
    """Counts over the frames of a street's drives, for one filter.

    Static things are scored from `SETTLED_AFTER` on, 2 to 40 m ahead and more than 2 m to the right, in cells with at
    least two returns between 0.7 and 1.6 m above flat ground. Moving things are scored in the hit cells of the
    `KnownScene`, up to 50 m away.

    Parameters
    ----------
    spec : GridSpec
        The grid of the frames.

    Attributes
    ----------
    cells : dict of str to [int, int]
        For each group of cells their number, and the number of those called DYNAMIC; for "left", called occupied.
    """

    def __init__(self, spec: GridSpec) -> None:
        self.spec = spec
        self.cells: dict[str, list[int]] = {}
        self._moves_since: dict[int, float] = {}  # seconds, by number of the object

    def begin_drive(self) -> None:
        """Forget the moving things of the previous drive."""
        self._moves_since = {}

    def add(self, scene: KnownScene, belief: Belief) -> None:
        """Score one frame.

        Parameters
        ----------
        scene : KnownScene
            The truth.
        belief : Belief
            The filter's belief.
        """
        p = belief.probability
        moves = p[State.DYNAMIC] > p[State.STATIC]
        moving = scene.truth.state == State.DYNAMIC
        for number in map(int, np.unique(scene.truth.instance[moving])):
            self._moves_since.setdefault(number, scene.frame.time)
        if scene.frame.time >= SETTLED_AFTER:
            self._add_static(scene, moves & (p[State.DYNAMIC] > LEAST_DYNAMIC))
        self._add_moving(scene, moves)
        self._count("left", scene.left, p[State.STATIC] + p[State.DYNAMIC] > 0.5)

    def _count(self, name: str, cells: NDArray, called: NDArray) -> None:
        count = self.cells.setdefault(name, [0, 0])
        count[0] += int(cells.sum())
        count[1] += int((cells & called).sum())

    def _add_static(self, scene: KnownScene, called: NDArray) -> None:
        """Count static things, and the phantoms among their cells."""
        truth = scene.truth
        (x, y) = np.moveaxis(self.spec.centers(), -1, 0)
        hit = hit_cells(scene.frame.points_grid, self.spec, low=_LOW)
        static = hit & (truth.state == State.STATIC) & (x > _AHEAD[0]) & (x < _AHEAD[1]) & (y < _RIGHT)
        self._count("scenery", static & np.isin(truth.kind, list(SCENERY)), called)
        for kind, name in {**SCENERY, Kind.CAR: "standing cars"}.items():
            self._count(name, static & (truth.kind == kind), called)

    def _add_moving(self, scene: KnownScene, moves: NDArray) -> None:
        """Count moving cars and pedestrians that have been in view for long enough."""
        truth = scene.truth
        distance = self.spec.distances()
        moving = scene.hit & (truth.state == State.DYNAMIC) & (distance < FAR)
        cars = moving & (truth.kind == Kind.CAR) & np.isin(truth.instance, self._moved_in_view(scene, CARS_AFTER))
        self._count("moving cars", cars, moves)
        walkers = moving & (truth.kind == Kind.PEDESTRIAN)
        walkers &= np.isin(truth.instance, self._moved_in_view(scene, WALKERS_AFTER))
        self._count("walkers, near", walkers & (distance < NEAR), moves)
        self._count("walkers, far", walkers & (distance >= NEAR), moves)

    def _moved_in_view(self, scene: KnownScene, least: float) -> list[int]:
        """Return the numbers of the objects that have been moving in view for at least this time, seconds."""
        now = scene.frame.time
        moved = {number: now - self._moves_since.get(number, now) for number in scene.in_view}
        return [k for k, frames in scene.in_view.items() if min(frames * PERIOD, moved[k]) >= least - 1e-6]
