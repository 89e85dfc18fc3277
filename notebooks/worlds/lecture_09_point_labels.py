"""How wrong the truth from labelled returns is, made as by `PandasetScene.truth`, on drives whose truth is known.

Every return of a simulated scan gets its class, and every road user its cuboid, both without error. So the errors that
are counted are those of the method alone: gaps, cell edges, overhanging objects, moving objects. In the folder
notebooks, `python -m worlds.lecture_09_point_labels ../docs/results/point_labels.json` measures them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tqdm.auto import tqdm

from semgrid_edu.camera import invert_rigid, rigid_transform, transform_points
from semgrid_edu.datasets.cuboids import ANY_LIDAR, Cuboids, LabelledScan, put_together
from semgrid_edu.datasets.frames import visible_labels
from semgrid_edu.datasets.project_lidar import birdseye_votes, unhidden
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, LabelSet
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.simulation import simulate
from semgrid_edu.workshop.simulation.drive import PERIOD, SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.rig import Rig
from semgrid_edu.workshop.simulation.things.materials import Kind, class_of_kind
from worlds.lecture_04_filters import GRIDS, LIDARS
from worlds.lecture_04_scenes import labelled_frame
from worlds.lecture_09_counts import ABOUT, TruthCounts
from worlds.lecture_09_policies import HELD_OUT, REACH
from worlds.lecture_09_tables import truth_tables

MOVABLE = (Kind.CAR, Kind.PEDESTRIAN, Kind.BICYCLE)
FLAT = [KITTI_14.index(name) for name in ("road", "sidewalk")]


def point_labels(seed: int = 0, drives: int = 20, grid: str = "compact", lidar: str = "HDL-64E") -> dict:
    """Make truth from the labelled returns of simulated drives in several ways, and count how wrong it is.

    Parameters
    ----------
    seed : int
        Seed for the drives.
    drives : int
        Number of drives, at least one.
    grid : str
        "compact" or "paper".
    lidar : str
        "HDL-64E", KITTI's, or "coarse", with a fifth of its columns.

    Returns
    -------
    dict
        What `truth_tables` reads: "sums", by name of the way the cells of `TruthCounts`, of all drives, and all that
        made them. JSON can hold it.
    """
    sums: dict[str, TruthCounts] = {}
    numbers = range(HELD_OUT + 1000 * seed, HELD_OUT + 1000 * seed + drives)
    for number in tqdm(numbers, desc="labelled returns", unit="drive"):
        for name, counts in score_drive(GRIDS[grid], number, lidar).items():
            sums[name] = sums[name] + counts if name in sums else counts
    options = f"--seed {seed} --drives {drives} --grid {grid} --lidar {lidar}"
    return {
        "sums": {name: counts.cells.tolist() for name, counts in sums.items()},
        "drives": list(numbers),
        **ABOUT,
        **made_by(
            f"python -m worlds.lecture_09_point_labels OUT {options}", "numpy", "scipy", "numba", "embreex", "trimesh"
        ),
    }


def score_drive(spec: GridSpec, number: int, lidar: str) -> dict[str, TruthCounts]:
    """Count the cells of the frame in the middle of one drive, by name of the way.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    number : int
        Seed for the drive.
    lidar : str
        A key of `LIDARS`.
    """
    drive = simulate(number, 2 * REACH + 1, rig=Rig(lidar=LIDARS[lidar]))
    T = invert_rigid(drive.pose(REACH * PERIOD))
    found = {}
    for name, ((points, classes), label_set) in _clouds(drive).items():
        points = transform_points(T, points)
        in_grid = transform_points(drive.rig.T_grid_from_lidar, points)
        found[name] = birdseye_votes(in_grid, classes, spec, label_set)
        rows, cols, inside = spec.cells(in_grid[unhidden(points, ~np.isin(classes, FLAT), drive.rig.camera)])
        visible = np.zeros(spec.shape, bool)
        visible[rows[inside], cols[inside]] = True
        found[f"{name}, seen by the camera"] = np.where(visible, found[name], np.uint8(IGNORE))
    labels = labelled_frame(drive, REACH).labels
    truth = visible_labels(labels, spec)
    standing = labels.birdseye_on(spec)
    return {name: TruthCounts.of_frame(one, truth, standing, spec, KITTI_14) for name, one in found.items()}


def _clouds(drive: SimulatedDrive) -> dict[str, tuple[tuple[NDArray, NDArray], LabelSet]]:
    """Return, by name of the way, returns and classes in the world, and the label set that says what outvotes what."""
    scans = [_labelled_scan(drive, k) for k in range(drive.n_frames)]
    now = scans[REACH]
    others = [*scans[:REACH], *scans[REACH + 1 :]]
    raw = np.concatenate([scan.points for scan in scans]), np.concatenate([scan.classes for scan in scans])
    around = f"{REACH} before and after"
    return {
        around: (put_together(now, others), KITTI_14),
        "one scan": (put_together(now, []), KITTI_14),
        f"{around}, movers smeared": (raw, KITTI_14),
        f"{around}, majority of returns": (put_together(now, others), replace(KITTI_14, flat=())),
    }


def _labelled_scan(drive: SimulatedDrive, k: int) -> LabelledScan:
    """Take a scan with the classes of its returns and with the cuboids of all road users."""
    points, kinds = drive.labelled_scan(k)
    world = transform_points(drive.pose(k * PERIOD), points[:, :3].astype(np.float64))
    lidars = np.zeros(len(points), np.int64)
    return LabelledScan(world, class_of_kind(KITTI_14)[kinds], np.isin(kinds, MOVABLE), lidars, _cuboids(drive, k))


def _cuboids(drive: SimulatedDrive, k: int) -> Cuboids:
    """Return the boxes of all road users at one instant."""
    road = drive.plan.road
    t = k * PERIOD
    actors = [*drive.parked, *drive.moving]
    turns = [Rotation.from_euler("z", actor.trajectory.pose(road, t)[1]).as_matrix() for actor in actors]
    T = [rigid_transform(turn, actor.middle(road, t)) for turn, actor in zip(turns, actors, strict=True)]
    return Cuboids(
        names=np.array([str(actor.instance) for actor in actors]),
        T_world_from_box=np.reshape(T, (-1, 4, 4)),
        sizes=np.reshape([actor.size for actor in actors], (-1, 3)),
        moving=np.arange(len(actors)) >= len(drive.parked),
        lidars=np.full(len(actors), ANY_LIDAR),
    )


def main(out: Path, seed: int = 0, drives: int = 20, grid: str = "compact", lidar: str = "HDL-64E") -> None:
    """Measure every way, write the result and print its tables.

    Parameters
    ----------
    out : Path
        A JSON file.
    seed, drives, grid, lidar
        As `point_labels` takes them.
    """
    result = point_labels(seed, drives, grid, lidar)
    write_json(out, result)
    print(truth_tables(result))


if __name__ == "__main__":
    typer.run(main)
