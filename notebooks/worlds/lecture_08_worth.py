"""Results that lecture 08 shows: what the camera is worth on a real street, and what training end to end buys."""

import json

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import KITTI_14
from semgrid_edu.storage.files import shipped_folder
from worlds.lecture_08_counts import by_camera, counts_of_text

RESULTS = shipped_folder("docs") / "results"
"""The folder of the results."""

UNSEEN = "each pair of cameras left out"
"""The scores of cameras that a method hasn't learned from."""

METHODS = {
    "always road": "always road",
    "table of occupancy states": "table of o",
    "height rule": "height rule",
    "fusion of o, unknown forbidden": "network: o",
    "fusion of image and o, unknown forbidden": "network: o, image",
    "fusion of o and heights, unknown forbidden": "network: o, heights",
    "fusion of image, o and heights, unknown forbidden": "network: o, heights, image",
    "forest on heights and o": "forest: o, heights",
    "forest on heights, o and image scores": "forest: o, heights, image",
}
"""Methods by their names in the results, and here; each calls every scored cell by a semantic class."""


def _read(name: str) -> dict:
    return json.loads((RESULTS / name).read_text(encoding="utf-8"))


def by_method() -> dict[str, tuple[float, float, float]]:
    """Return each method's pixel accuracy, per cent: lower end of its interval, mean, upper end."""
    scores = _read("camera_worth.json")["scores"][UNSEEN]
    accuracies = {short: scores[name]["pixel accuracy"] for name, short in METHODS.items()}
    return {name: tuple(100 * score[key] for key in ("low", "mean", "high")) for name, score in accuracies.items()}


def calls_of(name: str) -> dict[str, dict[str, float]]:
    """Return, for four methods without a camera, the shares of a class's cells that are called building, car, road.

    Parameters
    ----------
    name : str
        The class.
    """
    counts = _read("camera_worth.json")["counts"][UNSEEN]
    found = {}
    for method, short in METHODS.items():
        if short in ("table of o", "network: o", "height rule", "network: o, heights"):
            row = _matrix(counts[method])[KITTI_14.index(name)]
            shares = {other: float(row[KITTI_14.index(other)] / row.sum()) for other in ("building", "car", "road")}
            found[short] = shares | {"other": 1 - sum(shares.values())}
    return found


def _matrix(text: dict[str, list[str]]) -> NDArray[np.int64]:
    """Return the confusion matrix of all cameras together."""
    return by_camera({camera: counts_of_text(lines) for camera, lines in text.items()})[0].sum(axis=0)


def by_planes() -> tuple[float, float]:
    """Return the pixel accuracy of networks trained with one plane and with twenty, by true labels, per cent."""
    variants = {one["what"]: one["scores"]["true"]["semantic"] for one in _read("reduced/ablations.json")["variants"]}
    return tuple(100 * variants[name]["pixel accuracy"]["mean"] for name in ("1 plane", "usual"))


def end_to_end() -> tuple[float, float, float]:
    """Return by how many points of pixel accuracy end to end exceeds two stages, by true labels: mean, low, high."""
    readings = _read("reduced/claims.json")["claims"]["10"]["readings"]
    value = readings[1]["statements"][0]["value"]
    return tuple(100 * value[key] for key in ("mean", "low", "high"))
