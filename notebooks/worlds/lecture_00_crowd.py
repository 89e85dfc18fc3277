"""How many cells of the shipped street networks call pedestrian, and how many are (section 4).

A network that nothing corrects far from labels may call these cells anything, and no score over labelled cells sees it.
"""

from pathlib import Path

import typer

from semgrid_edu.datasets import grid_truth
from semgrid_edu.datasets.samples import real_drive, real_weights, segnet_real_weights
from semgrid_edu.fast import load_net
from semgrid_edu.labels import KITTI_14
from semgrid_edu.pipeline import run_pipeline
from semgrid_edu.storage.files import sha256, write_json
from semgrid_edu.storage.provenance import made_by

PEDESTRIAN = KITTI_14.index("pedestrian")


def crowd(weights: Path) -> dict[str, object]:
    """Return the SHA-256 of a network, and its counts on each frame: cells called pedestrian, labelled so, and both.

    Parameters
    ----------
    weights : Path
        The network's file.
    """
    drive = real_drive()
    net = load_net(weights, drive.camera)
    counts: dict[str, list[int]] = {"called": [], "labelled": [], "right": []}
    for result in run_pipeline(drive, net):
        labelled = grid_truth(result.frame.labels, result.belief.probability, net.architecture.grid) == PEDESTRIAN
        called = result.grid.argmax(axis=0) == PEDESTRIAN
        for name, cells in zip(counts, (called, labelled, called & labelled), strict=True):
            counts[name].append(int(cells.sum()))
    return {"weights": sha256(weights), **counts}


def main(without_gaps: Path, out: Path) -> None:
    """Count for the shipped networks and for one that was trained without `--fill-gaps`, and write the result.

    Parameters
    ----------
    without_gaps : Path
        Weights from the command in data_samples/efficientnet_real/provenance.json without `--fill-gaps`.
    out : Path
        A JSON file.
    """
    networks = {
        "shipped network": real_weights(),
        "the same without --fill-gaps": without_gaps,
        "mean of three SegNets": segnet_real_weights(),
    }
    result = {name: crowd(weights) for name, weights in networks.items()}
    write_json(out, result | made_by("python -m worlds.lecture_00_crowd WITHOUT_GAPS OUT", "numpy", "torch", "numba"))


if __name__ == "__main__":
    typer.run(main)
