"""Ask what a denser simulated LIDAR is worth on a real street: every column of its scans, or every fifth.

    python benchmarks/lidar_density.py --pandaset FOLDER --simulated DIR/minikitti --runs RUNS

A fusion network learns from either on the scores of the first stage of `segnet_compact`, and is scored on the labelled
returns of PandaSet's scene 002; then it learns from four of the scene's cameras and is scored on the two others, as in
`worlds.lecture_08_real_streets`. A run that has ended isn't repeated.
"""

import argparse
import shutil
import sys
from pathlib import Path

import numpy as np

from semgrid_edu.datasets.pandaset import CAMERAS, PandasetScene
from semgrid_edu.datasets.samples import sample_weights
from semgrid_edu.datasets.training_set import Mixture
from semgrid_edu.fast import TrainingSet
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import METRICS
from semgrid_edu.networks import IMAGE_STAGE, WEIGHTS, Architecture
from semgrid_edu.training import TrainingParams
from semgrid_edu.workshop.scoring.score_with_interval import compared, on_cells, shown
from semgrid_edu.workshop.simulation.sensors.rig import HDL64E_AHEAD

sys.path.append(str(Path(__file__).resolve().parents[1] / "notebooks"))

from worlds import lecture_08_real_streets as study

FIFTH = 5
"""A thinned scan keeps one of so many columns."""

SEEDS, COMPARED = range(study.TABLE["seeds"]), ("pixel accuracy", "class accuracy")
FUSION = study.WayToTrain(Architecture(), params=TrainingParams(0, 400, end_to_end=False))
REAL = study.WAYS["simulated, then real, two stages"]


def thinned(points: np.ndarray) -> np.ndarray:
    """Keep the returns (N, 4) of every fifth column."""
    column = np.rint(np.degrees(np.arctan2(points[:, 1], points[:, 0])) / HDL64E_AHEAD.azimuth_step).astype(int)
    return points[column % FIFTH == 0]


def thin_data_set(folder: Path, out: Path) -> Path:
    """Copy a simulated data set with thinned scans; a copy that is there is left as it is."""
    if not out.exists():
        half = out.with_name(f"{out.name} under way")
        shutil.rmtree(half, ignore_errors=True)
        shutil.copytree(folder, half, ignore=shutil.ignore_patterns("*.bin", "cache"))
        for scan in sorted(folder.glob("*/*/velodyne_points/data/*.bin")):
            points = np.fromfile(scan, np.float32).reshape(-1, 4)
            thinned(points).tofile(half / scan.relative_to(folder))
        half.rename(out)
    return out


def learned(way, start: Path, parts: list[list], folder: Path, seed: int) -> Path:
    """Return the weights that a network learns in this way from parts of frames."""
    if not (folder / WEIGHTS).exists():
        study._train(way, [start], Mixture(parts), folder, seed, "cpu")
    return folder / WEIGHTS


def report(name: str, counted: list, table: list) -> None:
    """Print what networks got in cells and classes, alone and after the CRF, in per cent, over seeds and blocks."""
    for method in counted[0]:
        scores = study._scores_of([one[method] for one in counted], table)
        print(f"{name}, {method}: " + ", ".join(f"{metric} {shown(scores[metric])}" for metric in COMPARED))


def report_difference(ours: list, theirs: list) -> None:
    """Print what the first networks got more than the others, in points."""
    for method in ours[0]:
        counts = (study._by_block([one[method] for one in networks]) for networks in (ours, theirs))
        both = [on_cells(one, "semantic", KITTI_14) for one in counts]
        more = [compared(*both, METRICS[metric]) for metric in COMPARED]
        print(f"more from every column, {method}: " + ", ".join(map(shown, more)))


def counts_of(kind: str, folder: Path, rounds: list, runs: Path) -> tuple[list, list]:
    """Return what networks of each seed got that learn from one kind of scans alone, and with real frames after it."""
    streets = TrainingSet.by_camera(folder, "train")
    everything = [part for _, test in rounds for part in test]
    alone = []
    then = []
    for seed in SEEDS:
        start = sample_weights("segnet").with_name(IMAGE_STAGE)
        fused = learned(FUSION, start, [streets], runs / f"{kind}, {seed}", seed)
        alone.append(study._count("simulated only", fused, everything))
        after = []
        for r, (training, test) in enumerate(rounds):
            parts = [study._Subset(*part) for part in training]
            weights = learned(REAL, fused, [parts], runs / f"{kind}, then real {r}, {seed}", seed)
            after.append(study._count("simulated, then real", weights, test))
        then.append(study._joined(after))
    return alone, then


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for option in ("--pandaset", "--simulated", "--runs"):
        parser.add_argument(option, required=True, type=Path)
    given = parser.parse_args()
    views = {camera: study._frames(PandasetScene(given.pandaset, "002", camera), given.runs) for camera in CAMERAS}
    rounds = study.splits(views)[study.LEFT_OUT]
    table = study._joined(study._count_states(*one) for one in rounds)[study.STATE_TABLE]
    kinds = {"every column": given.simulated, "every fifth": thin_data_set(given.simulated, given.runs / "thinned")}
    found = {kind: counts_of(kind, folder, rounds, given.runs) for kind, folder in kinds.items()}
    for kind, counted in found.items():
        for one in counted:
            report(kind, one, table)
    for ours, theirs in zip(*found.values(), strict=True):
        report_difference(ours, theirs)


if __name__ == "__main__":
    main()
