"""Counts by camera and frame: scores whose unit is the camera, and text that a reader can sum again (section 4.2)."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import METRICS, confusion_matrix
from semgrid_edu.workshop.scoring.score_with_interval import on_cells
from semgrid_edu.workshop.scoring.statistics import drive_interval, paired_interval
from worlds.lecture_08_real_streets import Part

Counts = dict[str, dict[str, NDArray]]
"""By method and camera: confusion matrices of the frames, (N, C, C), rows: labelled returns."""


def camera_of(frames: TrainingSet) -> str:
    """Return the name of the camera that took all frames, which begins the name of each drive.

    Parameters
    ----------
    frames : TrainingSet
        From `open_frames`.
    """
    return frames.drives[0].partition(",")[0]


def add_counts(counts: Counts, tested: list[Part], maps: dict[str, NDArray]) -> None:
    """Count every map's errors, camera by camera.

    Parameters
    ----------
    counts : dict
        Takes the counts.
    tested : list of Part
        The frames.
    maps : dict of str to (N, H, W) int
        The classes of all their cells, by the name of the method.
    """
    ends = np.cumsum([len(numbers) for _, numbers in tested])[:-1]
    for method, grids in maps.items():
        for (frames, numbers), called in zip(tested, np.split(grids, ends), strict=True):
            pairs = zip(frames.arrays["true"][numbers], called, strict=True)
            matrices = [confusion_matrix(true, one, len(KITTI_14)) for true, one in pairs]
            counts.setdefault(method, {})[camera_of(frames)] = np.stack(matrices)


def camera_scores(counts: Counts, method: str, rule: str) -> dict[str, object]:
    """Return both accuracies with intervals over cameras, also less those of a rule, and both by camera.

    Parameters
    ----------
    counts : dict
        From `add_counts`.
    method, rule : str
        Names of the method and of the one to compare with.
    """
    ours, theirs = (by_camera(counts[name]) for name in (method, rule))
    found: dict[str, object] = {}
    for name in ("pixel accuracy", "class accuracy"):
        metric = METRICS[name]
        found[name] = named(drive_interval(ours, metric))
        found[f"{name} above the {rule}"] = named(paired_interval(ours, theirs, metric))
        found[f"{name} by camera"] = {
            camera: float(metric(matrix)) for camera, matrix in zip(counts[method], ours[0], strict=True)
        }
    return found | {"cells": int(ours.sum())}


def by_camera(matrices: dict[str, NDArray]) -> NDArray[np.int64]:
    """Return the confusion matrices of cells with a semantic class, (1, V, C, C), a camera for each drive.

    Parameters
    ----------
    matrices : dict of str to (N, C, C) int
        Those of the frames, by camera.
    """
    return on_cells(np.stack([of_frames.sum(axis=0) for of_frames in matrices.values()])[None], "semantic", KITTI_14)


def named(interval: tuple[float, float, float]) -> dict[str, float]:
    """Name the ends and the middle of an interval.

    Parameters
    ----------
    interval : (float, float, float)
        Low, mean and high.
    """
    return dict(zip(("low", "mean", "high"), interval, strict=True))


def as_text(matrices: dict[str, NDArray]) -> dict[str, list[str]]:
    """Write each frame's matrix as a line: "0>3:12" are twelve cells of class 0 that are called class 3.

    Parameters are those of `by_camera`.
    """
    return {camera: [" ".join(_entries(matrix)) for matrix in frames] for camera, frames in matrices.items()}


def _entries(matrix: NDArray) -> Iterator[str]:
    for true, called in zip(*matrix.nonzero(), strict=True):
        yield f"{true}>{called}:{matrix[true, called]}"


def counts_of_text(lines: list[str]) -> NDArray[np.int64]:
    """Return the confusion matrices of frames, (N, C, C), from their lines in the JSON file.

    Parameters
    ----------
    lines : list of str
        One for each frame, such as "0>0:512 0>3:12".
    """
    matrices = np.zeros((len(lines), len(KITTI_14), len(KITTI_14)), np.int64)
    for matrix, line in zip(matrices, lines, strict=True):
        for entry in line.split():
            cell, _, number = entry.partition(":")
            true, _, called = cell.partition(">")
            matrix[int(true), int(called)] = int(number)
    return matrices
