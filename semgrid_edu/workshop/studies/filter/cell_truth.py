"""The truth of a simulated street, cell by cell: the states of section 3.2, known instead of estimated."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.frame import blocks
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import State
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.street.traffic import MOVING_SPEED
from semgrid_edu.workshop.simulation.things.materials import Kind

FLAT = (Kind.ROAD, Kind.LANE, Kind.SIDEWALK, Kind.GRASS)
"""The kinds of bare ground."""


@dataclass(frozen=True, eq=False)
class CellTruth:
    """What is true of the cells of a grid at one instant.

    Parameters
    ----------
    state : (H, W) uint8
        FREE, STATIC or DYNAMIC: the truth is never UNKNOWN.
    kind : (H, W) uint8
        What stands in each cell, a `Kind`; the kind of the ground where nothing does.
    instance : (H, W) int32
        Number of the car, pedestrian or bicycle in each cell; 0 for all else.
    velocity : (2, H, W) float32
        Velocity over ground, along x and y of the grid frame, m/s; 0 where nothing moves.
    """

    state: NDArray[np.uint8]
    kind: NDArray[np.uint8]
    instance: NDArray[np.int32]
    velocity: NDArray[np.float32]


def true_cells(drive: SimulatedDrive, time: float, spec: GridSpec) -> CellTruth:
    """Return the truth of a simulated drive at one instant, pooled to a grid by `pool_truth`.

    Parameters
    ----------
    drive : SimulatedDrive
        The drive.
    time : float
        Seconds since it began.
    spec : GridSpec
        The grid: the extent of `LABEL_GRID`, a multiple of its cell.
    """
    return pool_truth(*drive.birdseye(time), drive.velocities(time), spec)


def pool_truth(kinds: NDArray, instances: NDArray, velocities: dict[int, NDArray], spec: GridSpec) -> CellTruth:
    """Pool the truth of 0.1 m cells to a coarser grid.

    A cell takes what covers most of it, bare ground left aside. So a cell in which anything stands isn't free, even if
    that is a thin pole in a single fine cell.

    Parameters
    ----------
    kinds : (710, 310) uint8
        What each cell of `LABEL_GRID` holds, members of `Kind`.
    instances : (710, 310) int
        Number of the object in each of these cells, 0 for none.
    velocities : dict of int to (2,) float
        Velocity over ground of each object that may move, by its number: along x and y of the grid frame, m/s.
    spec : GridSpec
        The coarser grid: the extent of `LABEL_GRID`, a multiple of its cell.

    Returns
    -------
    CellTruth

    Raises
    ------
    ArgumentError
        When `spec` isn't a coarsening of `LABEL_GRID`.
    """
    numbers = np.int64(instances) * 256 + kinds  # what is there, as one number
    chosen = _most_frequent(blocks(numbers, spec), blocks(np.isin(kinds, FLAT), spec))
    instance, kind = np.divmod(chosen, 256)
    speeds = np.zeros((instance.max() + 1, 2), np.float32)
    for number, velocity in velocities.items():
        if number < len(speeds):
            speeds[number] = velocity
    velocity = np.moveaxis(speeds[instance], -1, 0)
    standing = np.where(np.hypot(*velocity) > MOVING_SPEED, State.DYNAMIC, State.STATIC)
    state = np.where(np.isin(kind, FLAT), State.FREE, standing)
    return CellTruth(state.astype(np.uint8), kind.astype(np.uint8), instance.astype(np.int32), velocity)


def _most_frequent(numbers: NDArray, flat: NDArray) -> NDArray[np.int64]:
    """Return the most frequent number in each block, (H, W, K) -> (H, W); a flat one only where all are flat.

    Between two equally frequent numbers the larger one wins.
    """
    ranked = np.where(flat & ~flat.all(axis=-1, keepdims=True), -1, numbers)
    count = (ranked[..., :, None] == ranked[..., None, :]).sum(axis=-1)
    best = np.where(ranked < 0, -1, count * (ranked.max() + 1) + ranked).argmax(axis=-1)
    return np.take_along_axis(numbers, best[..., None], axis=-1)[..., 0]
