"""Compare log-odds grid, BOF and CMCDOT on simulated drives with known truth (paper, section 3.2).

In the folder notebooks, `python -m worlds.lecture_04_filters ../docs/results/occupancy.json --drives 20` measures them.
"""

from pathlib import Path
from time import perf_counter

import numpy as np
import typer

from semgrid_edu.fast import Cmcdot
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Bof, LogOddsGrid, State
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, per_cent
from semgrid_edu.workshop.simulation import simulate
from semgrid_edu.workshop.simulation.drive import PERIOD
from semgrid_edu.workshop.simulation.sensors.rig import HDL64E, Lidar, Rig
from semgrid_edu.workshop.workplace import workplace
from worlds.lecture_04_cell_scores import BANKS, CellScores, Estimate, share
from worlds.lecture_04_scenes import known_scenes

GRIDS = {"paper": GridSpec.paper(), "compact": GridSpec.compact()}
LIDARS = {"HDL-64E": HDL64E, "coarse": Lidar()}
"""The real scanner at 10 Hz, and the small data sets' scanner, which looks ahead with a fifth of its columns."""
FRAMES = 30
"""Number of frames of a drive, 3 s."""
HELD_OUT = 100
"""Seed of the first drive for seed 0; each further seed adds 1000. Parameters were chosen on drives before this one."""
METHODS = ("log-odds", "BOF", "CMCDOT")


def compare_filters(
    seed: int = 0, drives: int = 20, grids: tuple[str, ...] = tuple(GRIDS), frames: int = FRAMES
) -> dict[str, object]:
    """Run the three filters with their default parameters over simulated drives, and score them.

    Two kinds of cells count. Cells that the present scan observes should get their true state: FREE, STATIC or DYNAMIC.
    Cells that no scan of the drive has observed should be UNKNOWN. All other cells can only be remembered, so they
    don't count. In the log-odds grid everything occupied counts as STATIC, and a cell at its prior as UNKNOWN.

    Parameters
    ----------
    seed : int
        Seed for the drives and for the particles.
    drives : int
        Number of drives, at least one.
    grids : tuple of str
        "paper", "compact" or both.
    frames : int
        Number of frames of each drive, ten a second, at least one.

    Returns
    -------
    dict
        "scores" by LIDAR, grid and filter (see `CellScores.summary`), and all that made them; JSON can hold it.
    """
    began = perf_counter()
    with workplace() as place:
        tasks = {
            lidar: {grid: place.executor.submit(_score, seed, drives, frames, lidar, grid) for grid in grids}
            for lidar in LIDARS
        }
        scores = {lidar: {grid: task.result() for grid, task in of.items()} for lidar, of in tasks.items()}
    command = f"python -m worlds.lecture_04_filters OUT --seed {seed} --drives {drives}"
    return {
        "scores": scores,
        "states": [state.name for state in State],
        "drives": drives,
        "frames": frames,
        "seed": seed,
        "minutes": round((perf_counter() - began) / 60, 1),
        **made_by(command, "numpy", "scipy", "numba", "embreex", "trimesh"),
    }


def _score(seed: int, drives: int, frames: int, lidar: str, grid: str) -> dict[str, object]:
    """Score the filters, with their default parameters, on all drives of one LIDAR and grid."""
    spec = GRIDS[grid]
    scores = {name: CellScores(GRIDS[grid]) for name in METHODS}
    read = Estimate.of_log_odds, Estimate.of_belief, Estimate.of_belief
    for number in HELD_OUT + 1000 * seed + np.arange(drives):
        drive = simulate(number, frames, rig=Rig(lidar=LIDARS[lidar]))
        trackers = LogOddsGrid(spec), Bof(spec), Cmcdot(spec, seed=seed)
        for scene in known_scenes(drive, spec, f"{lidar}, {grid} grid, drive {number}"):
            for name, tracker, estimate in zip(METHODS, trackers, read, strict=True):
                scores[name].add(scene, estimate(tracker.step(scene.frame.points_grid, scene.motion, PERIOD)))
    return {name: one.summary() for name, one in scores.items()}


def occupancy_tables(result: dict) -> str:
    """Return the tables of all LIDARs and grids of a result, each under its title.

    Parameters
    ----------
    result : dict
        From `compare_filters`, or from the JSON file that it was written to.
    """
    return "\n\n".join(
        f"{lidar} LIDAR, {grid} grid\n\n{occupancy_table(result, lidar, grid)}"
        for lidar, grids in result["scores"].items()
        for grid in grids
    )


def occupancy_table(result: dict, lidar: str = "HDL-64E", grid: str = "paper") -> str:
    """Return the scores of one LIDAR and grid as a Markdown table.

    Its rows are, from top to bottom: the recall of each true state; the precision of DYNAMIC; the share of the cells
    recently left by something moving that are still called occupied; for each kind of thing the share of its hit cells
    that are more DYNAMIC than STATIC; the share of the hit cells with free ground that are called occupied; the errors
    of velocity.

    Parameters
    ----------
    result : dict
        From `compare_filters`, or from the JSON file that it was written to.
    lidar, grid : str
        Keys of `LIDARS` and `GRIDS` that the result holds.
    """
    scores = [result["scores"][lidar][grid][method] for method in METHODS]
    rows = [["per cent", *METHODS]]
    for k, state in enumerate(State):
        confusions = [one["confusion"][k] for one in scores]
        of = "never seen, called" if state == State.UNKNOWN else f"{state.name}, called"
        rows.append([f"{of} {state.name}", *(per_cent(share(row[k], sum(row))) for row in confusions)])
    rows.append(["called DYNAMIC, is DYNAMIC", *(per_cent(one["dynamic"]["precision"]) for one in scores)])
    rows.append(["left, still occupied", *(per_cent(one["smear"]["occupied"]) for one in scores)])
    for name in scores[0]["hit cells"]:
        rows.append([f"{name}: DYNAMIC", *(per_cent(one["hit cells"][name]["dynamic"]) for one in scores)])
    rows.append(["free ground hit, held occupied", *(per_cent(one["hit cells"][BANKS]["occupied"]) for one in scores)])
    rows.append(["**velocity error, m/s: median (RMS)**", "", "", ""])
    for name in scores[0]["velocity error"]:
        rows.append([name, *(_error(one["velocity error"][name]) for one in scores)])
    return markdown_table(rows)


def _error(error: dict[str, float | None]) -> str:
    return "-" if error["median"] is None else f"{error['median']:.2f} ({error['rms']:.2f})"


def main(out: Path, seed: int = 0, drives: int = 20) -> None:
    """Compare the filters, write the result and print its tables.

    Parameters
    ----------
    out : Path
        A JSON file.
    seed, drives : int
        As `compare_filters` takes them.
    """
    result = compare_filters(seed, drives)
    write_json(out, result)
    print(occupancy_tables(result))


if __name__ == "__main__":
    typer.run(main)
