"""Counts of semantic grids by when the camera last saw a cell: now, before, or never (section 3)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import METRICS, confusion_matrix
from semgrid_edu.occupancy import PlanarMotion
from semgrid_edu.occupancy.planar_motion import look_up
from semgrid_edu.workshop.course.street import cells_seen, frames_since_seen
from semgrid_edu.workshop.scoring.calibration import (
    expected_calibration_error,
    reliability,
    reliability_of_sums,
    reliability_sums,
)
from semgrid_edu.workshop.scoring.confusions import (
    BANDS,
    band_names,
    distance_bands,
)
from semgrid_edu.workshop.scoring.score_with_interval import (
    compared,
    markdown_table,
    per_cent,
    score_with_interval,
    shown,
)

GROUPS = ("in view", "seen before", "never seen", "seen later")
"""The cells that the camera sees now, those that it saw before, the others, and those of them that it sees later."""
ONE, LAST_LOOK, MEMORY, SMOOTHED = "one frame", "last look", "memory", "whole drive"
"""The two baselines, the memory, and `smooth_drive`, by their names in the tables."""
TIMES = ((1, 1), (2, 5), (6, 10), (11, 20))
"""Parts of the cells in view: by the number of frames that saw them, from and to."""
GAINS = {"gain": (MEMORY, ONE), "gain over the last look": (MEMORY, LAST_LOOK), "gain of smoothing": (SMOOTHED, MEMORY)}
"""Which methods are compared, by name."""
PIXEL, CLASS, FORBIDDEN = "pixel accuracy", "class accuracy", "unknown forbidden"
"""The metrics; the last one is pixel accuracy when only semantic classes may be answered."""


def frames_in_view(frames: Sequence[Frame], spec: GridSpec) -> NDArray[np.int64]:
    """Return in how many frames up to each one the camera saw each cell, (F, H, W).

    Parameters
    ----------
    frames, spec : sequence of F Frame, GridSpec
        As `frames_since_seen` takes them.
    """
    count = np.zeros((len(frames), *spec.shape), int)
    for now, _, seen in cells_seen(frames, spec):
        count[now] += seen
    return count


def last_looks(frames: Sequence[Frame], maps: Sequence[NDArray], since: NDArray, spec: GridSpec) -> list[NDArray]:
    """Return each cell's distribution from the frame in which the camera last saw it, (C, H, W) for each frame.

    Parameters
    ----------
    frames : sequence of F Frame
        The frames, in the order of time.
    maps : sequence of F (C, H, W) float32
        The semantic grid of each frame alone. Cells in view, and those that were never seen, keep it.
    since : (F, H, W) int
        From `frames_since_seen`.
    spec : GridSpec
        The grid, (H, W) cells.
    """
    looks = [one.copy() for one in maps]
    for now, look in enumerate(looks):
        for ago in np.unique(since[now][since[now] > 0]):
            motion = PlanarMotion.from_poses(frames[now - ago].T_world_from_lidar, frames[now].T_world_from_lidar)
            then = look_up(maps[now - ago], np.zeros(len(look), np.float32), spec, spec, motion)
            look[:, since[now] == ago] = then[:, since[now] == ago]
    return looks


class CellCounts(NamedTuple):
    """The counts for some cells and one method.

    Parameters
    ----------
    confusion : (C, C) int64
        One row per true class.
    forbidden : (C, C) int64
        The same when only semantic classes may be answered.
    by_confidence : (3, B) float64
        As `GridCounts.reliability`.
    brier : float
        Sum over the cells of the squared distance between the distribution and the true class.
    """

    confusion: NDArray[np.int64]
    forbidden: NDArray[np.int64]
    by_confidence: NDArray[np.float64]
    brier: float


def count_cells(probability: NDArray, truth: NDArray) -> CellCounts:
    """Count how a distribution over the classes does in labelled cells.

    Parameters
    ----------
    probability : (C, N) float
        In each cell.
    truth : (N,) uint8
        Their classes.
    """
    n = len(probability)
    semantic = probability[: KITTI_14.n_semantic]
    confusion, forbidden = (confusion_matrix(truth, of.argmax(axis=0), n) for of in (probability, semantic))
    if not len(truth):
        return CellCounts(confusion, forbidden, np.zeros((3, 15)), 0.0)
    sums = reliability_sums(reliability(probability, truth))
    return CellCounts(confusion, forbidden, sums, float(np.square(probability - np.eye(n)[:, truth]).sum()))


class GainCounts:
    """Counts of several drives: by group of cells, band of distance or time since the last view, and method.

    Parameters
    ----------
    spec : GridSpec
        The grid of all drives.
    """

    def __init__(self, spec: GridSpec) -> None:
        self.spec, self._bands = spec, distance_bands(spec, BANDS)
        self._counts: dict[tuple[str, str], list[CellCounts]] = {}

    def add(self, frames: Sequence[Frame], grids: Sequence[dict[str, NDArray]]) -> None:
        """Count a drive.

        Parameters
        ----------
        frames : sequence of F Frame
            Its labelled frames.
        grids : sequence of F dict of str to (C, H, W) float
            What the methods make of each, by name.
        """
        since = frames_since_seen(frames, self.spec)
        until = frames_since_seen(frames[::-1], self.spec)[::-1]
        truth = np.stack([one.labels.birdseye_on(self.spec) for one in frames])
        looks = last_looks(frames, [grid[ONE] for grid in grids], since, self.spec)
        groups = self._groups(since, until, frames_in_view(frames, self.spec), truth != IGNORE)
        for method in (*grids[0], LAST_LOOK):
            said = np.stack(looks if method == LAST_LOOK else [grid[method] for grid in grids], axis=1)
            for name, cells in groups.items():
                self._counts.setdefault((name, method), []).append(count_cells(said[:, cells], truth[cells]))

    def _groups(self, since: NDArray, until: NDArray, count: NDArray, labelled: NDArray) -> dict[str, NDArray]:
        """Return the cells of each group, and of the parts of the first two by distance and by time."""
        seen = dict(zip(GROUPS, (since == 0, since > 0, since < 0, (since < 0) & (until > 0)), strict=True))
        bands = {f"in view, {name}": seen["in view"] & (self._bands == k) for k, name in enumerate(band_names(BANDS))}
        times = {f"in view, frames {a} to {b}": seen["in view"] & (count >= a) & (count <= b) for a, b in TIMES}
        ago = {f"seen {k} to {k + 4} frames ago": (since >= k) & (since < k + 5) for k in (1, 6, 11)}
        return {name: cells & labelled for name, cells in (seen | bands | times | ago).items()}

    def summary(self) -> dict[str, object]:
        """Return the scores of each group, and what memory gains over one frame, with intervals over the drives."""
        return {name: self._scores(name) for name in dict.fromkeys(name for name, _ in self._counts)}

    def _scores(self, name: str) -> dict[str, object]:
        of = {method: counts for (group, method), counts in self._counts.items() if group == name}
        of = of if name in GROUPS else {method: of[method] for method in of if method in (ONE, MEMORY, SMOOTHED)}
        stacked = {method: np.stack([one.confusion for one in counts])[None] for method, counts in of.items()}
        forbidden = {method: np.stack([one.forbidden for one in counts])[None] for method, counts in of.items()}
        cells = int(stacked[ONE].sum())
        if not cells:
            return {"cells": 0}
        scores = {"cells": cells, "methods": {method: _method(of[method], stacked[method]) for method in of}}
        return scores | {key: _gain(stacked, forbidden, *pair) for key, pair in GAINS.items() if set(pair) <= set(of)}


def _gain(stacked: dict[str, NDArray], forbidden: dict[str, NDArray], better: str, base: str) -> dict[str, object]:
    """Return what one method gains over another one, with intervals."""
    gains = {key: compared(stacked[better], stacked[base], METRICS[key]) for key in (PIXEL, CLASS)}
    return gains | {FORBIDDEN: compared(forbidden[better], forbidden[base], METRICS[PIXEL])}


def _method(counts: Sequence[CellCounts], confusions: NDArray) -> dict[str, object]:
    """Return the scores of one method in one group of cells."""
    total = confusions.sum(axis=(0, 1))
    cells = confusions.sum()
    of_class = np.maximum(total.sum(axis=1), 1)
    sums = sum(one.by_confidence for one in counts)
    return {
        **{key: score_with_interval(confusions, METRICS[key]) for key in (PIXEL, CLASS)},
        FORBIDDEN: float(sum(np.trace(one.forbidden) for one in counts) / cells),
        "recall": {name: float(total[c, c] / of_class[c]) for c, name in enumerate(KITTI_14.names) if total[c].any()},
        "called unknown": float(total[:, KITTI_14.n_semantic :].sum() / cells),
        "ECE": expected_calibration_error(reliability_of_sums(sums)),
        "Brier": sum(one.brier for one in counts) / float(cells),
    }


def memory_tables(result: dict) -> str:
    """Return a table for each street: the methods by group of cells and by part of a group, per cent, and gains.

    Parameters
    ----------
    result : dict
        From `measure_memory`, or from the JSON file that it was written to.
    """
    return "\n\n".join(f"{street}\n\n{markdown_table(_rows(groups))}" for street, groups in result["scores"].items())


def _rows(groups: dict[str, dict]) -> list[list[str]]:
    rows = [["cells", "method", PIXEL, CLASS, FORBIDDEN, "called unknown", "ECE", "Brier"]]
    for name, one in groups.items():
        for method, scores in one.get("methods", {}).items():
            metrics = [shown(scores[key]) for key in (PIXEL, CLASS)]
            others = [per_cent(scores[key]) for key in (FORBIDDEN, "called unknown", "ECE")]
            rows.append([f"{name} ({one['cells']})", method, *metrics, *others, f"{scores['Brier']:.3f}"])
        rows += [[name, key, *map(shown, one[key].values()), "", "", ""] for key in GAINS if key in one]
    return rows
