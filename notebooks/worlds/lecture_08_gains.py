"""What each part of the fusion network adds: the scores that `lecture_08_ablation` measured, and their differences."""

import json

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import class_accuracy, pixel_accuracy
from semgrid_edu.storage.files import shipped_folder
from semgrid_edu.workshop.scoring.statistics import Interval, paired_interval

N_SEMANTIC = KITTI_14.n_semantic
"""The classes that count: *unknown* is forbidden as an answer, and its cells aren't scored."""

RESULT = "fusion_ablation.json"
"""The file in docs/results."""


def scores(counts: ArrayLike) -> NDArray[np.float64]:
    """Return accuracy and class accuracy of each seed over all streets, (S, 2) per cent.

    Parameters
    ----------
    counts : (S, N, 10, 10) int
        The confusion matrices of seeds and streets.
    """
    totals = np.sum(counts, axis=1)
    return 100 * np.array([(pixel_accuracy(one), class_accuracy(one)) for one in totals])


def written(counts: NDArray[np.int64]) -> list[str]:
    """Write each street's confusion matrix as one line, row after row.

    Parameters
    ----------
    counts : (N, 10, 10) int
        The matrices.
    """
    return [" ".join(map(str, one.ravel())) for one in counts]


def read() -> dict[str, NDArray[np.int64]]:
    """Return the measured confusion matrices by method, each (S, N, 10, 10)."""
    text = (shipped_folder("docs") / "results" / RESULT).read_text(encoding="utf-8")
    size = (-1, N_SEMANTIC, N_SEMANTIC)
    return {
        name: np.array([[line.split() for line in lines] for lines in seeds], dtype=np.int64).reshape(len(seeds), *size)
        for name, seeds in json.loads(text)["counts"].items()
    }


def difference(a: str, b: str) -> dict[str, Interval]:
    """Return how many points method a scores above b over streets and seeds, with 95 % intervals, by metric.

    Parameters
    ----------
    a, b : str
        The methods.
    """
    counts = read()
    metrics = {"accuracy": pixel_accuracy, "class accuracy": class_accuracy}
    pairs = {name: paired_interval(counts[a], counts[b], metric) for name, metric in metrics.items()}
    return {name: Interval(*(100 * end for end in pair)) for name, pair in pairs.items()}
