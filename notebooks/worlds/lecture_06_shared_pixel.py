"""Cells that read one pixel share its error."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical import Factor, eliminate, in_rows
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, binary, directed, with_gaps


def shared_pixel(readers: int = 4, right: float = 0.8, prior: float = 0.5) -> StageGraph:
    """Build the graph of a patch of ground, the pixel that shows it, and the cells that read this pixel.

    Parameters
    ----------
    readers : int
        Number of cells that read the pixel.
    right : float
        Probability that the pixel shows what is there.
    prior : float
        Probability that a car is there; otherwise it is road.

    Returns
    -------
    StageGraph
        Variables m (what is there), a (the label of the pixel) and x1, x2, ... (what each cell reads): 0 road, 1 car.
    """
    cells = [f"x{k}" for k in range(1, readers + 1)]
    pixel = Factor(("m", "a"), [[right, 1 - right], [1 - right, right]])
    factors = [binary("m", prior), pixel, *(Factor(("a", cell), np.eye(2)) for cell in cells)]
    return StageGraph(
        f"{readers} cells read one pixel",
        directed(factors),
        positions=in_rows(["m"], ["a"], with_gaps(cells)),  # room for the price between two arrows
        observed=tuple(cells),
        equations={"m": "what lies there", "a": "the pixel", cells[-1]: "what the cells read"},
        cut=CUT,
    )


def believed_by_readers(readers: int = 4, right: float = 0.8, prior: float = 0.5) -> NDArray[np.float64]:
    """Return P(car) when all cells read "car": exactly, and as if the readings had independent errors, (2,)."""
    model = shared_pixel(readers, right, prior).model
    exact = eliminate(model, "m", {f"x{k}": 1 for k in range(1, readers + 1)}).normalised().table[1]
    car = prior * right**readers
    road = (1 - prior) * (1 - right) ** readers
    return np.array([exact, car / (car + road)])


@cache
def four_readers() -> Price:
    """P(car) when four cells read "car" from the same pixel."""
    exact, system = believed_by_readers(4)
    return Price(exact, system, "P(car) when four cells read car")


CUT = (
    CutEdge(
        "a -> x1, x2",
        "Cells that read one pixel share its error, so four that agree are right with 0.80, and would be with 0.996 if "
        "each had read a pixel of its own.",
        ("a", "x4"),
        four_readers,
        at=0.6,
    ),
)
"""The edges that are cut when cells are assumed independent."""
