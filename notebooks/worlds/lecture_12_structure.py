"""What the paper's few long runs do to an interval: SegNet on many streets and on a few runs (section 4.3).

The labels that the paper takes from Zhang et al. come from eight runs, so its Table 1 rests on about four test runs. In
the folder notebooks, `python -m worlds.lecture_12_structure RUNS ../docs/results/reduced` trains, scores and writes.
"""

from pathlib import Path

import numpy as np
import typer

from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import pixel_accuracy
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.paper.data_runs import frame_counts
from semgrid_edu.workshop.paper.run import execute_plan, with_needs
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import SCALES, Scale
from semgrid_edu.workshop.paper.score_runs import ScoreRun, by_seed
from semgrid_edu.workshop.scoring.grids import NETWORK
from semgrid_edu.workshop.scoring.score_with_interval import every_metric, score_with_interval
from semgrid_edu.workshop.scoring.statistics import drive_estimate
from semgrid_edu.workshop.workplace import workplace

DATA = ("minikitti", "kittiruns")
"""The same number of frames: of as many streets, and of four long runs."""

Pairs = dict[tuple[str, str], list[ScoreRun]]


def structure_runs(scale: Scale, seeds: int) -> Pairs:
    """Return SegNet's runs, one per seed, by what it learned from and what it is tested on.

    Parameters
    ----------
    scale : Scale
        How many steps it learns.
    seeds : int
        Number of seeds.
    """
    return {
        (learned, tested): [
            ScoreRun(scale.grid_stage(learned, "segnet", seed), scale.arrays(tested, "test", "lidar"), crf=False)
            for seed in range(seeds)
        ]
        for learned in DATA
        for tested in DATA
    }


def structure(pairs: Pairs, counted: RunCounts) -> list[dict]:
    """Return a row for each pair, from runs that have ended.

    Parameters
    ----------
    pairs : dict
        From `structure_runs`.
    counted : RunCounts
        What is known about the runs.

    Returns
    -------
    list of dict
        What it "learned" from and was "tested" on, the numbers of test "frames and drives", the "scores" against labels
        made with the LIDAR, and the "half-width" of the 95 % interval of pixel accuracy, computed from "drives", and
        from "frames" as if frames of one drive were independent; "drives": the lowest and the highest of single drives.
    """
    rows = []
    for (learned, tested), runs in pairs.items():
        by_drive = by_seed(runs, counted, NETWORK, "lidar")
        by_frame = np.stack([run.frame_confusions(counted, NETWORK, "lidar") for run in runs])
        units = {"drives": by_drive, "frames": by_frame}
        single = [pixel_accuracy(matrix) for matrix in by_drive.sum(axis=0)]  # all seeds together
        rows.append(
            {
                "learned": learned,
                "tested": tested,
                "frames and drives": frame_counts(tested)["test"],
                "scores": every_metric(score_with_interval, KITTI_14, by_drive),
                "half-width": {
                    unit: drive_estimate(counts, pixel_accuracy).half_width(0.95) for unit, counts in units.items()
                },
                "drives": [min(single), max(single)],
            }
        )
    return rows


def main(runs: Path, out: Path, device: str = "cpu") -> None:
    """Do all runs, and write structure.json, and the counts from which it can be computed again.

    Parameters
    ----------
    runs : Path
        The folder of all runs; the same command resumes.
    out : Path
        The folder of the results.
    device : str
        Where networks are trained.
    """
    scale = SCALES["reduced"]
    pairs = structure_runs(scale, scale.seeds)
    counted = RunCounts(runs)
    runs.mkdir(parents=True, exist_ok=True)
    with workplace() as place:
        failed = execute_plan(with_needs(run for some in pairs.values() for run in some), runs, place, device)
    if failed:
        raise SystemExit("\n".join(f"{run.name}: {error}" for run, error in failed.items()))
    command = f"python -m worlds.lecture_12_structure RUNS OUT --device {device}"
    rows = structure(pairs, counted)
    write_json(out / "structure.json", {"rows": rows, "seeds": scale.seeds, **made_by(command, "numpy", "torch")})
    counted.keep(out / "structure_counts.npz")


if __name__ == "__main__":
    typer.run(main)
