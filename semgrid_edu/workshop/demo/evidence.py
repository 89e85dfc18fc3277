"""What scan, pixels and earlier frames say about the cells of a frame (section 3.2)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.frame import Frame, FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE
from semgrid_edu.occupancy import PlanarMotion, SensorModel
from semgrid_edu.occupancy.planar_motion import look_up
from semgrid_edu.occupancy.polar import beams_of
from semgrid_edu.occupancy.steps import NOTHING_KNOWN
from semgrid_edu.pipeline import FrameResult

VERDICTS = ("silent", "passed", "ground", "hit")
"""What a scan can say about a cell, see `ScanMaps.verdict`."""


class ScanMaps(NamedTuple):
    """What one scan says about each cell, and why.

    Parameters
    ----------
    obstacles, ground : (H, W) int
        How many returns of obstacles and of the ground each cell holds. Returns above `obstacle_max` are neither.
    distance, reach : (H, W) float
        How far the cell's centre is from the LIDAR, and how far the beam through it sees, metres: to its first
        obstacle, else to its last ground return; 0 where nothing came back.
    verdict : (H, W) int
        What the scan says, as an index of `VERDICTS`. "silent": nothing. "passed": the beam passes the cell from end
        to end. "ground": the ground was seen in it. "hit": an obstacle was hit, which overrules the others.
    """

    obstacles: NDArray[np.int64]
    ground: NDArray[np.int64]
    distance: NDArray[np.float64]
    reach: NDArray[np.float32]
    verdict: NDArray[np.int64]


def scan_maps(points: NDArray, spec: GridSpec, sensor: SensorModel) -> ScanMaps:
    """Look up every cell in a scan.

    Parameters
    ----------
    points : (N, 3+) float
        The scan: x forward, y left, z above the ground (m), in the grid frame of the vehicle.
    spec : GridSpec
        The grid, (H, W).
    sensor : SensorModel
        The sensor that took the scan.
    """
    scan = sensor.scan(points)
    evidence = scan.evidence(spec, PlanarMotion())
    x, y = np.moveaxis(spec.centers(), -1, 0)
    distance = np.hypot(x, y)
    reach = scan.reach[beams_of(x.ravel(), y.ravel(), len(scan.reach))].reshape(spec.shape)
    hit = evidence.occupied > evidence.free
    silent = evidence.occupied == evidence.free
    passed = reach - distance >= spec.cell / 2
    numbers = [VERDICTS.index(word) for word in ("hit", "silent", "passed")]
    verdict = np.select([hit, silent, passed], numbers, VERDICTS.index("ground"))
    height = scan.points[:, 2]
    obstacles = (height >= sensor.obstacle_min) & (height <= sensor.obstacle_max)
    ground = height < sensor.obstacle_min
    counts = (_count(scan.points[kind], spec) for kind in (obstacles, ground))
    return ScanMaps(*counts, distance, reach, verdict)


def _count(points: NDArray, spec: GridSpec) -> NDArray[np.int64]:
    """Return how many points each cell holds."""
    rows, cols, inside = spec.cells(points)
    numbers = (rows * spec.shape[1] + cols)[inside]
    return np.bincount(numbers, minlength=spec.shape[0] * spec.shape[1]).reshape(spec.shape)


def classes_at(result: FrameResult, pixels: NDArray, visible: NDArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return what the image network calls the pixels nearest to some points, and what these pixels show.

    Parameters
    ----------
    result : FrameResult
        The frame's result.
    pixels, visible : (..., 2) float, (...) bool
        Where the points are seen in the frame's image (u, v), and whether they are, from `plane_pixels`.

    Returns
    -------
    called, shown : (...) int64
        The class with the highest score, and the true one; 255 where the camera doesn't see the point, and in `shown`
        where nobody labelled the pixel.
    """
    size = np.array(result.scores.shape[1:])
    labels = result.frame.labels
    scale = size / np.array(result.frame.camera.size)
    nearest = np.rint((np.where(visible[..., None], pixels, 0) + 0.5) * scale[::-1] - 0.5).astype(np.int64)
    u, v = np.moveaxis(np.clip(nearest, 0, size[::-1] - 1), -1, 0)
    truth = np.full(size, IGNORE) if labels is None else pixel_truth(labels, tuple(size.tolist()))
    called = np.where(visible, result.scores.argmax(axis=0)[v, u], IGNORE)
    shown = np.where(visible, truth[v, u], IGNORE)
    return called.astype(np.int64), shown.astype(np.int64)


def pixel_truth(labels: FrameLabels, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the true class of each pixel of an image of another size; 255 where it isn't labelled.

    Parameters
    ----------
    labels : FrameLabels
        The labels of the frame.
    size : (int, int)
        Height and width, pixels.
    """
    return resize_labels(labels.image, size, sparse=labels.undecided is not None)


def place_history(
    results: Sequence[FrameResult], spec: GridSpec, cell: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Look up what was believed, frame after frame, about the place that a cell of the last frame covers.

    The vehicle moves, so the place belongs to another cell in each frame. It is the cell that contains the centre of
    the last frame's cell, found through the poses.

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
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN; they sum to 1. UNKNOWN where the place was outside the grid.
    """
    now = results[-1].frame
    states = []
    for result in results:
        motion = PlanarMotion.from_poses(result.frame.T_world_from_lidar, now.T_world_from_lidar)
        (row,), (col,), (inside,) = spec.cells(motion.parent_from_child(spec.centers()[cell])[None])
        states.append(result.belief.probability[:, row, col] if inside else NOTHING_KNOWN)
    return np.array([result.frame.time for result in results]), np.stack(states, axis=1)


class Sight(NamedTuple):
    """When a frame by itself last gave the place of each cell a semantic class, and which.

    Parameters
    ----------
    back : (H, W) int64
        How many frames ago: 0 for the last frame itself, -1 if none of the frames did.
    seconds : (H, W) float64
        How long ago that was; 0 if no frame did.
    label : (H, W) int64
        The class; where there was none, that of the last frame.
    """

    back: NDArray[np.int64]
    seconds: NDArray[np.float64]
    label: NDArray[np.int64]


def last_sight(seen: Sequence[tuple[Frame, NDArray]], spec: GridSpec, n_semantic: int) -> Sight:
    """Look up the place of each cell of the last frame in the earlier ones, the newest first.

    Parameters
    ----------
    seen : sequence of (Frame, (H, W) int)
        The frames in the order of time, each with the most probable class of each cell by that frame alone.
    spec : GridSpec
        The grid of all of them.
    n_semantic : int
        Number of semantic classes, which come first.
    """
    now, labels = seen[-1]
    back = np.full(spec.shape, -1)
    seconds = np.zeros(spec.shape)
    label = labels.astype(np.int64)
    for ago, (frame, then) in enumerate(reversed(seen)):
        motion = PlanarMotion.from_poses(frame.T_world_from_lidar, now.T_world_from_lidar)
        there = look_up(np.float32(then)[None], np.float32([n_semantic]), spec, spec, motion)[0]
        found = (back < 0) & (there < n_semantic)
        back[found] = ago
        seconds[found] = now.time - frame.time
        label[found] = there[found]
    return Sight(back, seconds, label)
