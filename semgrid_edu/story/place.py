"""One place on the ground in the beliefs of earlier frames, while the vehicle drives on (paper, section 3.2)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import PlanarMotion
from semgrid_edu.occupancy.steps import NOTHING_KNOWN
from semgrid_edu.pipeline import FrameResult


def place_history(
    results: Sequence[FrameResult], spec: GridSpec, cell: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Look up what was believed, frame after frame, of the place in which a cell of the last frame lies.

    The vehicle moves, so the place lies in another cell at each frame. It is the cell that holds the centre of the last
    frame's cell, found through the poses.

    Parameters
    ----------
    results : sequence of FrameResult
        The results of T frames in the order of time.
    spec : GridSpec
        The grid of all of them.
    cell : (int, int)
        Row and column of the cell in the last frame.

    Returns
    -------
    times : (T,) float64
        The times of the frames, seconds.
    probability : (4, T) float32
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN; they sum to 1. Where the place lay outside the grid, UNKNOWN.
    """
    now, states = results[-1].frame, []
    for result in results:
        motion = PlanarMotion.from_poses(result.frame.T_world_from_lidar, now.T_world_from_lidar)
        (row,), (col,), (inside,) = spec.cells(motion.to_previous(spec.centers()[cell])[None])
        states.append(result.belief.probability[:, row, col] if inside else NOTHING_KNOWN)
    return np.array([result.frame.time for result in results]), np.stack(states, axis=1)
