"""How wrong each way of making ground truth from LIDAR is, measured where the truth is known (section 4).

Simulated drives are filtered by CMCDOT, their calibration, labels and scans get errors like those of real data
(`TruthFlaws`), each policy makes the truth of the frame in the middle, and its cells are counted (`TruthCounts`).
In the folder notebooks, `python -m worlds.lecture_09_policies ../docs/results/truth_policies.json --lidar HDL-64E`
measures them.
"""

from collections.abc import Iterable
from dataclasses import asdict, fields, replace
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import typer
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.ground_truth import Moment, TruthPolicy, drive_truth
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import track_drive
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.storage.files import table_beside, write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.flaws import NO_FLAWS, TruthFlaws, flawed_drive
from semgrid_edu.workshop.simulation import simulate
from semgrid_edu.workshop.simulation.sensors.rig import Rig
from worlds.lecture_04_filters import GRIDS, LIDARS
from worlds.lecture_04_scenes import labelled_frame
from worlds.lecture_09_counts import ABOUT, TruthCounts
from worlds.lecture_09_tables import truth_tables

HELD_OUT = 700
"""Seed of the first drive for seed 0; each further seed adds 1000."""
REACH = 9
"""Number of scans before, and after, the labelled one: 0.9 s. minikitti has as many before its labelled frames."""


ERRORS = TruthFlaws(skewed=True)
"""All errors of real data; the scans of the laboratory's drives are of one instant."""


class Trial(NamedTuple):
    """One way to make ground truth, and from what.

    Parameters
    ----------
    policy : TruthPolicy
        The way.
    flaws : TruthFlaws
        The errors of calibration, labels and scans.
    """

    policy: TruthPolicy = TruthPolicy()
    flaws: TruthFlaws = ERRORS


def _trial(row: dict) -> Trial:
    """Return the trial that a row of the table beside this file describes."""
    policy = {name: value for name, value in row.items() if name != "errors"}
    errors = row.get("errors", [field.name for field in fields(TruthFlaws)])
    return Trial(TruthPolicy(**policy), replace(NO_FLAWS, **{name: getattr(ERRORS, name) for name in errors}))


TRIALS = {name: _trial(row) for name, row in table_beside(__file__).items()}
"""What is compared, by name."""


def truth_policies(seed: int = 0, drives: int = 20, grid: str = "compact", lidar: str = "coarse") -> dict:
    """Make the ground truth of simulated drives by every policy, and count its errors.

    Parameters
    ----------
    seed : int
        Seed for drives, errors and particles.
    drives : int
        Number of drives, at least one.
    grid : str
        "compact" or "paper".
    lidar : str
        "HDL-64E" for KITTI's, or "coarse" for one with a fifth of its columns.

    Returns
    -------
    dict
        "drives": by number of the drive and name of the trial, each of `COUNTED` summed over classes and distances;
        "sums": by name of the trial the cells of `TruthCounts`, of all drives; "policies": the trials; and provenance.
        JSON can hold it.
    """
    began = perf_counter()
    first = HELD_OUT + 1000 * seed
    by_drive: dict[str, dict] = {}
    sums: dict[str, NDArray] = {}
    for number in tqdm(range(first, first + drives), desc="truth policies", unit="drive"):
        counts = score_trials(TRIALS, GRIDS[grid], number, lidar)
        by_drive[str(number)] = {name: one.cells.sum(axis=(1, 2)).tolist() for name, one in counts.items()}
        sums = {name: one.cells + sums.get(name, 0) for name, one in counts.items()}
    command = f"python -m worlds.lecture_09_policies OUT --seed {seed} --drives {drives} --grid {grid} --lidar {lidar}"
    return {
        "seed": seed,
        "grid": grid,
        "lidar": lidar,
        "policies": {name: asdict(trial.policy) | {"errors": asdict(trial.flaws)} for name, trial in TRIALS.items()},
        **ABOUT,
        "drives": by_drive,
        "sums": {name: cells.tolist() for name, cells in sums.items()},
        "minutes": round((perf_counter() - began) / 60, 1),
        **made_by(command, "numpy", "scipy", "numba", "embreex", "trimesh"),
    }


def score_trials(trials: dict[str, Trial], spec: GridSpec, number: int, lidar: str) -> dict[str, TruthCounts]:
    """Score every trial on one simulated drive, by name.

    Parameters
    ----------
    trials : dict of str to Trial
        What to score, by name.
    spec : GridSpec
        The grid.
    number : int
        Seed for the drive and for the errors in its data, which all trials share, and for the particles.
    lidar : str
        A key of `LIDARS`.
    """
    frames = simulated_drive(number, lidar)
    return score_frame(trials, frames, len(frames) // 2, spec, number)


def simulated_drive(number: int, lidar: str = "coarse", n_frames: int = 2 * REACH + 1) -> list[Frame]:
    """Take the frames of a simulated drive with labels of their pixels, but without images.

    The frame in the middle has bird's-eye labels too. Those of the others are 255.

    Parameters
    ----------
    number : int
        Seed for the drive.
    lidar : str
        A key of `LIDARS`.
    n_frames : int
        Number of frames, ten a second.
    """
    drive = simulate(number, n_frames, rig=Rig(lidar=LIDARS[lidar]))
    return [replace(labelled_frame(drive, k, birdseye=k == n_frames // 2), image=None) for k in range(n_frames)]


def score_frame(
    trials: dict[str, Trial], frames: Iterable[Frame], k: int, spec: GridSpec, seed: int = 0
) -> dict[str, TruthCounts]:
    """Score every trial on one labelled frame of any drive whose bird's-eye labels are true, by name.

    Parameters
    ----------
    trials : dict of str to Trial
        What to score, by name.
    frames : iterable of Frame
        The frames of the drive, in the order of time.
    k : int
        Number of the labelled frame.
    spec : GridSpec
        The grid: the extent of `LABEL_GRID`, a multiple of its cell.
    seed : int
        Seed for the errors in the data and for the particles.

    Raises
    ------
    ArgumentError
        When there is no such frame, or it has no labels.
    """
    frames = list(frames)
    if not 0 <= k < len(frames) or frames[k].labels is None:
        raise ArgumentError("k", "the number of a labelled frame", k)
    beliefs = list(track_drive(frames, spec, seed=seed))
    labels = frames[k].labels
    truth = grid_truth(labels, beliefs[k].probability, spec)
    standing = labels.birdseye_on(spec)
    moments = {
        flaws: [Moment(*pair) for pair in zip(flawed_drive(frames, flaws, seed), beliefs, strict=True)]
        for flaws in {trial.flaws for trial in trials.values()}
    }
    found = {name: drive_truth(moments[flaws], k, spec, policy) for name, (policy, flaws) in trials.items()}
    return {name: TruthCounts.of_frame(one, truth, standing, spec, labels.label_set) for name, one in found.items()}


def main(out: Path, seed: int = 0, drives: int = 20, grid: str = "compact", lidar: str = "coarse") -> None:
    """Measure every policy, write the result and print its tables.

    Parameters
    ----------
    out : Path
        A JSON file.
    seed, drives, grid, lidar
        As `truth_policies` takes them.
    """
    result = truth_policies(seed, drives, grid, lidar)
    write_json(out, result)
    print(truth_tables(result))


if __name__ == "__main__":
    typer.run(main)
