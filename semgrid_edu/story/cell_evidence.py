"""What scan and pixels say of cells, and what was believed and seen of a place on the way (section 3.2)."""

from collections.abc import Sequence
from dataclasses import dataclass
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
"""What a scan can say of a cell, see `ScanMaps.verdict`."""


@dataclass(frozen=True, eq=False)
class ScanMaps:
    """What one scan says of each cell, and why.

    Parameters
    ----------
    points : (M, 3) float
        The returns that count: x and y in the grid frame, height above the ground, metres.
    obstacle, ground : (M,) bool
        Which of them come from obstacles, and which from the ground. Returns from above `obstacle_max` are neither.
    distance, reach : (H, W) float
        Distance of each cell's centre from the LIDAR, and how far the beam through it sees, metres: to its first
        obstacle, else to its last ground return; 0 where nothing came back.
    occupied, free : (H, W) float32
        P(z | occupied) and P(z | free) of `Scan.evidence`; equal where the scan says nothing.
    verdict : (H, W) int
        What the scan says, as an index of `VERDICTS`. "silent": nothing. "passed": the beam passes the cell from end to
        end. "ground": the ground was seen in it. "hit": an obstacle was hit, which overrules the others.
    """

    points: NDArray[np.floating]
    obstacle: NDArray[np.bool_]
    ground: NDArray[np.bool_]
    distance: NDArray[np.float64]
    reach: NDArray[np.float32]
    occupied: NDArray[np.float32]
    free: NDArray[np.float32]
    verdict: NDArray[np.int64]


def scan_maps(points: NDArray, spec: GridSpec, sensor: SensorModel) -> ScanMaps:
    """Ask a scan about every cell.

    Parameters
    ----------
    points : (N, 3+) float
        The scan: x forward, y left, z above the ground (m), in the grid frame of the vehicle.
    spec : GridSpec
        The grid, (H, W).
    sensor : SensorModel
        The sensor that took the scan.

    Returns
    -------
    ScanMaps
        The evidence, and what it rests on.

    Raises
    ------
    ArgumentError
        When `points` isn't a table of finite coordinates.
    """
    scan = sensor.scan(points)
    evidence, height = scan.evidence(spec, PlanarMotion()), scan.points[:, 2]
    x, y = np.moveaxis(spec.centers(), -1, 0)
    distance = np.hypot(x, y)
    reach = scan.reach[beams_of(x.ravel(), y.ravel(), len(scan.reach))].reshape(spec.shape)
    says = [evidence.occupied > evidence.free, evidence.free <= evidence.occupied, reach - distance >= spec.cell / 2]
    verdict = np.select(says, [VERDICTS.index(word) for word in ("hit", "silent", "passed")], VERDICTS.index("ground"))
    obstacle = (height >= sensor.obstacle_min) & (height <= sensor.obstacle_max)
    ground = height < sensor.obstacle_min
    return ScanMaps(scan.points, obstacle, ground, distance, reach, evidence.occupied, evidence.free, verdict)


@dataclass(frozen=True, eq=False)
class CellScan:
    """What one scan says of one cell, and why.

    Parameters
    ----------
    obstacles, ground : (N, 3), (M, 3) float
        Its returns from obstacles and from the ground: x and y in the grid frame, height above the ground, metres.
    distance, reach, occupied, free : float
        The cell's numbers in `ScanMaps`.
    verdict : str
        What the scan says, one of `VERDICTS`.
    """

    obstacles: NDArray[np.floating]
    ground: NDArray[np.floating]
    distance: float
    reach: float
    occupied: float
    free: float
    verdict: str


