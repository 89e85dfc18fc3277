"""Drives with Zhang et al.'s labels: KITTI's frames, in raw or tracking layout, and what they show (section 4)."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.zhang_labels import ZhangLabels
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.frame import Frame

RAW_DRIVES = {
    0: ("2011_09_26", "0005", 154),
    4: ("2011_09_26", "0014", 314),
    5: ("2011_09_26", "0015", 297),
    10: ("2011_09_26", "0056", 294),
    11: ("2011_09_26", "0059", 373),
    13: ("2011_09_26", "0091", 340),
    19: ("2011_09_29", "0071", 1059),
}
"""Date, number and frames of the raw drive that a run of the tracking set was taken from.

Assumed, because drive and run have equally many frames, as far as we know: it couldn't be checked against the data, and
for run 9 we know of no such drive. Look at some labels over their images before you rely on an entry."""


class ZhangDrive(FrameSequence):
    """The frames of a drive, with the labels of those that Zhang et al. labelled.

    Parameters
    ----------
    drive : sequence of Frame
        The frames of the run: a `KittiTrackingRun`, or a raw drive that begins where the run does.
    labels : ZhangLabels
        The labels of all runs.
    run : int
        Number of the run in KITTI's tracking training set.

    Examples
    --------
    >>> labels = ZhangLabels("zhang")                                               # doctest: +SKIP
    >>> drive = ZhangDrive(KittiTrackingRun("kitti_tracking", 9), labels, 9)        # doctest: +SKIP
    >>> [k for run, k in labels.frames("train") if run == 9][:3]                    # doctest: +SKIP
    """

    def __init__(self, drive: Sequence[Frame], labels: ZhangLabels, run: int) -> None:
        self.drive, self.labels, self.run = drive, labels, run

    def __len__(self) -> int:
        """Return the number of frames, labelled or not."""
        return len(self.drive)

    def _frame(self, k: int) -> Frame:
        frame = self.drive[k]
        return replace(frame, labels=self.labels.read(self.run, k, frame.camera.size))


def zhang_raw_drive(root: str | Path, labels: ZhangLabels, run: int) -> ZhangDrive:
    """Open a labelled run whose frames are in KITTI's raw layout.

    Parameters
    ----------
    root : path-like
        The folder of KITTI raw drives, which holds the folders of the dates.
    labels : ZhangLabels
        The labels of all runs.
    run : int
        A key of `RAW_DRIVES`.

    Returns
    -------
    ZhangDrive

    Raises
    ------
    ArgumentError
        When it isn't known which raw drive the run was taken from.
    DataError
        When there is no such drive, or it has another number of frames than the run.
    """
    if run not in RAW_DRIVES:
        raise ArgumentError("run", f"one of {', '.join(map(str, RAW_DRIVES))}", run)
    date, number, n_frames = RAW_DRIVES[run]
    drive = KittiRawDrive(root, date, number)
    if len(drive) != n_frames:
        raise DataError(drive.folder, f"the {n_frames} frames of tracking run {run}", f"{len(drive)}")
    return ZhangDrive(drive, labels, run)
