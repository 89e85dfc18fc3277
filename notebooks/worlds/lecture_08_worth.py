"""Results that lecture 08 shows: what the camera is worth on a real street, and what training end to end buys."""

import json

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import pixel_accuracy
from semgrid_edu.storage.files import shipped_folder
from semgrid_edu.workshop.scoring.statistics import Interval, paired_interval
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


def by_method(metric: str) -> dict[str, tuple[float, float, float]]:
    """Return each method's score, per cent: lower end of its interval, mean, upper end.

    Parameters
    ----------
    metric : str
        "pixel accuracy" or "class accuracy".
    """
    scores = _read("camera_worth.json")["scores"][UNSEEN]
    found = {short: scores[name][metric] for name, short in METHODS.items()}
    return {name: tuple(100 * score[key] for key in ("low", "mean", "high")) for name, score in found.items()}


def counts_by_method() -> dict[str, NDArray[np.int64]]:
    """Return each method's confusion matrix of all cameras together."""
    counts = _read("camera_worth.json")["counts"][UNSEEN]
    return {short: _matrix(counts[name]) for name, short in METHODS.items()}


def calls_of(name: str, methods: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Return, by method, the shares of a class's cells that are called building, car, road, or something else.

    Parameters
    ----------
    name : str
        The class.
    methods : tuple of str
        The methods.
    """
    found = {}
    counts = counts_by_method()
    for method in methods:
        row = counts[method][KITTI_14.index(name)]
        shares = {other: float(row[KITTI_14.index(other)] / row.sum()) for other in ("building", "car", "road")}
        found[method] = shares | {"other": 1 - sum(shares.values())}
    return found


def gain(method: str, over: str, name: str) -> tuple[float, float]:
    """Return how many more of all cells a method has right than another, and of one class alone, per cent of all cells.

    Parameters
    ----------
    method, over : str
        The methods.
    name : str
        The class.
    """
    counts = counts_by_method()
    more = (np.diag(counts[method]) - np.diag(counts[over])) / counts[method].sum()
    return 100 * float(more.sum()), 100 * float(more[KITTI_14.index(name)])


def _matrix(text: dict[str, list[str]]) -> NDArray[np.int64]:
    """Return the confusion matrix of all cameras together."""
    return by_camera({camera: counts_of_text(lines) for camera, lines in text.items()})[0].sum(axis=0)


def claim(number: str) -> dict[str, dict[str, tuple[float, float, float]]]:
    """Return a claim's differences in points, by the labels that judge and by metric: lower end, mean, upper end.

    All networks learned from labels that a LIDAR made. They are judged by such labels and by true ones.

    Parameters
    ----------
    number : str
        The claim's number in docs/results/reduced/claims.md.
    """
    readings = _read("reduced/claims.json")["claims"][number]["readings"]
    return {
        name: {
            one["what"].split(":")[0]: tuple(100 * one["value"][key] for key in ("low", "mean", "high"))
            for one in readings[k]["statements"]
        }
        for k, name in enumerate(("LIDAR labels", "true labels"))
    }


def verdicts(number: str) -> set[str]:
    """Return the verdicts of the project's rule on a claim. Parameters are those of `claim`."""
    return {one["verdict"] for one in _read("reduced/claims.json")["claims"][number]["readings"][:2]}


def claim_steps() -> int:
    """Return for how many steps each of these networks was trained after stage one."""
    return _read("reduced/claims.json")["iterations"][1]


def advantage(method: str, over: str) -> Interval:
    """Return how many points of accuracy a method is ahead, with a 95 % interval over the six cameras.

    Parameters
    ----------
    method, over : str
        The methods, values of `METHODS`.
    """
    counts = _read("camera_worth.json")["counts"][UNSEEN]
    long = {short: name for name, short in METHODS.items()}
    pair = []
    for name in (method, over):
        cameras = counts[long[name]].items()
        pair.append(by_camera({camera: counts_of_text(lines) for camera, lines in cameras}))
    return Interval(*(100 * end for end in paired_interval(*pair, pixel_accuracy)))