def cell_scan(points: NDArray, spec: GridSpec, cell: tuple[int, int], sensor: SensorModel) -> CellScan:
    """Ask a scan about one cell.

    Parameters
    ----------
    points, spec, sensor
        As for `scan_maps`, which does the work.
    cell : (int, int)
        Row and column of the cell.

    Returns
    -------
    CellScan
        The returns in the cell, the beam through its centre, and the two likelihoods.
    """
    maps = scan_maps(points, spec, sensor)
    rows, cols, inside = spec.cells(maps.points)
    here = inside & (rows == cell[0]) & (cols == cell[1])
    numbers = (float(values[cell]) for values in (maps.distance, maps.reach, maps.occupied, maps.free))
    returns = (maps.points[here & kind, :3] for kind in (maps.obstacle, maps.ground))
    return CellScan(*returns, *numbers, VERDICTS[maps.verdict[cell]])


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
    size, labels = np.array(result.scores.shape[1:]), result.frame.labels
    scale = size / np.array(result.frame.camera.size)
    nearest = np.rint((np.where(visible[..., None], pixels, 0) + 0.5) * scale[::-1] - 0.5).astype(np.int64)
    u, v = np.moveaxis(np.clip(nearest, 0, size[::-1] - 1), -1, 0)
    truth = np.full(size, IGNORE) if labels is None else pixel_truth(labels, tuple(size.tolist()))
    called, shown = (np.where(visible, of[v, u], IGNORE) for of in (result.scores.argmax(axis=0), truth))
    return called.astype(np.int64), shown.astype(np.int64)


def pixel_truth(labels: FrameLabels, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the true class of each pixel of an image of another size; 255 where it isn't labelled.

    Parameters
    ----------
    labels : FrameLabels
        What is true of the frame.
    size : (int, int)
        Height and width, pixels.
    """
    return resize_labels(labels.image, size, sparse=labels.undecided is not None)


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


class Sight(NamedTuple):
    """When a frame by itself last gave the place of each cell a semantic class, and which.

    Parameters
    ----------
    back : (H, W) int64
        How many frames ago: 0 for the last frame itself, -1 if none of the frames did.
    label : (H, W) int64
        The class; where there was none, what the last frame says.
    """

    back: NDArray[np.int64]
    label: NDArray[np.int64]


def last_sight(frames: Sequence[Frame], labels: Sequence[NDArray], spec: GridSpec, n_semantic: int) -> Sight:
    """Look up the place of each cell of the last frame in the earlier ones, the newest first.

    Parameters
    ----------
    frames : sequence of Frame
        In the order of time, with their poses.
    labels : sequence of (H, W) int
        The most probable class of each cell, of each frame by itself.
    spec : GridSpec
        The grid of all of them.
    n_semantic : int
        Number of semantic classes, which come first.
    """
    back, label = np.full(spec.shape, -1), np.array(labels[-1], np.int64)
    for ago, (frame, then) in enumerate(zip(reversed(frames), reversed(labels), strict=True)):
        motion = PlanarMotion.from_poses(frame.T_world_from_lidar, frames[-1].T_world_from_lidar)
        there = look_up(np.float32(then)[None], np.float32([n_semantic]), spec, spec, motion)[0]
        found = (back < 0) & (there < n_semantic)
        back[found], label[found] = ago, there[found]
    return Sight(back, label)


class CellMemory(NamedTuple):
    """What a cell is called with memory, and when a frame by itself last named its place.

    Parameters
    ----------
    label, sure : int, float
        The class with memory, and its probability.
    back, then : int
        The cell's numbers in `Sight`.
    seconds : float
        How long ago that was; 0 if no frame did.
    earlier : int
        Number of earlier frames that were looked through.
    """

    label: int
    sure: float
    back: int
    then: int
    seconds: float
    earlier: int


def cell_memory(
    results: Sequence[FrameResult], spec: GridSpec, cell: tuple[int, int], n_semantic: int
) -> CellMemory | None:
    """Say where the class of a cell of the last frame comes from; None if it was made without memory.

    Parameters
    ----------
    results : sequence of FrameResult
        The results of the frames in the order of time.
    spec : GridSpec
        The grid of all of them.
    cell : (int, int)
        Row and column of the cell in the last frame.
    n_semantic : int
        Number of semantic classes.
    """
    if (remembered := results[-1].remembered) is None:
        return None
    frames, label = [result.frame for result in results], int(remembered[:, *cell].argmax())
    sight = last_sight(frames, [result.grid.argmax(axis=0) for result in results], spec, n_semantic)
    back = int(sight.back[cell])
    seconds = frames[-1].time - frames[-1 - max(back, 0)].time
    sure, then = float(remembered[label, *cell]), int(sight.label[cell])
    return CellMemory(label, sure, back, then, float(seconds), len(results) - 1)
