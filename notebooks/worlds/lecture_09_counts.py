"""Errors of labels made from LIDAR: cells counted by class and distance, against the true street (section 4).

We know two things about each cell: its true class, and whether the camera sees it. A label is right if it is the true
class. A cell that the camera sees should have a label.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14, LabelSet

BAND_EDGES = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 73.0)
"""Limits of the bands of distance from the LIDAR, metres; the grid's far corners are 72.7 m away."""
COUNTED = ("seen", "found", "missed", "labelled", "right", "hidden")
"""The counts for each class c and each band: cells of true class c that the camera sees ("seen"), how many of them are
labelled c ("found") or have no label ("missed"); cells labelled c ("labelled"), and how many of them are truly c
("right") or unseen by the camera ("hidden")."""
ABOUT = {"counted": list(COUNTED), "bands": list(BAND_EDGES), "classes": list(KITTI_14.names[: KITTI_14.n_semantic])}
"""The description that a file of such counts contains."""


@dataclass(frozen=True, eq=False)
class TruthCounts:
    """Cells of a map of labels, counted by class and distance.

    Parameters
    ----------
    cells : (6, B, n_semantic) int64
        Numbers of cells: one plane for each of `COUNTED`, one row per band of distance, one column per class.
    """

    cells: NDArray[np.int64]

    @classmethod
    def of_frame(
        cls, labels: NDArray, truth: NDArray, standing: NDArray, spec: GridSpec, label_set: LabelSet
    ) -> "TruthCounts":
        """Count the cells of one frame.

        Parameters
        ----------
        labels : (H, W) int
            The labels made from LIDAR.
        truth : (H, W) int
            From `grid_truth`: the true class of the cells that the camera sees, an unknown class elsewhere.
        standing : (H, W) int
            The true class of each cell, seen or not; 255 if not even the simulator knows it.
        spec : GridSpec
            The grid.
        label_set : LabelSet
            The classes.

        Raises
        ------
        ArgumentError
            When a map doesn't fit the grid.
        """
        for name, grid in (("labels", labels), ("truth", truth), ("standing", standing)):
            check_shape(name, grid, spec.shape)
        band = np.digitize(spec.distances(), BAND_EDGES[1:-1])
        n = label_set.n_semantic
        chosen = (
            (truth, truth < n),
            (truth, (truth < n) & (labels == truth)),
            (truth, (truth < n) & (labels >= n)),
            (labels, labels < n),
            (labels, (labels < n) & (labels == standing)),
            (labels, (labels < n) & (truth >= n)),
        )  # in the order of COUNTED
        cells = np.zeros((len(COUNTED), len(BAND_EDGES) - 1, n), np.int64)
        for plane, (classes, where) in zip(cells, chosen, strict=True):
            np.add.at(plane, (band[where], np.asarray(classes)[where]), 1)
        return cls(cells)

    def __add__(self, other: "TruthCounts") -> "TruthCounts":
        """Return the counts of the frames of both."""
        return TruthCounts(self.cells + other.cells)

    def shares(self, axis: int | tuple[int, ...] | None = None) -> dict[str, NDArray[np.float64]]:
        """Return the counts as shares.

        Parameters
        ----------
        axis : int or tuple of int, optional
            What to add up first: 0 for the bands of distance, 1 for the classes, both for one number; nothing when
            left out.

        Returns
        -------
        dict of str to (...) float64
            Shares from 0 to 1, in the order of the tables' columns; NaN where there is nothing to share. "found",
            "mistaken" and "missed": of the cells that the camera sees, those with the right label, with another label,
            and without a label. "wrong": of the labelled cells, those with another true class. "hidden": of the
            labelled cells, those that the camera doesn't see. "iou": intersection over union of both, among the cells
            that the camera sees.
        """
        added = () if axis is None else tuple(a + 1 for a in np.atleast_1d(axis))
        seen, found, missed, labelled, right, hidden = self.cells.sum(axis=added).astype(np.float64)
        with np.errstate(invalid="ignore"):
            return {
                "found": found / seen,
                "mistaken": (seen - found - missed) / seen,
                "missed": missed / seen,
                "wrong": 1 - right / labelled,
                "hidden": hidden / labelled,
                "iou": found / (seen + labelled - hidden - found),
            }


def counts_of(result: dict, name: str) -> TruthCounts:
    """Return the counts of one trial.

    Parameters
    ----------
    result : dict
        From `truth_policies`, or from the JSON file that it was written to.
    name : str
        The name of the trial.

    Raises
    ------
    ArgumentError
        When the result has no such trial.
    """
    if name not in result["sums"]:
        raise ArgumentError("name", f"one of {', '.join(result['sums'])}", repr(name))
    return TruthCounts(np.array(result["sums"][name]))
