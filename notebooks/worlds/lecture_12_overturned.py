"""Is an overturned car called a car as often as the same car on its wheels? A control for claim 6 (section 4.4).

`semgrid-edu reproduce` compares overturned cars with upright ones that stand elsewhere. Here each drive is simulated
twice with the same seed: once the car lies on its top, once it stands in the same place.
"""

from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import numpy as np
import typer
from numpy.typing import NDArray
from tqdm.auto import trange

from semgrid_edu.datasets import grid_truth
from semgrid_edu.datasets.samples import sample_weights
from semgrid_edu.fast import load_net
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.pipeline import Stages, run_frame
from semgrid_edu.storage.files import sha256, write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.paper.other_runs import boxes_on
from semgrid_edu.workshop.scoring.statistics import drive_interval, paired_interval
from semgrid_edu.workshop.simulation.drive import PERIOD, SimulatedDrive
from semgrid_edu.workshop.simulation.street.plan import Wishes
from semgrid_edu.workshop.simulation.street.road_users import overturned_car
from semgrid_edu.workshop.simulation.street.traffic import Traffic
from worlds.lecture_04_scenes import labelled_frame

FRAMES = 10
"""Frames of a drive, one second; the last has the car 10 to 22 m ahead, and is scored."""
N_PAIRS = 48
"""Number of pairs of drives in which the network's grid has cells of the car both ways."""
FIRST_SEED = 9000
"""The seed of the first drive; no data set of the course has these."""
ON_ITS_TOP, ON_ITS_WHEELS = "on its top", "on its wheels"


def upright_car(traffic: Traffic) -> None:
    """Add what `overturned_car` adds, but with the car on its wheels. Parameters are those of `fill_street`."""
    park = traffic.park
    with patch.object(traffic, "park", lambda *place, overturned=False: park(*place)):
        overturned_car(traffic)


CASTS: dict[str, Callable[[Traffic], None]] = {ON_ITS_TOP: overturned_car, ON_ITS_WHEELS: upright_car}
"""Who is on the street, by how the car lies."""


def drive_pair(seed: int) -> dict[str, SimulatedDrive]:
    """Return the drives of a seed, by how one car lies; nothing else differs.

    Parameters
    ----------
    seed : int
        Seed for both drives.
    """
    return {name: SimulatedDrive(seed, FRAMES, Wishes(cast=cast)) for name, cast in CASTS.items()}


def the_car(drives: dict[str, SimulatedDrive]) -> dict[str, object] | None:
    """Return the car of a pair that lies in one drive and stands in the other, or None where no place was free.

    Parameters
    ----------
    drives : dict of str to SimulatedDrive
        From `drive_pair`.
    """
    objects = drives[ON_ITS_TOP].objects((FRAMES - 1) * PERIOD)
    return next((one for one in objects if one.get("overturned", False)), None)


def count(drive: SimulatedDrive, car: dict[str, object], net: SemanticGridNet) -> NDArray[np.int64]:
    """Count what a network calls the cells of one car in the last frame of a drive, (C, C); rows: the truth.

    Parameters
    ----------
    drive : SimulatedDrive
        The drive.
    car : dict
        The car, from `SimulatedDrive.objects`.
    net : SemanticGridNet
        The network.
    """
    stages = Stages.fast(net).started()
    for k in range(FRAMES - 1):
        stages.track.step(drive.scan(k))
    result = run_frame(labelled_frame(drive, FRAMES - 1), stages)
    spec = net.need_architecture().grid
    truth = grid_truth(result.frame.labels, result.belief.probability, spec)
    counted = boxes_on(spec, [car]) & (truth == KITTI_14.index("car"))
    return confusion_matrix(np.where(counted, truth, IGNORE), result.grid.argmax(axis=0), len(KITTI_14))


def called_car(matrix: NDArray) -> float:
    """Return the share of the cells of cars that are called car.

    Parameters
    ----------
    matrix : (C, C) int
        Counts; rows are the truth.
    """
    row = matrix[KITTI_14.index("car")]
    return row[KITTI_14.index("car")] / row.sum()


def compare_pairs() -> dict[str, object]:
    """Compare overturned cars with the same cars on their wheels, by the shipped compact SegNet.

    Returns
    -------
    dict
        "called car": the share of the cells with an interval over drives, for each way, and their "difference";
        "counts": cells and cells called car by drive; and what made them.
    """
    weights = sample_weights()
    net = None
    seed = FIRST_SEED
    seeds = []
    matrices: dict[str, list[NDArray]] = {name: [] for name in CASTS}
    bar = trange(N_PAIRS, unit="pair")
    while len(seeds) < N_PAIRS:
        drives = drive_pair(seed)
        net = net or load_net(weights, drives[ON_ITS_TOP].rig.camera)
        car = the_car(drives)
        counted = {name: count(drive, car, net) for name, drive in drives.items()} if car else {}
        if counted and all(one.any() for one in counted.values()):
            seeds.append(seed)
            bar.update()
            for name, one in counted.items():
                matrices[name].append(one)
        seed += 1
    bar.close()
    stacked = {name: np.stack(some)[None] for name, some in matrices.items()}
    car = KITTI_14.index("car")
    return {
        "called car": {name: drive_interval(some, called_car)._asdict() for name, some in stacked.items()},
        "difference": paired_interval(stacked[ON_ITS_TOP], stacked[ON_ITS_WHEELS], called_car)._asdict(),
        "seeds": seeds,
        "counts": {
            name: {"cells": some[0, :, car].sum(axis=1).tolist(), "called car": some[0, :, car, car].tolist()}
            for name, some in stacked.items()
        },
        "weights": sha256(weights),
        **made_by("python -m worlds.lecture_12_overturned OUT", "numpy", "torch", "numba", "embreex", "trimesh"),
    }


def main(out: Path) -> None:
    """Compare, write the result as JSON, and print it.

    Parameters
    ----------
    out : Path
        A JSON file.
    """
    result = compare_pairs()
    write_json(out, result)
    for name, interval in [*result["called car"].items(), ("difference", result["difference"])]:
        print(f"{name:<14} {100 * interval['mean']:.1f} ({100 * interval['low']:.1f} to {100 * interval['high']:.1f})")


if __name__ == "__main__":
    typer.run(main)
