"""Labels of cells that are made from image labels and LIDAR: the policies that have names, and what makes them (4).

`cached_labels` keeps the labels until the code of this module, or of what it imports, changes. So only what makes
labels stands here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.ground_truth import Moment, TruthFlaws, TruthPolicy, drive_truth, flawed_drive
from semgrid_edu.datasets.readers.frames import LabelledDrive
from semgrid_edu.datasets.training_arrays import SEED, ArrayRecipe
from semgrid_edu.errors import ArgumentError
from semgrid_edu.occupancy import track_drive

ACCUMULATED = TruthPolicy(past=9, vote="majority")
"""The labelled scan and the nine before it, which began 0.9 s earlier, all labelled by the one labelled image, as in
KITTI. Most cells then have many returns, so that a majority can decide."""

POLICIES = {
    "lidar": TruthPolicy(),
    "no-cleanup": TruthPolicy(cleanup="none"),
    "accumulated-carved": replace(ACCUMULATED, movers="carved"),
    "accumulated-smeared": ACCUMULATED,
    "accumulated-carried": replace(ACCUMULATED, movers="carried"),
    "camera-mask": TruthPolicy(visible_to="camera"),
    "de-skewed": TruthPolicy(deskew=True),
}
"""The policies that networks learn from, by name; "lidar" is the paper's, as far as it says. Each of the others changes
one thing, except that the accumulated ones also take the majority's class."""


@dataclass(frozen=True)
class LidarTruth:
    """How the labels of a data set's cells are made from its image labels and scans.

    Parameters
    ----------
    policy : TruthPolicy
        What `lidar_truth` does.
    flaws : TruthFlaws
        The errors that image labels, calibration and scans get first, because simulated data have none: by default
        errors like those of real data. `NO_FLAWS` for real data.
    seed : int
        Seed for these errors. The error of calibration is the same in the whole data set.
    """

    policy: TruthPolicy = field(default_factory=TruthPolicy)
    flaws: TruthFlaws = field(default_factory=TruthFlaws)
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse a seed that numpy would refuse later."""
        if self.seed < 0:
            raise ArgumentError("seed", "a whole number from 0 up", self.seed)


def drive_labels(
    drive: LabelledDrive, labelled: Sequence[int], recipe: ArrayRecipe, truth: LidarTruth, number: int
) -> list[NDArray[np.uint8]]:
    """Make the labels of a drive's labelled frames.

    Parameters
    ----------
    drive : LabelledDrive
        The drive.
    labelled : sequence of int
        Numbers of its labelled frames.
    recipe : ArrayRecipe
        Grid and occupancy filter.
    truth : LidarTruth
        How to make them.
    number : int
        Number of the drive in its split, so that each drive gets errors of its own.

    Returns
    -------
    list of (H, W) uint8
    """
    last = min(max(labelled) + truth.policy.future, len(drive) - 1)
    frames = [replace(drive[k], image=None) for k in range(last + 1)]
    beliefs = list(track_drive(frames, recipe.spec, recipe.params, SEED))
    flawed = flawed_drive(frames, truth.flaws, truth.seed, number)
    moments = [Moment(frame, belief) for frame, belief in zip(flawed, beliefs, strict=True)]
    return [drive_truth(moments, k, recipe.spec, truth.policy) for k in labelled]
