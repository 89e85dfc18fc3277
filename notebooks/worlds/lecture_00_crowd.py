"""How many cells of the shipped street some networks call pedestrian, and how many are labelled so (section 4).

A network that nothing corrects far from labels may call these cells anything, and no score over labelled cells sees it.
"""

from pathlib import Path

import numpy as np
import typer
from numpy.typing import NDArray

from semgrid_edu.datasets.frames import visible_labels
from semgrid_edu.datasets.samples import real_drive, real_weights, segnet_real_weights
from semgrid_edu.fast import load_net
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.pipeline import run_pipeline
from semgrid_edu.storage.files import sha256, write_json
from semgrid_edu.storage.provenance import made_by

PEDESTRIAN = KITTI_14.index("pedestrian")


def crowd(weights: Path) -> dict[str, object]:
    """Return how many cells of each shipped frame a network calls pedestrian, and how many of these are labelled so.

    Both are counted before and after the CRF.

    Parameters
    ----------
    weights : Path
        The network's file.
    """
    drive = real_drive()
    maps = {"map": {"called": [], "right": []}, "after the CRF": {"called": [], "right": []}}
    for result in run_pipeline(drive, load_net(weights, drive.camera)):
        labelled = people(result.frame)
        for name, classes in zip(maps, (result.grid, result.refined), strict=True):
            called = classes.argmax(axis=0) == PEDESTRIAN
            maps[name]["called"].append(int(called.sum()))
            maps[name]["right"].append(int((called & labelled).sum()))
    return {"weights": sha256(weights), **maps}


def people(frame: Frame) -> NDArray[np.bool_]:
    """Return which cells of the compact grid are labelled pedestrian, (H, W).

    Parameters
    ----------
    frame : Frame
        A labelled frame.
    """
    return visible_labels(frame.labels, GridSpec.compact()) == PEDESTRIAN


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
    result: dict[str, object] = {name: crowd(weights) for name, weights in networks.items()}
    result["labelled"] = [int(people(frame).sum()) for frame in real_drive()]
    write_json(out, result | made_by("python -m worlds.lecture_00_crowd WITHOUT_GAPS OUT", "numpy", "torch", "numba"))


if __name__ == "__main__":
    typer.run(main)
