"""What pixels say of the cells that read them and of each other, and what the system makes of it (lectures 05 to 07).

A camera sees the first thing on each ray. Equation (1) gives every cell a pixel, whatever stands in front of the cell,
and a plane gives every pixel one height, whatever height the pixel shows. Cells that read one pixel share its error.
And pixels along a post have one label, which a soft-max per pixel doesn't know.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from itertools import product as every_combination

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError, check_fields
from semgrid_edu.graphical.exact import eliminate
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.layout import in_rows
from semgrid_edu.stage_models.stage_graph import StageGraph, binary, cut_edges, directed, with_gaps

CAR_HEIGHTS = (0.03, 0.18, 0.32, 0.47)
"""The shipped drive: shares of the pixels of cars, up to 45 m ahead, at 0, 0.35, 0.75, and 1.1 m or more above road."""


@dataclass(frozen=True)
class RayWorld:
    """Cells straight ahead of a camera, nearest first, and what the camera's pixels say.

    Parameters
    ----------
    n_cells : int
        Number of cells, at most 10: the last pixel's table has 2^(K+1) entries.
    prior : float
        P(car) of each cell; otherwise it is road.
    right : float
        Probability that a pixel's label is that of the first thing on its ray.
    """

    n_cells: int = 4
    prior: float = 0.2
    right: float = 0.95

    def __post_init__(self) -> None:
        """Refuse what the graph can't hold."""
        check_fields(self, "from 1 to 10", lambda n: 1 <= n <= 10, "n_cells")
        check_fields(self, "a probability", lambda p: 0 <= p <= 1, "prior", "right")


def pixel_ray(world: RayWorld | None = None) -> StageGraph:
    """Build the graph of cells and the pixels that equation (1) gives to them on the ground plane.

    Pixel j looks at the ground in cell j, over all cells before it: it shows a car when one stands in any of them.

    Parameters
    ----------
    world : RayWorld, optional
        The cells and the pixels; the defaults when left out.

    Returns
    -------
    StageGraph
        Variables m1 ... mK, what stands in each cell, and a1 ... aK, the label of its pixel: 0 road, 1 car.
    """
    world = world or RayWorld()
    cells, pixels = ([f"{letter}{k}" for k in range(1, world.n_cells + 1)] for letter in "ma")
    factors = [binary(cell, world.prior) for cell in cells]
    factors += [Factor((*cells[: k + 1], pixel), _first_thing(k + 1, world.right)) for k, pixel in enumerate(pixels)]
    return StageGraph(
        "What pixels say of the cells along a ray",
        directed(factors),
        observed=tuple(pixels),
        positions=in_rows(cells, (), pixels),
        equations={cells[-1]: "cells, nearest first", pixels[-1]: "labels of their pixels"},
        cut=cut_edges("pixel"),
    )


def _first_thing(n: int, right: float) -> NDArray[np.float64]:
    """Return P(a | m1 ... mn): a car in any of the cells is what the pixel shows."""
    shows = np.array([any(cells) for cells in every_combination((0, 1), repeat=n)]).reshape((2,) * n)
    car = np.where(shows, right, 1 - right)
    return np.stack([1 - car, car], axis=-1)


def exact_ray(labels: Sequence[int], world: RayWorld | None = None) -> NDArray[np.float64]:
    """Return P(car) of each cell given all labels, with occlusion, (K,).

    Parameters
    ----------
    labels : sequence of int
        The label of each pixel, nearest cell first: 0 road, 1 car.
    world : RayWorld, optional
        The cells and the pixels; the defaults, with one cell per label, when left out.
    """
    world = world or RayWorld(len(labels))
    if len(labels) != world.n_cells or not set(labels) <= {0, 1}:
        raise ArgumentError("labels", f"{world.n_cells} labels, 0 or 1", labels)
    model = pixel_ray(world).model
    known = {f"a{k}": int(label) for k, label in enumerate(labels, 1)}
    return np.array([eliminate(model, (f"m{k}",), known).normalised().table[1] for k in range(1, world.n_cells + 1)])


def cell_by_cell(labels: Sequence[int], world: RayWorld | None = None) -> NDArray[np.float64]:
    """Return P(car) of each cell given the label of its own pixel, as if nothing could stand in front of it, (K,).

    Parameters are those of `exact_ray`.
    """
    world = world or RayWorld(len(labels))
    likelihood = np.where(np.asarray(labels) == 1, world.right, 1 - world.right)
    car = world.prior * likelihood
    return car / (car + (1 - world.prior) * (1 - likelihood))


def occlusion_cost(world: RayWorld | None = None) -> NDArray[np.float64]:
    """Return by how much the two differ in each cell, |exact - cell by cell|, on average over all labels, (K,).

    Parameters are those of `pixel_ray`.
    """
    world = world or RayWorld()
    model, off = pixel_ray(world).model, np.zeros(world.n_cells)
    for labels in every_combination((0, 1), repeat=world.n_cells):
        weight = eliminate(model, (), {f"a{k}": label for k, label in enumerate(labels, 1)}).table
        off += weight * np.abs(exact_ray(labels, world) - cell_by_cell(labels, world))
    return off


