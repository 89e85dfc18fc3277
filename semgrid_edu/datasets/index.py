"""The index of a data set: its labelled frames, split into those for training and those for testing (section 4)."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.labels import LABEL_SETS, LabelSet
from semgrid_edu.storage.reading import read_json

INDEX_FILE = "dataset.json"

MOST_FRAMES = 10**10
"""KITTI's files are named by the frame's number in ten digits."""


class LabelledFrame(NamedTuple):
    """Where a labelled frame is.

    Parameters
    ----------
    date, drive : str
        The drive `KittiRawDrive(root, date, drive)`.
    frame : int
        Number of the frame in that drive.
    """

    date: str
    drive: str
    frame: int


@dataclass(frozen=True)
class DatasetIndex:
    """What a data set holds.

    Parameters
    ----------
    root : Path
        Its folder, which holds the folders of the dates.
    name : str
        What it is called, such as "minikitti".
    label_set : LabelSet
        The classes of its labels.
    splits : dict of str to tuple of LabelledFrame
        Labelled frames by split, such as "train" and "test"; no drive is in two of them.
    """

    root: Path
    name: str
    label_set: LabelSet
    splits: dict[str, tuple[LabelledFrame, ...]]

    def frames_by_drive(self, split: str) -> dict[tuple[str, str], list[int]]:
        """Return the labelled frames of a split, drive by drive.

        Parameters
        ----------
        split : str
            A key of `splits`, such as "train".

        Returns
        -------
        dict of (str, str) to list of int
            The numbers of the labelled frames by (date, drive), in the order of the index.

        Raises
        ------
        ArgumentError
            When there is no such split.
        """
        if split not in self.splits:
            raise ArgumentError("split", f"one of {', '.join(self.splits)}", repr(split))
        frames: dict[tuple[str, str], list[int]] = {}
        for date, drive, frame in self.splits[split]:
            frames.setdefault((date, drive), []).append(frame)
        return frames


def load_index(dataset_dir: str | Path) -> DatasetIndex:
    """Read the index of a data set, dataset.json.

    Parameters
    ----------
    dataset_dir : path-like
        The folder of the data set, such as data/minikitti.

    Returns
    -------
    DatasetIndex

    Raises
    ------
    DataError
        When the file is missing or isn't such an index.
    """
    root = Path(dataset_dir)
    path = root / INDEX_FILE
    content = read_json(path)
    name, label_set, splits = (_entry(path, content, key) for key in ("name", "label_set", "splits"))
    if not isinstance(name, str):
        raise DataError(path, "name: a word or two", repr(name)[:200])
    if not isinstance(label_set, str) or label_set not in LABEL_SETS:
        raise DataError(path, f"label_set: one of {', '.join(LABEL_SETS)}", repr(label_set))
    if not isinstance(splits, dict) or not all(isinstance(frames, list) and frames for frames in splits.values()):
        raise DataError(path, "splits: lists of labelled frames by name, none empty", repr(splits)[:200])
    frames = {split: tuple(_frame(path, entry) for entry in entries) for split, entries in splits.items()}
    _refuse_leaks(path, frames)
    return DatasetIndex(root, name, LABEL_SETS[label_set], frames)


def _entry(path: Path, content: Any, key: str) -> Any:
    """Return the value of a key."""
    if not isinstance(content, dict) or key not in content:
        raise DataError(path, f"an object with the key {key!r}", repr(content)[:200])
    return content[key]


def _frame(path: Path, entry: Any) -> LabelledFrame:
    """Check one entry of a split."""
    date, drive, frame = (_entry(path, entry, key) for key in LabelledFrame._fields)
    sound_names = all(isinstance(name, str) and re.fullmatch(r"\w+", name) for name in (date, drive))
    if not sound_names or type(frame) is not int or not 0 <= frame < MOST_FRAMES:
        raise DataError(path, 'a frame like {"date": "2026_01_01", "drive": "0001", "frame": 9}', entry)
    return LabelledFrame(date, drive, frame)


def _refuse_leaks(path: Path, splits: dict[str, tuple[LabelledFrame, ...]]) -> None:
    """Refuse a frame that comes twice and a drive in two splits: a network would be tested on what it learned."""
    split_of: dict[tuple[str, str], str] = {}
    for split, frames in splits.items():
        if len(set(frames)) != len(frames):
            raise DataError(path, f"each frame of {split} once", "a frame that comes twice")
        for frame in frames:
            if split_of.setdefault(frame[:2], split) != split:
                raise DataError(path, "each drive in one split", f"{frame.date} {frame.drive} in two")
