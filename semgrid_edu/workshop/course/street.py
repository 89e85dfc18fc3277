"""Measurements on a labelled street, shared by lectures 13 and 14 with their exercises and hidden tests.

A score on one street has an interval if its cells are counted by pieces of street. Students don't have the `worlds`
folder, so the code that exercises import is here.
"""

from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import invert_rigid, transform_points
from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.grid_truth import truth_to_learn
from semgrid_edu.datasets.samples import real_drive, sample_weights
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.networks import load_net
from semgrid_edu.occupancy import N_STATES, PlanarMotion
from semgrid_edu.occupancy.planar_motion import look_up
from semgrid_edu.pipeline import FrameResult, run_pipeline

PIECE = 8.0
"""Length and width of a piece of street, metres."""

STANDING = (0.5, 3.0)
"""Heights above the ground between which returns come from upright things, such as walls and poles, metres."""

COMPARED = (3.0, 40.0)
"""Distances between which two scans are compared, metres. Beyond, neighbouring beams are too far apart."""


@cache
def street_results(drive: FrameSequence | None, stop: int) -> tuple[tuple[FrameResult, ...], GridSpec]:
    """Run the pipeline on a drive's first frames, with the network that knows simulated streets only.

    This is done once in a process. All submissions that a process grades share it, so its grids are read-only.

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
    """Return the class of each cell to which the labels give a semantic class.

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
    """Return the piece of street of each cell of each frame, counted from 0, (F, H, W).

    Frames of one drive show the same things again, so neither frames nor cells are independent. Pieces of the street
    are the best that a single drive has; an object on the border of two pieces is in both.

    Parameters
    ----------
    frames : sequence of Frame
        Frames of a drive, whose poses place the grid.
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

    For each state it takes the class that is most frequent in these very cells: no other table of states is right in
    more of them.

    Parameters
    ----------
    truths : (F, H, W) int
        True classes, 255 where a cell doesn't count.
    beliefs : sequence of (4, H, W) float
        The occupancy grids.
    """
    states = np.stack(beliefs).argmax(axis=1)
    counts = np.zeros((N_STATES, len(KITTI_14)), np.int64)
    counted = truths != IGNORE
    np.add.at(counts, (states[counted], truths[counted]), 1)
    return counts.argmax(axis=1)[states]


def standing_points(frame: Frame) -> NDArray[np.float64]:
    """Return the returns from upright things, (n, 3), metres in the LIDAR frame; moving cars are among them.

    Parameters
    ----------
    frame : Frame
        Its scan and the LIDAR's height are used.
    """
    height = frame.points_grid[:, 2]
    distance = np.hypot(*frame.points[:, :2].T)
    chosen = (height > STANDING[0]) & (height < STANDING[1]) & (distance > COMPARED[0]) & (distance < COMPARED[1])
    return frame.points[chosen, :3].astype(np.float64)


def motion_between(before: Frame, now: Frame) -> NDArray[np.float64]:
    """Return the motion of the LIDAR between two frames according to their poses: T_before_from_now, (4, 4), metres.

    Parameters
    ----------
    before, now : Frame
        Two frames of a drive.
    """
    return invert_rigid(before.T_world_from_lidar) @ now.T_world_from_lidar


def frames_since_seen(frames: Sequence[Frame], spec: GridSpec) -> NDArray[np.int64]:
    """Return how many frames ago the camera last saw each cell, (F, H, W): 0 for now, -1 for never.

    Parameters
    ----------
    frames : sequence of F Frame
        Labelled frames, in the order of time.
    spec : GridSpec
        The grid, (H, W) cells.
    """
    since = np.full((len(frames), *spec.shape), -1)
    for now, ago, seen in cells_seen(frames, spec):
        since[now, seen & (since[now] < 0)] = ago
    return since


def cells_seen(frames: Sequence[Frame], spec: GridSpec) -> Iterator[tuple[int, int, NDArray[np.bool_]]]:
    """Yield for each frame, and each frame up to it, which of its cells the camera saw then.

    Parameters
    ----------
    frames, spec : sequence of Frame, GridSpec
        As `frames_since_seen` takes them.

    Yields
    ------
    now, ago : int
        The number of the frame, and how many frames before it the camera looked.
    seen : (H, W) bool
        The cells of the frame's grid that it saw.
    """
    visible = [frame.labels.visible_on(spec)[None].astype(np.float32) for frame in frames]
    for now, frame in enumerate(frames):
        for ago in range(now + 1):
            motion = PlanarMotion.from_poses(frames[now - ago].T_world_from_lidar, frame.T_world_from_lidar)
            yield now, ago, look_up(visible[now - ago], np.zeros(1, np.float32), spec, spec, motion)[0] > 0
