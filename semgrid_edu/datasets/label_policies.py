"""Labels of cells made from image labels and LIDAR: named policies, and the loop over a drive (section 4).

Changing this module, or anything it imports, invalidates the labels that `cached_labels` keeps. So it contains only the
code that makes labels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.ground_truth import Moment, TruthPolicy, drive_truth
from semgrid_edu.datasets.training_arrays import SEED, ArrayRecipe
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame

ACCUMULATED = TruthPolicy(past=9, vote="majority")
"""The labelled scan and the nine before it (0.9 s), all labelled by the one labelled image, as in KITTI. Most cells
then have many returns, enough for a majority vote."""

POLICIES = {
    "lidar": TruthPolicy(),
    "no-cleanup": TruthPolicy(cleanup="none"),
    "accumulated-carved": replace(ACCUMULATED, movers="carved"),
    "accumulated-smeared": ACCUMULATED,
    "accumulated-carried": replace(ACCUMULATED, movers="carried"),
    "camera-mask": TruthPolicy(visible_to="camera"),
    "de-skewed": TruthPolicy(deskew=True),
}
"""The policies for training labels, by name; "lidar" is the paper's, as far as it is described. Each of the others
changes one thing, except that the accumulated ones also use a majority vote."""


class FrameErrors(Protocol):
    """Errors that are added to frames, such as `semgrid_edu.workshop.flaws.TruthFlaws`; a frozen dataclass."""

    def apply(self, frames: Sequence[Frame], seed: int, number: int) -> list[Frame]:
        """Return the frames with errors.

        Parameters
        ----------
        frames : sequence of Frame
            The frames of a drive.
        seed : int
            Seed for the errors.
        number : int
            Number of the drive, so that the errors of two drives differ.
        """


@dataclass(frozen=True)
class LidarTruth:
    """How to make the labels of a data set's cells from its image labels and scans.

    Parameters
    ----------
    policy : TruthPolicy
        The policy of `lidar_truth`.
    flaws : FrameErrors, optional
        Errors to add first to image labels, calibration and scans, because simulated data have none. None for real
        data.
    seed : int
        Seed for these errors. The calibration error is the same in the whole data set.
    """

    policy: TruthPolicy = field(default_factory=TruthPolicy)
    flaws: FrameErrors | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the seed, which numpy would do only later."""
        if self.seed < 0:
            raise ArgumentError("seed", "a whole number from 0 up", self.seed)


def drive_labels(
    drive: FrameSequence, labelled: Sequence[int], recipe: ArrayRecipe, truth: LidarTruth, number: int
) -> list[NDArray[np.uint8]]:
    """Make the labels of a drive's labelled frames.

    Parameters
    ----------
    drive : FrameSequence
        The drive.
    labelled : sequence of int
        Numbers of its labelled frames.
    recipe : ArrayRecipe
        Grid and occupancy filter.
    truth : LidarTruth
        How to make them.
    number : int
        Number of the drive in its split, so that the errors of two drives differ.

    Returns
    -------
    list of (H, W) uint8
    """
    last = min(max(labelled) + truth.policy.future, len(drive) - 1)
    frames = [replace(drive[k], image=None) for k in range(last + 1)]
    beliefs = list(recipe.track(frames, recipe.spec, recipe.params, SEED))
    if truth.flaws:
        frames = truth.flaws.apply(frames, truth.seed, number)  # after the filter: it sees the true scans
    moments = [Moment(frame, belief) for frame, belief in zip(frames, beliefs, strict=True)]
    return [drive_truth(moments, k, recipe.spec, truth.policy) for k in labelled]
