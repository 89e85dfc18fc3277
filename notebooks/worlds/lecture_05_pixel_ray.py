"""The evidence of pixels about the cells along their rays, and how the system reads them instead.

A camera sees the first thing on each ray. Equation (1) gives every cell a pixel, even if something is in front of the
cell, and a plane gives every pixel a fixed height, whatever the pixel shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product as every_combination

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.graphical import Factor, eliminate, in_rows
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, binary, directed

CAR_HEIGHTS = (0.03, 0.18, 0.32, 0.47)
"""The shipped drive: shares of the pixels of cars, up to 45 m ahead, at 0, 0.35, 0.75, and 1.1 m or more above road."""


@dataclass(frozen=True)
class RayWorld:
    """Cells straight ahead of a camera, nearest first, and the labels of the camera's pixels.

    Parameters
    ----------
    n_cells : int
        Number of cells, at most 10: the last pixel's table has 2^(K+1) entries.
    prior : float
        P(car) of each cell; otherwise it is road.
    right : float
        Probability that a pixel has the label of the first thing on its ray.
    """

    n_cells: int = 4
    prior: float = 0.2
    right: float = 0.95


def pixel_ray(world: RayWorld | None = None) -> StageGraph:
    """Build the graph of cells and the pixels that equation (1) gives to them on the ground plane.

    Variables are m1 ... mK, what is in each cell, and a1 ... aK, the label of its pixel: 0 road, 1 car. Pixel j looks
    at the ground in cell j, over all cells before it: it shows a car when there is one in any of them.
    """
    world = world or RayWorld()
    cells = [f"m{k}" for k in range(1, world.n_cells + 1)]
    pixels = [f"a{k}" for k in range(1, world.n_cells + 1)]
    factors = [binary(cell, world.prior) for cell in cells]
    factors += [Factor((*cells[: k + 1], pixel), _first_thing(k + 1, world.right)) for k, pixel in enumerate(pixels)]
    return StageGraph(
        "What pixels say of the cells along a ray",
        directed(factors),
        positions=in_rows(cells, (), pixels),
        observed=tuple(pixels),
        equations={cells[-1]: "cells, nearest first", pixels[-1]: "labels of their pixels"},
        cut=CUT_RAY,
    )


def _first_thing(n: int, right: float) -> NDArray[np.float64]:
    """Return P(a | m1 ... mn): the pixel shows a car if there is one in any of the cells."""
    shows = np.array([any(cells) for cells in every_combination((0, 1), repeat=n)]).reshape((2,) * n)
    car = np.where(shows, right, 1 - right)
    return np.stack([1 - car, car], axis=-1)


def exact_ray(labels: Sequence[int], world: RayWorld | None = None) -> NDArray[np.float64]:
    """Return P(car) of each cell given all labels, nearest cell first (0 road, 1 car), with occlusion, (K,)."""
    model = pixel_ray(world or RayWorld(len(labels))).model
    known = {f"a{k}": int(label) for k, label in enumerate(labels, 1)}
    return np.array([eliminate(model, f"m{k}", known).normalised().table[1] for k in range(1, len(labels) + 1)])


def cell_by_cell(labels: Sequence[int], world: RayWorld | None = None) -> NDArray[np.float64]:
    """Return P(car) of each cell given its pixel's label, as if nothing could be in front of it, (K,)."""
    world = world or RayWorld(len(labels))
    likelihood = np.where(np.asarray(labels) == 1, world.right, 1 - world.right)
    car = world.prior * likelihood
    return car / (car + (1 - world.prior) * (1 - likelihood))


def occlusion_cost(world: RayWorld | None = None) -> NDArray[np.float64]:
    """Return |exact - cell by cell| in each cell, on average over all labels, (K,)."""
    world = world or RayWorld()
    model = pixel_ray(world).model
    off = np.zeros(world.n_cells)
    for labels in every_combination((0, 1), repeat=world.n_cells):
        weight = eliminate(model, (), {f"a{k}": label for k, label in enumerate(labels, 1)}).table
        off += weight * np.abs(exact_ray(labels, world) - cell_by_cell(labels, world))
    return off


def pixel_height(height_shares: ArrayLike = CAR_HEIGHTS, prior: float = 0.5) -> StageGraph:
    """Build the graph pixel - height - place: the thing in a pixel has a height, which determines its place on the ray.

    Parameters
    ----------
    height_shares : (N,) float
        P(height | car), the lowest first. The ground has the lowest height.
    prior : float
        Probability that the pixel shows a car.

    Returns
    -------
    StageGraph
        Variables c (0 road, 1 car), h (which height), x (which place along the ray, the farthest first) and a, the
        label of the pixel.
    """
    heights = np.eye(len(height_shares))
    factors = [
        binary("c", prior),
        Factor(("c", "h"), [heights[0], np.asarray(height_shares)]),
        Factor(("h", "x"), heights),
        Factor(("c", "a"), np.eye(2)),
    ]
    return StageGraph(
        "What a pixel shows has a height",
        directed(factors),
        positions={"c": (0.0, 0.0), "h": (2.4, 0.0), "x": (3.6, 0.0), "a": (0.0, -1.0)},
        observed=("a",),
        equations={"x": "place along the ray", "a": "label of the pixel"},
        cut=CUT_HEIGHT,
    )


@cache
def behind_a_car() -> Price:
    """P(car) of the cell behind a car, when the labels are road, car, car, car."""
    labels = [0, 1, 1, 1]
    return Price(exact_ray(labels)[2], cell_by_cell(labels)[2], "P(car) of the cell behind a car")


@cache
def flat_world() -> Price:
    """Probability that a car's pixel shows a point where the ray meets the ground."""
    places = eliminate(pixel_height().model, "x", {"a": 1}).normalised().table
    return Price(places[0], 1.0, "P(a car's pixel shows the ground's place)")


CUT_RAY = (
    CutEdge(
        "m2 -> a3",
        "Equation (1) gives each cell the label of its own pixel, as if nothing could be in front of it, so a car is "
        "drawn in every cell behind it as well: in the cell behind it P(car) becomes 0.83 instead of 0.23.",
        ("m2", "a3"),
        behind_a_car,
    ),
)
"""The edges that equation (1) cuts."""

CUT_HEIGHT = (
    CutEdge(
        "c -> h",
        "On the ground plane every pixel has the height 0, so what a car's pixel shows is drawn where the ray meets "
        "the ground: with probability 1, where the exact probability of that place is 0.03.",
        ("c", "h"),
        flat_world,
    ),
)
"""The edges that the ground plane cuts."""
