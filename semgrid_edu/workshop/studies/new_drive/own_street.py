"""A map of one's own street against its labels: cells counted by pieces of street, so that a score has an interval."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import transform_points
from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.grid_truth import truth_to_learn
from semgrid_edu.datasets.samples import real_drive, sample_weights
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.networks import load_net
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.pipeline import FrameResult, run_pipeline

PIECE = 8.0
"""Length and width of a piece of street, metres."""


@cache
def street_results(drive: FrameSequence | None, stop: int) -> tuple[tuple[FrameResult, ...], GridSpec]:
    """Run the pipeline on a drive's first frames, with the network that knows simulated streets only.

    This is done once in a process. Whoever grades many submissions shares it among them, so its grids can't be written.

    Parameters
    ----------
    drive : FrameSequence or None
        The drive; None for the real street that ships.
    stop : int
        The number of frames.

    Returns
    -------
    results : tuple of FrameResult
        What every stage made of each frame.
    spec : GridSpec
        The grid.
    """
    drive = real_drive() if drive is None else drive
    net = load_net(sample_weights(), drive.camera)
    results = tuple(run_pipeline(drive[:stop], net))
    for result in results:
        result.grid.setflags(write=False)
        result.belief.probability.setflags(write=False)
    return results, net.architecture.grid


def semantic_truths(drive: FrameSequence, beliefs: Sequence[NDArray], spec: GridSpec) -> NDArray[np.uint8]:
    """Return the class of each cell in which the labels name one of the classes that stand or lie in a street.

    Parameters
    ----------
    drive : FrameSequence
        A drive with labels of KITTI-14 in its first frames.
    beliefs : sequence of (4, H, W) float
        The occupancy grids of these frames.
    spec : GridSpec
        The grid.

    Returns
    -------
    (F, H, W) uint8
        Classes of KITTI-14; 255 where a cell is unknown or nobody labelled it.
    """
    truths = np.stack([truth_to_learn(drive, k, belief, spec) for k, belief in enumerate(beliefs)])
    return np.where(truths < KITTI_14.n_semantic, truths, np.uint8(IGNORE))


def street_pieces(frames: Sequence[Frame], spec: GridSpec) -> NDArray[np.int64]:
    """Return the piece of street in which each cell of each frame lies, counted from 0, (F, H, W).

    Frames of one drive show the same things again, so neither frames nor cells are independent. Pieces of the street
    are the most that a single drive has; what stands on the border of two of them is in both.

    Parameters
    ----------
    frames : sequence of Frame
        Frames of a drive, whose poses say where the grid lies.
    spec : GridSpec
        The grid.
    """
    on_ground = np.dstack([spec.centers(), np.zeros(spec.shape)]).reshape(-1, 3)
    places = np.stack([transform_points(frame.T_world_from_lidar, on_ground)[:, :2] for frame in frames])
    squares = np.floor(places / PIECE).astype(np.int64).reshape(-1, 2)
    return np.unique(squares, axis=0, return_inverse=True)[1].reshape(len(frames), *spec.shape)


def piece_confusions(truths: NDArray, called: NDArray, pieces: NDArray) -> NDArray[np.int64]:
    """Count the cells of each piece of street, as `drive_interval` takes one seed and V drives.

    Parameters
    ----------
    truths, called : (F, H, W) int
        True classes, 255 where a cell doesn't count, and the classes of a map.
    pieces : (F, H, W) int
        From `street_pieces`.

    Returns
    -------
    (1, V, C, C) int64
        Row: truth. Pieces without a cell that counts are left out.
    """
    some = np.unique(pieces[truths != IGNORE])
    return np.stack([confusion_matrix(truths[pieces == v], called[pieces == v], len(KITTI_14)) for v in some])[None]


def best_table(truths: NDArray, beliefs: Sequence[NDArray]) -> NDArray[np.int64]:
    """Return the map of a table that knows only the most probable occupancy state of a cell, (F, H, W).

    For each state it says the class that is most frequent among these very cells: no other table of states is right in
    more of them.

    Parameters
    ----------
    truths : (F, H, W) int
        True classes, 255 where a cell doesn't count.
    beliefs : sequence of (4, H, W) float
        The occupancy grids.
    """
    states, counts = np.stack(beliefs).argmax(axis=1), np.zeros((N_STATES, len(KITTI_14)), np.int64)
    counted = truths != IGNORE
    np.add.at(counts, (states[counted], truths[counted]), 1)
    return counts.argmax(axis=1)[states]
