"""How wrong a made ground truth is: cells counted by class and distance, against what the simulator knows (section 4).

Two things are known of each cell: what stands in it, and whether the camera sees it. A label is right when what it says
stands there. A cell that the camera sees should have a label.

The ways to make ground truth that the policy laboratory compares, and the errors in the data they start from (4).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.ground_truth import NO_FLAWS, TruthFlaws, TruthPolicy
from semgrid_edu.datasets.ground_truth.policy import MOVERS
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LabelSet
from semgrid_edu.workshop.scoring.counting import distance_bands

REACH = 9
"""Number of scans before, and after, the labelled one: 0.9 s. minikitti has as many before its labelled frames."""
BEFORE, AROUND = f"{REACH} scans before", f"{REACH} before and after"
OWN = TruthPolicy(REACH, REACH, "own", "carved", vote="majority")
FLAWS = TruthFlaws()


class Trial(NamedTuple):
    """One way to make ground truth, and from what.

    Parameters
    ----------
    policy : TruthPolicy
        The way.
    flaws : TruthFlaws
        The errors of calibration, labels and scans.
    """

    policy: TruthPolicy = TruthPolicy()
    flaws: TruthFlaws = FLAWS


def _windows() -> dict[str, Trial]:
    """Return the trials with several scans, so that most cells have many returns: their majority decides."""
    before = TruthPolicy(past=REACH, vote="majority")
    around = replace(before, future=REACH)
    windows = {
        BEFORE: before,
        AROUND: around,
        f"{AROUND}, own labels": replace(around, labels="own"),
    }
    return {
        f"{name}, movers {movers}": Trial(replace(policy, movers=movers))
        for name, policy in windows.items()
        for movers in MOVERS
    }


TRIALS = {
    "one scan (the paper)": Trial(),
    "one scan, no clean-up": Trial(TruthPolicy(cleanup="none")),
    "one scan, all classes spread alike": Trial(TruthPolicy(cleanup="spread")),
    "one scan, de-skewed": Trial(TruthPolicy(deskew=True)),
    "one scan, visible to LIDAR": Trial(TruthPolicy(visible_to="lidar")),
    "one scan, visible to camera": Trial(TruthPolicy(visible_to="camera")),
    "one scan, majority of returns": Trial(TruthPolicy(vote="majority")),
    **_windows(),
    f"{AROUND}, own labels, movers carved, no clean-up": Trial(replace(OWN, cleanup="none")),
    f"{AROUND}, own labels, movers carved, what stands wins": Trial(replace(OWN, vote="standing")),
    f"{AROUND}, own labels, movers carved, de-skewed": Trial(replace(OWN, deskew=True)),
    f"{AROUND}, own labels, movers carved, visible to LIDAR": Trial(replace(OWN, visible_to="lidar")),
    f"{AROUND}, own labels, movers carved, visible to camera": Trial(replace(OWN, visible_to="camera")),
    "one scan, no errors in the data": Trial(flaws=NO_FLAWS),
    "one scan, error of calibration alone": Trial(
        flaws=replace(NO_FLAWS, rotation=FLAWS.rotation, translation=FLAWS.translation)
    ),
    "one scan, errors of labels alone": Trial(flaws=replace(FLAWS, rotation=0, translation=0, skewed=False)),
    "one scan, skew alone": Trial(flaws=replace(NO_FLAWS, skewed=True)),
}
"""What is compared, by name. The last four show what each kind of error in the data does to the paper's way."""


BAND_EDGES = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 73.0)
"""Distances from the LIDAR at which the bands begin and end, metres; the grid's far corners are 72.7 m away."""
COUNTED = ("seen", "found", "missed", "labelled", "right", "hidden")
"""What is counted of each class c and each band: cells that the camera sees, in which c stands ("seen"), those of them
that are labelled c ("found") and those without a label ("missed"); cells that are labelled c ("labelled"), those of
them in which c stands ("right") and those that the camera doesn't see ("hidden")."""


@dataclass(frozen=True, eq=False)
class TruthCounts:
    """Cells of a made ground truth, counted by class and distance.

    Parameters
    ----------
    cells : (6, B, n_semantic) int64
        Numbers of cells: one plane for each of `COUNTED`, one row per band of distance, one column per class.
    """

    cells: NDArray[np.int64]

    @classmethod
    def of_frame(
        cls, made: NDArray, truth: NDArray, standing: NDArray, spec: GridSpec, label_set: LabelSet
    ) -> "TruthCounts":
        """Count the cells of one frame.

        Parameters
        ----------
        made : (H, W) int
            The made ground truth.
        truth : (H, W) int
            From `grid_truth`: what stands in the cells that the camera sees, an unknown class elsewhere.
        standing : (H, W) int
            What stands in each cell, seen or not; 255 where not even the simulator says.
        spec : GridSpec
            The grid.
        label_set : LabelSet
            The classes.

        Returns
        -------
        TruthCounts

        Raises
        ------
        ArgumentError
            When a map doesn't fit the grid.
        """
        for name, grid in (("made", made), ("truth", truth), ("standing", standing)):
            if np.shape(grid) != spec.shape:
                raise ArgumentError(name, f"shape {spec.shape}", f"shape {np.shape(grid)}")
        band, n = distance_bands(spec, BAND_EDGES), label_set.n_semantic
        chosen = {
            "seen": (truth, truth < n),
            "found": (truth, (truth < n) & (made == truth)),
            "missed": (truth, (truth < n) & (made >= n)),
            "labelled": (made, made < n),
            "right": (made, (made < n) & (made == standing)),
            "hidden": (made, (made < n) & (truth >= n)),
        }
        cells = np.zeros((len(COUNTED), len(BAND_EDGES) - 1, n), np.int64)
        for plane, name in enumerate(COUNTED):
            classes, where = chosen[name]
            np.add.at(cells[plane], (band[where], np.asarray(classes)[where]), 1)
        return cls(cells)

    def __add__(self, other: "TruthCounts") -> "TruthCounts":
        """Return the counts of the frames of both."""
        return TruthCounts(self.cells + other.cells)

    def shares(self, axis: int | tuple[int, ...] | None = None) -> dict[str, NDArray[np.float64]]:
        """Return what the counts say, as shares.

        Parameters
        ----------
        axis : int or tuple of int, optional
            What to add up first: 0 for the bands of distance, 1 for the classes, both for one number; nothing when
            left out.

        Returns
        -------
        dict of str to (...) float64
            Shares from 0 to 1; NaN where there is nothing to share. "wrong": of the labelled cells, those in which
            something else stands. "found", "mistaken" and "missed": of the cells that the camera sees, those with the
            right label, with another label, and without a label. "hidden": of the labelled cells, those that the
            camera doesn't see. "iou": intersection over union of both, among the cells that the camera sees.
        """
        added = () if axis is None else tuple(a + 1 for a in np.atleast_1d(axis))
        seen, found, missed, labelled, right, hidden = self.cells.sum(axis=added).astype(np.float64)
        with np.errstate(invalid="ignore"):
            return {
                "wrong": 1 - right / labelled,
                "found": found / seen,
                "mistaken": (seen - found - missed) / seen,
                "missed": missed / seen,
                "hidden": hidden / labelled,
                "iou": found / (seen + labelled - hidden - found),
            }
