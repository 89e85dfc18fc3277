"""Simulated drives, frame by frame, with everything that scoring an occupancy filter needs (section 3.2).

The true state of each cell (section 3.2) is known instead of estimated.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.fast import scan_evidence
from semgrid_edu.frame import LABEL_GRID, Frame, FrameLabels, blocks
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.occupancy import PlanarMotion, SensorModel, State
from semgrid_edu.occupancy.planar_motion import look_up, map_around
from semgrid_edu.workshop.simulation.drive import PERIOD, SimulatedDrive
from semgrid_edu.workshop.simulation.street.traffic import MOVING_SPEED
from semgrid_edu.workshop.simulation.things.materials import Kind, class_of_kind

FLAT = (Kind.ROAD, Kind.LANE, Kind.SIDEWALK, Kind.GRASS)
"""The kinds of bare ground."""
HIGHEST = 1.6
"""Height above flat ground up to which returns count, metres."""
LEFT_SINCE = 10
"""Number of frames, 1 s. Cells that something moving left within them should be free now."""
OUT_OF_VIEW = 3
"""Number of frames without a hit that count as leaving the view: in shorter gaps a post hid the thing."""


@dataclass(frozen=True, eq=False)
class CellTruth:
    """The truth about the cells of a grid at one instant.

    Parameters
    ----------
    state : (H, W) uint8
        FREE, STATIC or DYNAMIC: the truth is never UNKNOWN.
    kind : (H, W) uint8
        The `Kind` of the object in each cell; the kind of the ground in cells without an object.
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

    A cell gets the object that covers most of it, ignoring bare ground. So a cell with any object isn't free, even if
    it is a thin pole in a single fine cell.

    Parameters
    ----------
    kinds : (710, 310) uint8
        The contents of each cell of `LABEL_GRID`, members of `Kind`.
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
    numbers = np.int64(instances) * 256 + kinds  # object and kind as one number
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


@dataclass(frozen=True, eq=False)
class KnownScene:
    """One frame of a drive, the truth about its cells, and which of them the scans have observed.

    Parameters
    ----------
    frame : Frame
        The frame, with its scan and without image.
    motion : PlanarMotion
        Motion of the vehicle since the last frame.
    truth : CellTruth
        The truth about the cells.
    hit : (H, W) bool
        Cells that the scan hits, from `hit_cells`.
    observed : (H, W) bool
        Cells that this scan observes: P(z | occupied) and P(z | free) differ (`SensorModel`).
    never_seen : (H, W) bool
        Cells that no scan of the drive has observed so far, so that no filter can know them.
    left : (H, W) bool
        Free cells, seen at some time, that something moving covered within the last second.
    in_view : dict of int to int
        By number of each car, pedestrian and bicycle that is hit now: for how many frames it has been in view.
    """

    frame: Frame
    motion: PlanarMotion
    truth: CellTruth
    hit: NDArray[np.bool_]
    observed: NDArray[np.bool_]
    never_seen: NDArray[np.bool_]
    left: NDArray[np.bool_]
    in_view: dict[int, int]


def hit_cells(points: NDArray, spec: GridSpec, least: int = 2, low: float = 0.3) -> NDArray[np.bool_]:
    """Return which cells hold enough returns from above the ground to be scored, (H, W).

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame, metres.
    spec : GridSpec
        The grid.
    least : int
        Number of returns that a cell needs.
    low : float
        Height above flat ground from which on returns count, up to `HIGHEST`, metres.
    """
    rows, cols, inside = spec.cells(points[(points[:, 2] >= low) & (points[:, 2] <= HIGHEST)])
    count = np.zeros(spec.shape, int)
    np.add.at(count, (rows[inside], cols[inside]), 1)
    return count >= least