def pixel_height(height_shares: ArrayLike = CAR_HEIGHTS, prior: float = 0.5) -> StageGraph:
    """Build the graph pixel - height - place: what a pixel shows has a height, and the height says where it is.

    Parameters
    ----------
    height_shares : (N,) float
        P(height | car), the lowest first; sums to 1. The drive's when left out. The ground has the lowest height.
    prior : float
        Probability that the pixel shows a car.

    Returns
    -------
    StageGraph
        Variables c (0 road, 1 car), h (which height), x (which place along the ray, the farthest first) and a, the
        label of the pixel.
    """
    shares = np.asarray(height_shares, float)
    if shares.ndim != 1 or (shares < 0).any() or not np.isclose(shares.sum(), 1):
        raise ArgumentError("height_shares", "probabilities that sum to 1, shape (N,)", shares)
    ground = np.eye(len(shares))[0]
    factors = [binary("c", prior), Factor(("c", "h"), [ground, shares]), Factor(("h", "x"), np.eye(len(shares)))]
    return StageGraph(
        "What a pixel shows has a height",
        directed([*factors, Factor(("c", "a"), np.eye(2))]),
        observed=("a",),
        positions={"c": (0.0, 0.0), "h": (2.4, 0.0), "x": (3.6, 0.0), "a": (0.0, -1.0)},
        equations={"x": "place along the ray", "a": "label of the pixel"},
        cut=cut_edges("height"),
    )


def shared_pixel(readers: int = 4, right: float = 0.8, prior: float = 0.5) -> StageGraph:
    """Build the graph of a patch of ground, the pixel that shows it, and the cells that read this pixel.

    Parameters
    ----------
    readers : int
        Number of cells that read the pixel, from 1 to 12.
    right : float
        Probability that the pixel shows what lies there.
    prior : float
        Probability that a car stands there; otherwise it is road.

    Returns
    -------
    StageGraph
        Variables m (what lies there), a (the label of the pixel) and x1, x2, ... (what each cell reads): 0 road, 1 car.
    """
    if not 1 <= readers <= 12:
        raise ArgumentError("readers", "from 1 to 12", readers)
    cells = [f"x{k}" for k in range(1, readers + 1)]
    pixel = Factor(("m", "a"), [[right, 1 - right], [1 - right, right]])
    factors = [binary("m", prior), pixel, *(Factor(("a", cell), np.eye(2)) for cell in cells)]
    return StageGraph(
        f"{readers} cells read one pixel",
        directed(factors),
        observed=tuple(cells),
        positions=in_rows(["m"], ["a"], with_gaps(cells)),  # room for the price between two arrows
        equations={"m": "what lies there", "a": "the pixel", cells[-1]: "what the cells read"},
        cut=cut_edges("planes"),
    )


def believed_by_readers(readers: int = 4, right: float = 0.8, prior: float = 0.5) -> NDArray[np.float64]:
    """Return P(car) when all cells read "car": exactly, and as if each reading had an error of its own, (2,).

    Parameters are those of `shared_pixel`.
    """
    model = shared_pixel(readers, right, prior).model
    exact = eliminate(model, ("m",), {f"x{k}": 1 for k in range(1, readers + 1)}).normalised().table[1]
    car, road = prior * right**readers, (1 - prior) * (1 - right) ** readers
    return np.array([exact, car / (car + road)])


def post_pixels(pixels: int = 5, stays: float = 0.8, lead: float = 1.0) -> StageGraph:
    """Build the graph of the labels of neighbouring pixels along a post, and what a network says of each.

    Parameters
    ----------
    pixels : int
        Number of pixels, at least 1.
    stays : float
        Probability that the next pixel has the same label.
    lead : float
        By how much the network's score of the class it names leads, so that it is right with probability
        1 / (1 + exp(-lead)).

    Returns
    -------
    StageGraph
        Variables x1, x2, ... (the labels: 0 something else, 1 post) and s1, s2, ... (the class with the larger score).
    """
    if pixels < 1:
        raise ArgumentError("pixels", "at least 1", pixels)
    labels, scores = ([f"{letter}{k}" for k in range(1, pixels + 1)] for letter in "xs")
    right = 1 / (1 + np.exp(-lead))
    factors = [binary(labels[0], 0.5)]
    factors += [Factor(pair, [[stays, 1 - stays], [1 - stays, stays]]) for pair in pairwise(labels)]
    factors += [Factor(pair, [[right, 1 - right], [1 - right, right]]) for pair in zip(labels, scores, strict=True)]
    return StageGraph(
        "Labels of pixels along a post",
        directed(factors),
        observed=tuple(scores),
        positions=in_rows(with_gaps(labels), (), with_gaps(scores)),
        equations={labels[-1]: "labels of the pixels", scores[-1]: "what the scores say"},
        cut=cut_edges("network"),
    )


def believed_of_post(says: Sequence[int], stays: float = 0.8, lead: float = 1.0) -> NDArray[np.float64]:
    """Return P(post) of each pixel: exactly, and by a soft-max of its own scores alone, (2, K).

    Parameters
    ----------
    says : (K,) int
        The class with the larger score in each pixel: 0 something else, 1 post.
    stays, lead : float
        Those of `post_pixels`.
    """
    model = post_pixels(len(says), stays, lead).model
    known = {f"s{k}": int(one) for k, one in enumerate(says, 1)}
    exact = [eliminate(model, (f"x{k}",), known).normalised().table[1] for k in range(1, len(says) + 1)]
    alone = 1 / (1 + np.exp(-lead * (2 * np.asarray(says) - 1)))
    return np.array([exact, alone])
