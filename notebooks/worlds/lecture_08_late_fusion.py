"""The cost of late fusion, in a cell that camera and LIDAR both see, or that something hides from both.

If something is in front of a cell, the camera's pixel shows that thing and no beam arrives. Late fusion multiplies the
evidence of pixel and occupancy state, as if their errors were independent.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical import Factor, eliminate
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, binary, directed

ROAD, CAR = range(2)
"""The contents of the cell, and the label of its pixel."""

FREE, OCCUPIED, UNKNOWN = range(3)
"""The occupancy state of the cell."""


@dataclass(frozen=True)
class TwoSensors:
    """A cell on the ground, the pixel that looks at it, and its occupancy state.

    Parameters
    ----------
    prior : float
        P(car) of the cell; otherwise it is road.
    hidden : float
        Probability that something in front hides the cell from both sensors.
    right : float
        Probability that a label, or a state other than UNKNOWN, is right where the cell is seen.
    hider_is_car : float
        Probability that the pixel of a hidden cell shows a car.
    unknown : (float, float)
        P(UNKNOWN) of a cell that is seen, and of one that is hidden.
    """

    prior: float = 0.2
    hidden: float = 0.5
    right: float = 0.95
    hider_is_car: float = 0.9
    unknown: tuple[float, float] = (0.1, 0.95)


def late_fusion(world: TwoSensors | None = None) -> StageGraph:
    """Build the graph of a cell, whether it is hidden, its pixel's label and its occupancy state.

    Variables are m (what is in the cell: 0 road, 1 car), hid (1 when it is hidden), a (label of its pixel, like m) and
    o (0 FREE, 1 occupied, 2 UNKNOWN).
    """
    world = world or TwoSensors()
    factors = [binary("m", world.prior), binary("hid", world.hidden)]
    factors += [Factor(("m", "hid", "a"), _label(world)), Factor(("m", "hid", "o"), _state(world))]
    return StageGraph(
        "A cell, seen or hidden, and what both sensors say",
        directed(factors),
        positions={"m": (0.0, 0.0), "hid": (3.0, 0.0), "a": (0.0, -1.4), "o": (3.0, -1.4)},
        observed=("a", "o"),
        equations={"m": "what is there", "hid": "hidden or not", "a": "the pixel's label", "o": "occupancy state"},
        cut=CUT,
    )


def _label(world: TwoSensors) -> NDArray[np.float64]:
    """Return P(a | m, hid), (2, 2, 2)."""
    car = np.array([[1 - world.right, world.hider_is_car], [world.right, world.hider_is_car]])
    return np.stack([1 - car, car], axis=-1)


def _state(world: TwoSensors) -> NDArray[np.float64]:
    """Return P(o | m, hid), (2, 2, 3)."""
    unknown = np.broadcast_to(world.unknown, (2, 2))
    occupied = (1 - unknown) * np.array([[1 - world.right], [world.right]])
    return np.stack([1 - unknown - occupied, occupied, unknown], axis=-1)


def car_by_both(label: int, state: int, world: TwoSensors | None = None) -> NDArray[np.float64]:
    """Return P(car) given the pixel's label (ROAD or CAR) and the cell's state (FREE, OCCUPIED or UNKNOWN), (2,).

    First exactly, then by late fusion: P(m) P(a | m) P(o | m), normalised. Each sensor's likelihood is right, and their
    product is not.
    """
    model = late_fusion(world).model
    exact = eliminate(model, "m", {"a": label, "o": state}).normalised().table
    by_label = eliminate(model, "m", {"a": label}).table
    by_state = eliminate(model, "m", {"o": state}).table
    late = by_label * by_state / eliminate(model, "m").table
    return np.array([exact[CAR], late[CAR] / late.sum()])


@cache
def hidden_from_both() -> Price:
    """P(car) of the cell whose pixel shows a car, and which no beam reached."""
    exact, late = car_by_both(CAR, UNKNOWN)
    return Price(exact, late, "P(car), pixel says car, o UNKNOWN")


CUT = (
    CutEdge(
        "hid -> o",
        "Fusion that multiplies what pixel and occupancy state each tell about a cell leaves out that whatever hides a "
        "cell hides it from both, so where the pixel shows a car and no beam arrived P(car) becomes 0.33 instead of "
        "0.22. The network sees both at once and need not cut this edge.",
        ("hid", "o"),
        hidden_from_both,
    ),
)
"""The edges that late fusion cuts."""
