"""Scores of an occupancy filter, cell by cell, on drives with known truth (paper, section 3.2)."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.occupancy import N_STATES, Belief, State
from semgrid_edu.workshop.simulation.drive import PERIOD
from semgrid_edu.workshop.simulation.things.materials import Kind
from worlds.lecture_04_scenes import KnownScene

UNDECIDED = 0.05
"""A log-odds grid calls a cell UNKNOWN while P(occupied) differs from the prior, one half, by no more than this."""
FOUND_AFTER = 1.5
"""Time in view, seconds, after which a filter should have detected that something moves."""
SETTLED_AFTER = 1.0
"""Time since the start of a drive, seconds, after which static things are scored."""
NEAR, FAR = 25.0, 50.0
"""Upper ends of the two ranges of distance, metres."""
MOVERS = {Kind.CAR: "moving cars", Kind.BICYCLE: "cyclists", Kind.PEDESTRIAN: "walking pedestrians"}
STANDERS = {Kind.CAR: "standing cars", Kind.BICYCLE: "parked bicycles", Kind.PEDESTRIAN: "standing pedestrians"}
SCENERY = {Kind.BUILDING: "walls", Kind.FENCE: "fences", Kind.PLANT: "foliage", Kind.POLE: "poles", Kind.SIGN: "signs"}

BANKS = "banks"
"""Name of the group of free cells that are hit because their ground rises above the road."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """A filter's output for each cell.

    Parameters
    ----------
    state : (H, W) int
        The most likely of the four states.
    occupied : (H, W) float
        Probability that the cell is occupied, by something moving or static.
    moves : (H, W) bool
        Whether the cell is more likely DYNAMIC than STATIC.
    velocity : (2, H, W) float
        Velocity over ground, along x and y of the grid frame, m/s; NaN where there is none.
    """

    state: NDArray[np.integer]
    occupied: NDArray[np.floating]
    moves: NDArray[np.bool_]
    velocity: NDArray[np.floating]

    @classmethod
    def of_belief(cls, belief: Belief) -> "Estimate":
        """Read the belief of a filter that knows the four states.

        Parameters
        ----------
        belief : Belief
            Probabilities and velocities after a step.
        """
        p = belief.probability
        moves = p[State.DYNAMIC] > p[State.STATIC]
        return cls(p.argmax(axis=0), p[State.STATIC] + p[State.DYNAMIC], moves, belief.velocity)

    @classmethod
    def of_log_odds(cls, p_occupied: NDArray) -> "Estimate":
        """Read a log-odds grid. It knows no motion, so whatever is occupied counts as STATIC.

        Parameters
        ----------
        p_occupied : (H, W) float
            P(occupied) after a step.
        """
        state = np.where(p_occupied > 0.5, State.STATIC, State.FREE)
        state[np.abs(p_occupied - 0.5) <= UNDECIDED] = State.UNKNOWN
        return cls(state, p_occupied, np.zeros(p_occupied.shape, bool), np.full((2, *p_occupied.shape), np.nan))


class CellScores:
    """Counts over the frames of all drives, for one filter.

    Parameters
    ----------
    spec : GridSpec
        The grid of the frames.

    Attributes
    ----------
    confusion : (4, 4) int64
        How often each true state (row) is predicted as each state (column); cells never seen count as truly UNKNOWN.
    hits : dict of str to (3,) int64
        For each group of `hit_cell_groups` the numbers of hit cells, of those called moving, and of those called
        occupied.
    errors : dict of str to list of float
        Errors of velocity in cells, by kind of thing, m/s.
    smear : (2,) int64
        Number of cells that something moving has left, and of those still called occupied.
    """

    def __init__(self, spec: GridSpec) -> None:
        self.spec = spec
        self.confusion = np.zeros((N_STATES, N_STATES), np.int64)
        self.hits: dict[str, NDArray[np.int64]] = {}
        self.errors: dict[str, list[float]] = {}
        self.smear = np.zeros(2, np.int64)

    def add(self, scene: KnownScene, estimate: Estimate) -> None:
        """Score one frame.

        Parameters
        ----------
        scene : KnownScene
            What is true.
        estimate : Estimate
            The filter's output.
        """
        truth = np.where(scene.never_seen, State.UNKNOWN, scene.truth.state)
        scored = scene.never_seen | scene.observed
        occupied = estimate.occupied > 0.5
        self.confusion += confusion_matrix(truth[scored], estimate.state[scored], N_STATES)
        for name, cells in hit_cell_groups(scene, self.spec):
            counted = cells.sum(), estimate.moves[cells].sum(), occupied[cells].sum()
            self.hits[name] = self.hits.get(name, 0) + np.array(counted)
        self.smear += scene.left.sum(), occupied[scene.left].sum()
        found = scene.observed & (scene.truth.state == State.DYNAMIC) & (estimate.state == State.DYNAMIC)
        found &= np.isfinite(estimate.velocity[0])
        error = np.hypot(*(estimate.velocity - scene.truth.velocity))
        for kind, name in MOVERS.items():
            self.errors.setdefault(name, []).extend(error[found & (scene.truth.kind == kind)].tolist())

    def summary(self) -> dict[str, object]:
        """Return all scores.

        Returns
        -------
        dict
            JSON can hold it. A share of no cells is None.
        """
        dynamic = {"precision": self.confusion[:, State.DYNAMIC], "recall": self.confusion[State.DYNAMIC]}
        all_errors = [error for errors in self.errors.values() for error in errors]
        return {
            "confusion": self.confusion.tolist(),
            "accuracy": share(np.trace(self.confusion), self.confusion.sum()),
            "dynamic": {name: share(counts[State.DYNAMIC], counts.sum()) for name, counts in dynamic.items()},
            "velocity error": {name: _spread(errors) for name, errors in {"all": all_errors, **self.errors}.items()},
            "smear": {"cells": int(self.smear[0]), "occupied": share(self.smear[1], self.smear[0])},
            "hit cells": {
                name: {"cells": int(cells), "dynamic": share(moving, cells), "occupied": share(occupied, cells)}
                for name, (cells, moving, occupied) in self.hits.items()
            },
        }


def hit_cell_groups(scene: KnownScene, spec: GridSpec) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Divide the hit cells of a frame into groups by their contents.

    Moving things are grouped by kind and range, and count once they have been in view for `FOUND_AFTER`. Static things
    are grouped by kind, and count from `SETTLED_AFTER` on.

    Parameters
    ----------
    scene : KnownScene
        The frame.
    spec : GridSpec
        Its grid.

    Yields
    ------
    name : str
        What the group is called.
    cells : (H, W) bool
        Its cells.
    """
    truth = scene.truth
    distance = spec.distances()
    found = [number for number, frames in scene.in_view.items() if frames * PERIOD >= FOUND_AFTER - 1e-6]
    moving = scene.hit & (truth.state == State.DYNAMIC) & np.isin(truth.instance, found)
    for kind, name in MOVERS.items():
        for label, low, high in ((f"to {NEAR:.0f} m", 0, NEAR), (f"{NEAR:.0f} to {FAR:.0f} m", NEAR, FAR)):
            yield f"{name}, {label}", moving & (truth.kind == kind) & (distance >= low) & (distance < high)
    settled = scene.frame.time >= SETTLED_AFTER
    standing = scene.hit & (truth.state == State.STATIC) & settled
    for kind, name in STANDERS.items():
        yield name, standing & (truth.kind == kind) & (truth.instance > 0)
    for kind, name in SCENERY.items():
        yield name, standing & (truth.kind == kind)
    yield BANKS, scene.hit & (truth.state == State.FREE) & settled


def share(part: int, whole: int) -> float | None:
    """Return a share, 0..1, or None if the total is 0.

    Parameters
    ----------
    part, whole : int
        Size of the part and of the whole.
    """
    return float(part / whole) if whole else None


def _spread(errors: list[float]) -> dict[str, float | int | None]:
    """Return number, median and root mean square of errors."""
    median, rms = (float(np.median(errors)), float(np.sqrt(np.mean(np.square(errors))))) if errors else (None, None)
    return {"cells": len(errors), "median": median, "rms": rms}
