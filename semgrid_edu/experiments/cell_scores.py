"""How right an occupancy filter is, cell by cell, where truth is known (paper, section 3.2)."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.experiments.scenes import KnownScene
from semgrid_edu.grid import GridSpec
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.occupancy import N_STATES, Belief, State
from semgrid_edu.simulation.drive import PERIOD
from semgrid_edu.simulation.things.materials import Kind

UNDECIDED = 0.05
"""A log-odds grid knows nothing of a cell while its P(occupied) is this near to the prior of one half."""
FOUND_AFTER = 1.5
"""Seconds in view after which something that moves should have been found to move."""
SETTLED_AFTER = 1.0
"""Seconds from a drive's beginning after which what stands is scored."""
NEAR, FAR = 25.0, 50.0
"""Borders of the two ranges, metres."""
MOVERS = {Kind.CAR: "moving cars", Kind.BICYCLE: "cyclists", Kind.PEDESTRIAN: "walking pedestrians"}
STANDERS = {Kind.CAR: "standing cars", Kind.BICYCLE: "parked bicycles", Kind.PEDESTRIAN: "standing pedestrians"}
SCENERY = {Kind.BUILDING: "walls", Kind.FENCE: "fences", Kind.PLANT: "foliage", Kind.POLE: "poles", Kind.SIGN: "signs"}

BANKS = "banks"
"""Free ground that is hit because it rises above the road."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a method says of the cells.

    Parameters
    ----------
    state : (H, W) int
        The most likely of the four states.
    occupied : (H, W) float
        Probability that the cell is occupied by whatever it be.
    moves : (H, W) bool
        Whether it is more likely DYNAMIC than STATIC.
    velocity : (2, H, W) float
        m/s, NaN where there is none.
    """

    state: NDArray[np.integer]
    occupied: NDArray[np.floating]
    moves: NDArray[np.bool_]
    velocity: NDArray[np.floating]

    @classmethod
    def of_belief(cls, belief: Belief) -> "Estimate":
        """Read the belief of a filter that knows the four states."""
        p = belief.probability
        moves = p[State.DYNAMIC] > p[State.STATIC]
        return cls(p.argmax(axis=0), p[State.STATIC] + p[State.DYNAMIC], moves, belief.velocity)

    @classmethod
    def of_log_odds(cls, p_occupied: NDArray) -> "Estimate":
        """Read a log-odds grid: what is occupied stands, for it knows no motion."""
        state = np.where(p_occupied > 0.5, State.STATIC, State.FREE)
        state[np.abs(p_occupied - 0.5) <= UNDECIDED] = State.UNKNOWN
        nothing = np.full((2, *p_occupied.shape), np.nan)
        return cls(state, p_occupied, np.zeros(p_occupied.shape, bool), nothing)


@dataclass(eq=False)
class CellScores:
    """What adds up over the frames of all drives, of one method.

    Parameters
    ----------
    spec : GridSpec
        Of the frames.
    confusion : (4, 4) int64
        Cells by true state and by what they are called; UNKNOWN is true of cells never seen.
    hits : dict of str to [int, int, int]
        By group of `hit_cell_groups`: hit cells, those called moving, those held occupied.
    errors : dict of str to list of float
        Velocity errors of cells by kind of thing, m/s.
    smear : [int, int]
        Cells that something moving has left, those still held occupied.
    """

    spec: GridSpec
    confusion: NDArray[np.int64] = field(default_factory=lambda: np.zeros((N_STATES, N_STATES), np.int64))
    hits: dict[str, list[int]] = field(default_factory=dict)
    errors: dict[str, list[float]] = field(default_factory=dict)
    smear: list[int] = field(default_factory=lambda: [0, 0])

    def add(self, scene: KnownScene, estimate: Estimate) -> None:
        """Score one frame.

        Parameters
        ----------
        scene : KnownScene
            What is true.
        estimate : Estimate
            What the method says.
        """
        truth = np.where(scene.never_seen, State.UNKNOWN, scene.truth.state)
        scored = scene.never_seen | scene.observed
        self.confusion += confusion_matrix(truth[scored], estimate.state[scored], N_STATES)
        for name, cells in hit_cell_groups(scene, self.spec):
            count = self.hits.setdefault(name, [0, 0, 0])
            for k, counted in enumerate((cells, cells & estimate.moves, cells & (estimate.occupied > 0.5))):
                count[k] += int(counted.sum())
        self._add_errors(scene, estimate)
        self.smear[0] += int(scene.left.sum())
        self.smear[1] += int((estimate.occupied > 0.5)[scene.left].sum())

    def _add_errors(self, scene: KnownScene, estimate: Estimate) -> None:
        """Score the velocity of observed cells that move and are said to."""
        found = scene.observed & (scene.truth.state == State.DYNAMIC) & (estimate.state == State.DYNAMIC)
        found &= np.isfinite(estimate.velocity[0])
        error = np.hypot(*(estimate.velocity - scene.truth.velocity))
        for kind, name in MOVERS.items():
            self.errors.setdefault(name, []).extend(error[found & (scene.truth.kind == kind)].tolist())

    def summary(self) -> dict[str, object]:
        """Return all scores; it can be written as JSON. A share of nothing is None."""
        dynamic = self.confusion[:, State.DYNAMIC], self.confusion[State.DYNAMIC]
        right = int(self.confusion[State.DYNAMIC, State.DYNAMIC])
        everybody = [error for errors in self.errors.values() for error in errors]
        return {
            "confusion": self.confusion.tolist(),
            "accuracy": share(int(np.trace(self.confusion)), int(self.confusion.sum())),
            "dynamic": {
                "precision": share(right, int(dynamic[0].sum())),
                "recall": share(right, int(dynamic[1].sum())),
            },
            "velocity error": {name: _spread(errors) for name, errors in {"all": everybody, **self.errors}.items()},
            "smear": {"cells": self.smear[0], "occupied": share(self.smear[1], self.smear[0])},
            "hit cells": {
                name: {"cells": cells, "dynamic": share(moving, cells), "occupied": share(occupied, cells)}
                for name, (cells, moving, occupied) in self.hits.items()
            },
        }


def hit_cell_groups(scene: KnownScene, spec: GridSpec) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Divide the hit cells of a frame by what is in them.

    What moves counts by its range, and once it has been in view for `FOUND_AFTER`; what stands, from
    `SETTLED_AFTER` on.

    Parameters
    ----------
    scene : KnownScene
    spec : GridSpec

    Yields
    ------
    name : str
    cells : (H, W) bool
    """
    truth, distance = scene.truth, np.hypot(*np.moveaxis(spec.centers(), -1, 0))
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
    """Return part / whole, None where there is nothing to share."""
    return part / whole if whole else None


def _spread(errors: list[float]) -> dict[str, float | int | None]:
    """Return number, median and root mean square of errors."""
    if not errors:
        return {"cells": 0, "median": None, "rms": None}
    return {"cells": len(errors), "median": float(np.median(errors)), "rms": float(np.sqrt(np.mean(np.square(errors))))}
