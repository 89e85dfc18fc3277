"""Simulated drives, frame by frame, with all that is needed to score an occupancy filter (section 3.2).

What experiments on simulated drives have in common: their grids, what may be asked, and what made a result.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import PlanarMotion, SensorModel, State, scan_evidence
from semgrid_edu.occupancy.planar_motion import MAX_YAW, look_up, map_around
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.simulation.drive import PERIOD, SimulatedDrive
from semgrid_edu.workshop.studies.filter.cell_truth import CellTruth, true_cells

GRIDS = {"paper": GridSpec.paper(), "compact": GridSpec.compact()}


def check_request(seed: int, drives: int, frames: int, grids: tuple[str, ...]) -> None:
    """Refuse what can't be run, before the work starts.

    Parameters
    ----------
    seed : int
        Seed for the drives and for the particles.
    drives, frames : int
        Number of drives, and number of frames of each.
    grids : tuple of str
        Keys of `GRIDS`.

    Raises
    ------
    ArgumentError
        When there is no such grid, the seed is negative, or there is nothing to do.
    """
    if not grids or not set(grids) <= set(GRIDS):
        raise ArgumentError("grid", " or ".join(GRIDS), ", ".join(grids) or "none")
    if seed < 0:
        raise ArgumentError("seed", "a whole number from 0 up", seed)
    if min(drives, frames) < 1:
        raise ArgumentError("drives, frames", "at least one", f"{drives}, {frames}")


def simulated_by(
    experiment: str, seed: int, drives: int, frames: int, grids: tuple[str, ...], began: datetime
) -> dict[str, object]:
    """Return what made a result on simulated drives, see `made_by`.

    Parameters
    ----------
    experiment : str
        The command after `semgrid-edu reproduce`.
    seed, drives, frames, grids
        What was asked, as `check_request` takes it.
    began : datetime
        When the work started, UTC.

    Returns
    -------
    dict
        Numbers of drives and frames, command, seed, date, minutes and versions; JSON can hold it.
    """
    one_grid = f" --grid {grids[0]}" if len(grids) == 1 else ""
    command = f"semgrid-edu reproduce {experiment} --seed {seed} --drives {drives}{one_grid}"
    minutes = round((datetime.now(UTC) - began).total_seconds() / 60, 1)
    made = made_by(command, "numpy", "scipy", "numba", "embreex", "trimesh")
    return {"drives": drives, "frames": frames, "seed": seed, "minutes": minutes, **made}


LEFT_SINCE = 10
"""Number of frames, 1 s. Cells that something moving has left within them should be free now."""
OUT_OF_VIEW = 3
"""Number of frames without a hit after which something comes into view anew: in shorter gaps a post hid it."""


@dataclass(frozen=True, eq=False)
class KnownScene:
    """One frame of a drive, what is true of its cells, and what its scans have told about them.

    Parameters
    ----------
    frame : Frame
        The frame, with its scan and without image.
    motion : PlanarMotion
        Motion of the vehicle since the last frame.
    truth : CellTruth
        What is true of the cells.
    hit : (H, W) bool
        Cells that the scan hits, from `hit_cells`.
    observed : (H, W) bool
        Cells about which this scan says something: P(z | occupied) and P(z | free) differ.
    never_seen : (H, W) bool
        Cells about which no scan of the drive has said anything so far, so that no filter can know them.
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


def hit_cells(
    points: NDArray, spec: GridSpec, least: int = 2, low: float = 0.3, high: float = 1.6
) -> NDArray[np.bool_]:
    """Return which cells hold enough returns from above the ground to be scored, (H, W).

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame, metres.
    spec : GridSpec
        The grid.
    least : int
        Number of returns that a cell needs.
    low, high : float
        Heights above flat ground between which returns count, metres.
    """
    rows, cols, inside = spec.cells(points[(points[:, 2] >= low) & (points[:, 2] <= high)])
    count = np.zeros(spec.shape, int)
    np.add.at(count, (rows[inside], cols[inside]), 1)
    return count >= least


def known_scenes(
    drive: SimulatedDrive, spec: GridSpec, sensor: SensorModel, name: str = "drive"
) -> Iterator[KnownScene]:
    """Take the scans of a drive, one after the other, with their truth.

    Parameters
    ----------
    drive : SimulatedDrive
        The drive.
    spec : GridSpec
        The grid: the extent of `LABEL_GRID`, a multiple of its cell.
    sensor : SensorModel
        Decides about which cells a scan says something.
    name : str
        What the progress bar calls it.

    Yields
    ------
    KnownScene
    """
    past = SceneHistory(spec, sensor)
    for k in tqdm(range(drive.n_frames), desc=name, unit="frame", leave=False):
        yield past.add(drive.scan(k), true_cells(drive, k * PERIOD, spec))


class SceneHistory:
    """What the scans of a drive have seen so far, and what moved in it.

    Parameters
    ----------
    spec : GridSpec
        The grid of the scenes.
    sensor : SensorModel
        Decides about which cells a scan says something.
    """

    def __init__(self, spec: GridSpec, sensor: SensorModel) -> None:
        self.spec, self.sensor = spec, sensor
        self._around = map_around(spec, MAX_YAW)  # what the trackers remember of the grid's surroundings
        self._poses: list[NDArray] = []
        self._observed: list[NDArray] = []
        self._dynamic: list[NDArray] = []
        self._first_hit: dict[int, int] = {}
        self._last_hit: dict[int, int] = {}

    def add(self, frame: Frame, truth: CellTruth) -> KnownScene:
        """Make a scene of the next frame, and remember it.

        Parameters
        ----------
        frame : Frame
            The frame, with its scan.
        truth : CellTruth
            What is true at that instant.
        """
        evidence = scan_evidence(frame.points_grid, self._around, self.sensor)
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
        """Return the present cells that lie in any of the masks, one per frame up to the `skip` last ones."""
        found, outside = np.zeros(self.spec.shape, bool), np.zeros(1, np.float32)
        poses = self._poses[len(self._poses) - skip - len(masks) : len(self._poses) - skip]
        for pose, mask in zip(poses, masks, strict=True):
            motion = PlanarMotion.from_poses(pose, self._poses[-1])
            found |= look_up(mask[None].astype(np.float32), outside, source, self.spec, motion)[0] > 0
        return found

    def _in_view(self, hit_instances: NDArray) -> dict[int, int]:
        """Return for how many frames each object that is hit now has been in view."""
        now = len(self._poses) - 1
        for number in map(int, np.unique(hit_instances[hit_instances > 0])):
            if number not in self._last_hit or now - self._last_hit[number] > OUT_OF_VIEW + 1:
                self._first_hit[number] = now
            self._last_hit[number] = now
        return {number: now - self._first_hit[number] for number, last in self._last_hit.items() if last == now}
