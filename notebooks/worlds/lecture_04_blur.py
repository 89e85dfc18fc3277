"""How much a map blurs when it moves with the vehicle: three schemes compared (paper, section 3.2, step 1)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.special import entr

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion, look_up, scroll

SCHEMES = ("bilinear", "nearest", "scrolling")
"""Ways to move a map by less than a cell, as `measure_blur` explains them."""
WORLD = GridSpec(-5, 24, -9, 14, 0.2)
"""A map large enough to contain the surroundings of the start until the end of `winding_road`."""
SQUARE = 1.0
"""Side of the squares of the chequerboard, metres."""
MARGIN = 1.5
"""Least distance of drops from the map's borders, metres, so that hardly any ink crosses them."""


class Blur(NamedTuple):
    """How much a moving map has blurred, after each of T steps.

    Parameters
    ----------
    entropy : (T,) float
        Mean entropy of the cells of a chequerboard, bits: 0 while each is certain, 1 when all are grey.
    left : (T,) float
        Share of the ink that is no longer in the right cell, 0..1.
    displacement : (T,) float
        Distance of the ink from its right place, root mean square, metres.
    """

    entropy: NDArray[np.float64]
    left: NDArray[np.float64]
    displacement: NDArray[np.float64]


def winding_road(steps: int = 50, turn: float = 0.013) -> list[PlanarMotion]:
    """Return the motions of a vehicle that accelerates from 2 to 5 m/s, at ten steps per second, while it turns.

    Parameters
    ----------
    steps : int
        Number of steps.
    turn : float
        Change of direction in each step, to the left, rad.

    Returns
    -------
    list of PlanarMotion
        One per step.
    """
    return [PlanarMotion(float(dx), 0.0, turn) for dx in np.linspace(0.2, 0.5, steps)]


def measure_blur(scheme: str, motions: Sequence[PlanarMotion], drops: int = 20, seed: int = 0) -> Blur:
    """Move the map of a still world along with a vehicle, and measure how it blurs.

    The map neither forgets nor sees anything, so it changes only because its cells move. It contains a chequerboard
    and, each in a separate map, drops of ink: single cells with value 1.

    Parameters
    ----------
    scheme : str
        One of `SCHEMES`. "bilinear": in each step, every cell takes the mean of the four old cells around its centre,
        weighted by how near they are. "nearest": in each step, every cell takes the value of the old cell that contains
        its centre. "scrolling": as `Cmcdot` moves its maps, by whole cells, while the vehicle turns in the map.
    motions : sequence of PlanarMotion
        Motions of the vehicle, T of them; some of the cells at the start must stay in the map at every step.
    drops : int
        Number of drops.
    seed : int
        Seed for the places where they fall.

    Returns
    -------
    Blur
        The blur of the map itself. Reading a scrolling map at the vehicle's cells takes one more look-up, which adds a
        displacement of cell / sqrt(6) once, whatever the number of steps.
    """
    held = _always_held(motions)
    row, col = np.random.default_rng(seed).permutation(np.argwhere(held))[:drops].T
    fields = np.zeros((len(row) + 1, *WORLD.shape), np.float32)
    fields[np.arange(len(row)), row, col] = 1
    fields[-1] = np.floor(WORLD.centers() / SQUARE).sum(axis=-1) % 2
    start = WORLD.centers()[row, col]
    rest = PlanarMotion()
    T_start_from_map = PlanarMotion()
    measured = []
    for motion in motions:
        pose = rest.then(motion)
        moved, rest = scroll(pose, WORLD.cell) if scheme == "scrolling" else (pose, PlanarMotion())
        fields = _carry(scheme, fields, moved)
        T_start_from_map = T_start_from_map.then(moved)
        measured.append(_measure(fields, T_start_from_map, start, held))
    return Blur(*np.array(measured).T)


def _always_held(motions: Sequence[PlanarMotion]) -> NDArray[np.bool_]:
    """Return which cells of the first map stay in the map, `MARGIN` metres or more from its borders, (H, W)."""
    held = np.ones(WORLD.shape, bool)
    pose = PlanarMotion()
    low = WORLD.x_min, WORLD.y_min
    high = WORLD.x_max, WORLD.y_max
    for motion in [PlanarMotion(), *motions]:
        pose = pose.then(motion)
        place = pose.to_now(WORLD.centers())
        held &= ((place > np.add(low, MARGIN)) & (place < np.subtract(high, MARGIN))).all(axis=-1)
    return held


def _carry(scheme: str, fields: NDArray[np.float32], moved: PlanarMotion) -> NDArray[np.float32]:
    """Express fields (K, H, W) in the frame whose pose is `moved`; what enters is 0."""
    if scheme != "bilinear":
        return look_up(fields, np.zeros(len(fields), np.float32), WORLD, WORLD, moved)
    index = ((WORLD.x_max, WORLD.y_max) - moved.to_previous(WORLD.centers())) / WORLD.cell - 0.5
    return np.stack([map_coordinates(field, np.moveaxis(index, -1, 0), order=1) for field in fields])


def _measure(fields: NDArray, T_start_from_map: PlanarMotion, start: NDArray, held: NDArray) -> tuple[float, ...]:
    """Return entropy, share that left its cell, and displacement of what is in the fields."""
    place = T_start_from_map.to_previous(WORLD.centers())
    rows, cols, inside = WORLD.cells(place.reshape(-1, 2))
    grey = fields[-1].ravel()[inside & held[rows, cols]]
    entropy = (entr(grey) + entr(1 - grey)).mean() / np.log(2)
    ink = fields[:-1]
    rows, cols, _ = WORLD.cells(T_start_from_map.to_now(start))
    stayed = ink[np.arange(len(ink)), rows, cols].sum() / ink.sum()
    distance2 = ((place - start[:, None, None]) ** 2).sum(axis=-1)
    return entropy, 1 - stayed, np.sqrt((ink * distance2).sum() / ink.sum())
