"""The evidence of pixels about the cells along their rays, and how a reader cell by cell takes it.

A camera sees the first thing on each ray. Equation (1) gives every cell a pixel, even if something is in front of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product as every_combination

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical import Factor, eliminate, in_rows
from worlds.lecture_00_stage_graph import StageGraph, binary, directed


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
