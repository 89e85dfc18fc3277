"""A cell that camera and LIDAR both see, or that something hides from both: what fusing their answers late costs.

Where something stands in front of a cell, the camera's pixel shows that thing and no beam arrives. Late fusion
multiplies what the pixel and the occupancy state each say of the cell, as if their errors had nothing in common.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import check_fields
from semgrid_edu.graphical.exact import eliminate
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.stage_models.stage_graph import StageGraph, binary, cut_edges, directed

ROAD, CAR = range(2)
"""What is in the cell, and what its pixel shows."""

FREE, OCCUPIED, UNKNOWN = range(3)
"""What the occupancy grid says of the cell."""


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

    def __post_init__(self) -> None:
        """Refuse what isn't a probability."""
        check_fields(self, "a probability", lambda p: 0 <= p <= 1, "prior", "hidden", "right", "hider_is_car")
        check_fields(self, "two probabilities", lambda pair: all(0 <= p <= 1 for p in pair), "unknown")


def late_fusion(world: TwoSensors | None = None) -> StageGraph:
    """Build the graph of a cell, whether it is hidden, its pixel's label and its occupancy state.

    Parameters
    ----------
    world : TwoSensors, optional
        The cell and its sensors; the defaults when left out.

    Returns
    -------
    StageGraph
        Variables m (what is in the cell: 0 road, 1 car), hid (1 when it is hidden), a (label of its pixel, like m)
        and o (0 FREE, 1 occupied, 2 UNKNOWN).
    """
    world = world or TwoSensors()
    factors = [binary("m", world.prior), binary("hid", world.hidden)]
    factors += [Factor(("m", "hid", "a"), _label(world)), Factor(("m", "hid", "o"), _state(world))]
    return StageGraph(
        "A cell, seen or hidden, and what both sensors say",
        directed(factors),
        observed=("a", "o"),
        positions={"m": (0.0, 0.0), "hid": (3.0, 0.0), "a": (0.0, -1.4), "o": (3.0, -1.4)},
        equations={"m": "what is there", "hid": "hidden or not", "a": "the pixel's label", "o": "occupancy state"},
        cut=cut_edges("fusion"),
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
    """Return P(car) of the cell given both readings: exactly, and by late fusion, (2,).

    Late fusion is P(m) P(a | m) P(o | m), normalised: each sensor's likelihood is right, and their product is not.

    Parameters
    ----------
    label : int
        a, what the pixel shows: 0 road, 1 car.
    state : int
        o, what the occupancy grid says: 0 FREE, 1 occupied, 2 UNKNOWN.
    world : TwoSensors, optional
        The cell and its sensors; the defaults when left out.
    """
    model = late_fusion(world).model
    exact = eliminate(model, ("m",), {"a": label, "o": state}).normalised().table
    by_label, by_state = (eliminate(model, ("m",), given).table for given in ({"a": label}, {"o": state}))
    late = by_label * by_state / eliminate(model, ("m",)).table
    return np.array([exact[CAR], late[CAR] / late.sum()])
