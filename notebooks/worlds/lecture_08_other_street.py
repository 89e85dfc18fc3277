"""A released network on a street that nothing was chosen by: scored once, with the date (section 4).

The baselines are fitted to the frames that the network has learned from.
"""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import typer

from semgrid_edu.datasets.pandaset import CAMERAS, PandasetScene
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import METRICS
from semgrid_edu.networks.weights import read_architecture
from semgrid_edu.storage.files import sha256, write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, on_cells, per_cent
from worlds.lecture_08_camera_worth import cells_of, heights_of, network_maps, without_networks
from worlds.lecture_08_counts import Counts, add_counts, as_text
from worlds.lecture_08_real_streets import Part, open_frames, open_views


def other_street(
    root: str | Path, learned: str, other: str, runs: str | Path, weights: str | Path
) -> dict[str, object]:
    """Score a network and the baselines on the front camera of a street that the network hasn't learned from.

    Parameters
    ----------
    root : path-like
        The folder of PandaSet's scenes.
    learned, other : str
        The scene that the network has learned from, such as "002", and the one to score on.
    runs : path-like
        Takes the arrays that are made of the frames.
    weights : path-like
        The network.

    Returns
    -------
    dict
        Both accuracies, recalls and counts by frame of each method, and what made them.
    """
    runs = Path(runs)
    views = open_views(root, learned, runs / learned)
    drive = PandasetScene(root, other, CAMERAS[0])
    frames = open_frames(drive, runs / other, read_architecture(weights).image_size)
    fitted = [(one, list(range(len(one)))) for one in views.values()]
    tested: list[Part] = [(frames, list(range(len(frames))))]
    above = {
        camera: heights_of(PandasetScene(root, learned, camera), one, runs / learned) for camera, one in views.items()
    }
    maps = network_maps(tested, Path(weights))
    of_other = {CAMERAS[0]: heights_of(drive, frames, runs / other)}
    maps |= without_networks(cells_of(fitted, above), cells_of(tested, of_other))
    counts: Counts = {}
    add_counts(counts, tested, maps)
    methods = {method: _scores(by_camera[CAMERAS[0]]) for method, by_camera in counts.items()}
    command = f"python -m worlds.lecture_08_other_street PANDASET RUNS WEIGHTS OUT --learned {learned} --other {other}"
    return {
        "scored at": f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        "weights": sha256(weights),
        "methods": methods,
        **made_by(command, "numpy", "torch", "numba", "scikit-learn"),
    }


def _scores(matrices: np.ndarray) -> dict[str, object]:
    """Return both accuracies and recalls of cells with a semantic class, and the counts of each frame."""
    total = on_cells(matrices.sum(axis=0), "semantic", KITTI_14)
    recalls = {KITTI_14.names[c]: row[c] / row.sum() for c, row in enumerate(total) if row.any()}
    return {
        **{name: float(METRICS[name](total)) for name in ("pixel accuracy", "class accuracy")},
        "recall": recalls,
        "cells": int(total.sum()),
        "counts": as_text({CAMERAS[0]: matrices})[CAMERAS[0]],
    }


def other_street_table(result: dict[str, object]) -> str:
    """Return the scores as a Markdown table, per cent.

    Parameters
    ----------
    result : dict
        From `other_street`.
    """
    methods = result["methods"]
    classes = list(next(iter(methods.values()))["recall"])
    rows = [["", "pixel accuracy", "class accuracy", *classes]]
    for name, scores in methods.items():
        values = [scores["pixel accuracy"], scores["class accuracy"], *(scores["recall"][c] for c in classes)]
        rows.append([name, *map(per_cent, values)])
    return markdown_table(rows)


def main(pandaset: Path, runs: Path, weights: Path, out: Path, learned: str = "002", other: str = "001") -> None:
    """Score a network, write the result and print its table; a network that was scored isn't scored again.

    Parameters
    ----------
    pandaset : Path
        The folder of PandaSet's scenes.
    runs, weights, learned, other
        As `other_street` takes them.
    out : Path
        A JSON file; it mustn't exist yet.
    """
    if out.exists():
        raise typer.BadParameter(f"{out} holds a score: a network is scored on this street once")
    result = other_street(pandaset, learned, other, runs, weights)
    write_json(out, result)
    print(other_street_table(result))


if __name__ == "__main__":
    typer.run(main)