def known_scenes(drive: SimulatedDrive, spec: GridSpec, name: str = "drive") -> Iterator[KnownScene]:
    """Simulate the scans of a drive, one after the other, with their truth.

    Parameters
    ----------
    drive : SimulatedDrive
        The drive.
    spec : GridSpec
        The grid: the extent of `LABEL_GRID`, a multiple of its cell.
    name : str
        Its name in the progress bar.

    Yields
    ------
    KnownScene
    """
    past = SceneHistory(spec)
    for k in tqdm(range(drive.n_frames), desc=name, unit="frame", leave=False):
        yield past.add(drive.scan(k), true_cells(drive, k * PERIOD, spec))


class SceneHistory:
    """What the scans of a drive have seen so far, and which things moved.

    Parameters
    ----------
    spec : GridSpec
        The grid of the scenes.
    """

    def __init__(self, spec: GridSpec) -> None:
        self.spec = spec
        self._around = map_around(spec, yaw=0)
        self._poses, self._observed, self._dynamic = [], [], []  # an array per frame
        self._first_hit, self._last_hit = {}, {}  # frames by number of the object

    def add(self, frame: Frame, truth: CellTruth) -> KnownScene:
        """Make a scene from the next frame, and remember it.

        Parameters
        ----------
        frame : Frame
            The frame, with its scan.
        truth : CellTruth
            The truth at that instant.
        """
        evidence = scan_evidence(frame.points_grid, self._around, SensorModel())
        pose = frame.T_world_from_lidar
        motion = PlanarMotion.from_poses(self._poses[-1], pose) if self._poses else PlanarMotion()
        self._poses.append(pose)
        self._observed.append(evidence.occupied != evidence.free)
        observed = self._any_of(self._observed[-1:], self._around)
        seen = self._any_of(self._observed, self._around)
        left = self._any_of(self._dynamic[-LEFT_SINCE:], self.spec, skip=1) & seen & (truth.state == State.FREE)
        self._dynamic.append(truth.state == State.DYNAMIC)
        hit = hit_cells(frame.points_grid, self.spec)
        return KnownScene(frame, motion, truth, hit, observed, ~seen, left, self._in_view(truth.instance[hit]))

    def _any_of(self, masks: list[NDArray], source: GridSpec, skip: int = 0) -> NDArray[np.bool_]:
        """Return the present cells that are in any of the masks, one per frame without the last `skip` ones."""
        found = np.zeros(self.spec.shape, bool)
        outside = np.zeros(1, np.float32)
        poses = self._poses[len(self._poses) - skip - len(masks) : len(self._poses) - skip]
        for pose, mask in zip(poses, masks, strict=True):
            motion = PlanarMotion.from_poses(pose, self._poses[-1])
            found |= look_up(mask[None].astype(np.float32), outside, source, self.spec, motion)[0] > 0
        return found

    def _in_view(self, hit_instances: NDArray) -> dict[int, int]:
        """Return the number of frames in view of each object that is hit now."""
        now = len(self._poses) - 1
        for number in map(int, np.unique(hit_instances[hit_instances > 0])):
            if number not in self._last_hit or now - self._last_hit[number] > OUT_OF_VIEW + 1:
                self._first_hit[number] = now
            self._last_hit[number] = now
        return {number: now - self._first_hit[number] for number, last in self._last_hit.items() if last == now}


def labelled_frame(drive: SimulatedDrive, k: int, birdseye: bool = True) -> Frame:
    """Simulate a frame with image and KITTI-14 labels, as a data set on disk would contain it.

    Parameters
    ----------
    drive : SimulatedDrive
        The drive.
    k : int
        Number of the frame.
    birdseye : bool
        Whether the cells have labels as well as the pixels; if not, the cells' labels are 255.
    """
    taken = drive.frame(k, labelled=birdseye)
    classes = class_of_kind(KITTI_14)
    kinds = taken.truth.kinds if birdseye else np.full(LABEL_GRID.shape, IGNORE, np.uint8)
    visible = taken.truth.visible if birdseye else np.zeros(LABEL_GRID.shape, bool)
    labels = FrameLabels(KITTI_14, classes[taken.picture.kind], taken.picture.depth, classes[kinds], visible)
    return Frame(taken.picture.image, taken.points, drive.rig.camera, taken.T_world_from_lidar, k * PERIOD, labels)
