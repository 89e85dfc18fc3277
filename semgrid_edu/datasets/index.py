"""The index of a data set: its labelled frames, split into training and test frames (section 4)."""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.pandaset import CAMERAS, PandasetScene
from semgrid_edu.datasets.pandaset_files import semseg_folder
from semgrid_edu.datasets.semantic_kitti import SemanticKittiSequence
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.labels import KITTI_14, LABEL_SETS, LabelSet
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.reading import read_json

INDEX_FILE = "dataset.json"

MOST_FRAMES = 10**10
"""KITTI's files are named by the frame's number in ten digits."""


class Reader(NamedTuple):
    """How the drives of a data set on disk are opened.

    Parameters
    ----------
    open : callable
        (root, *name) -> `FrameSequence`.
    keys : tuple of str
        The keys in dataset.json that name the drive of a frame.
    """

    open: Callable[..., FrameSequence]
    keys: tuple[str, ...] = ("drive",)


READERS = {
    "kitti-raw": Reader(KittiRawDrive, ("date", "drive")),
    "pandaset": Reader(PandasetScene, ("scene", "camera")),
    "semantic-kitti": Reader(SemanticKittiSequence),
}
"""The readers that dataset.json can name as its "reader". `READERS["mine"] = Reader(...)` adds one."""


class LabelledFrame(NamedTuple):
    """Where a labelled frame is.

    Parameters
    ----------
    drive : tuple of str
        What the reader takes after the root: date and number for `KittiRawDrive(root, date, drive)`.
    frame : int
        Number of the frame in that drive.
    """

    drive: tuple[str, ...]
    frame: int


@dataclass(frozen=True)
class DatasetIndex:
    """The contents of a data set. `load_index` reads it from disk; other drives can be listed in Python.

    Parameters
    ----------
    root : Path
        The folder that holds its drives.
    name : str
        Name of the data set, such as "minikitti".
    label_set : LabelSet
        The classes of its labels.
    splits : dict of str to tuple of LabelledFrame
        Labelled frames by split, such as "train" and "test"; no drive is in two splits.
    reader : callable
        ``(root, *drive)`` -> `FrameSequence`: opens a drive. Worker processes must be able to import it.
    folder : Path, optional
        Cached arrays go to `cache/` in this folder; `root` when left out.
    """

    root: Path
    name: str
    label_set: LabelSet
    splits: dict[str, tuple[LabelledFrame, ...]]
    reader: Callable[..., FrameSequence] = KittiRawDrive
    folder: Path | None = None

    def frames_by_drive(self, split: str) -> dict[tuple[str, ...], list[int]]:
        """Return the labelled frames of a split, drive by drive.

        Parameters
        ----------
        split : str
            A key of `splits`, such as "train".

        Returns
        -------
        dict of tuple of str to list of int
            The numbers of the labelled frames by drive, (date, number) for KITTI raw, in the order of the index.
        """
        if split not in self.splits:
            raise ArgumentError("split", f"one of {', '.join(self.splits)}", repr(split))
        frames: dict[tuple[str, ...], list[int]] = {}
        for drive, frame in self.splits[split]:
            frames.setdefault(drive, []).append(frame)
        return frames

    def drives(self, split: str) -> list[tuple[FrameSequence, list[int]]]:
        """Open the drives of a split. Parameters are those of `DatasetIndex.frames_by_drive`.

        Returns
        -------
        list of (FrameSequence, list of int)
            Each drive, and the numbers of its labelled frames.

        Raises
        ------
        ArgumentError
            When there is no such split.
        DataError
            If a drive is missing, is shorter than in the index, or has another label set, in which the same numbers
            would mean other classes.
        """
        by_drive = self.frames_by_drive(split).items()
        return [(self._opened(drive, max(numbers)), numbers) for drive, numbers in by_drive]

    def _opened(self, name: tuple[str, ...], last: int) -> FrameSequence:
        """Open a drive and check its length and label set against the index."""
        drive = self.reader(self.root, *name)
        if last >= len(drive):
            expected = f"in {drive.name} the frame {last} that {INDEX_FILE} lists"
            raise DataError(self.root, expected, f"{len(drive)} frames")
        if drive.label_set != self.label_set:
            expected = f"the label set of {drive.name}, {drive.label_set.name}"
            raise DataError(self.root / INDEX_FILE, expected, self.label_set.name)
        return drive


def load_index(dataset_dir: str | Path) -> DatasetIndex:
    """Read the index of a data set, dataset.json.

    The drives are in the same folder, or in the folder that it names as "root".

    Parameters
    ----------
    dataset_dir : path-like
        The folder of the data set, such as data/minikitti.
    """
    if not isinstance(dataset_dir, str | Path):
        raise ArgumentError("dataset_dir", "the folder of a data set", repr(dataset_dir)[:100])
    root = Path(dataset_dir)
    path = root / INDEX_FILE
    content = read_json(path)
    name, label_set, splits = (_entry(path, content, key) for key in ("name", "label_set", "splits"))
    if not isinstance(name, str):
        raise DataError(path, "name: a word or two", repr(name)[:200])
    reader = content.get("reader", "kitti-raw")
    for key, value, known in (("label_set", label_set, LABEL_SETS), ("reader", reader, READERS)):
        if not isinstance(value, str) or value not in known:
            raise DataError(path, f"{key}: one of {', '.join(known)}", repr(value))
    if not isinstance(splits, dict) or not all(isinstance(frames, list) and frames for frames in splits.values()):
        raise DataError(path, "splits: lists of labelled frames by name, none empty", repr(splits)[:200])
    drives = content.get("root", ".")
    if not isinstance(drives, str) or not (root / drives).is_dir():
        raise DataError(path, "root: a folder that holds the drives", repr(drives)[:200])
    keys = READERS[reader].keys
    frames = {split: tuple(_frame(path, entry, keys) for entry in entries) for split, entries in splits.items()}
    _check_leaks(path, frames)
    return DatasetIndex(root / drives, name, LABEL_SETS[label_set], frames, READERS[reader].open, root)


def write_pandaset_index(folder: str | Path, root: str | Path, scene: str, test_cameras: Sequence[str] = ()) -> Path:
    """Write a dataset.json of the labelled frames of a scene, outside the scene's folder.

    Parameters
    ----------
    folder : path-like
        The folder of the data set; created if missing.
    root : path-like
        The folder that holds the scenes.
    scene : str
        Number of the scene, such as "002".
    test_cameras : sequence of str
        The cameras whose frames are for testing; the others are for training.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ArgumentError
        When the scene isn't a plain name, there is no such camera, or none is left to train on.
    DataError
        When there is no such scene, its poses can't be read, its returns have no labels, the folder is inside the
        scene, or there is a dataset.json already.
    """
    if Path(scene).name != scene:
        raise ArgumentError("scene", "the name of a folder such as 002", repr(scene))
    path = Path(folder) / INDEX_FILE
    splits = {"train": [], "test": []}
    if path.exists():
        raise DataError(path, "no data set yet", "one that would be lost")
    if (Path(root) / scene).resolve() in (Path(folder).resolve(), *Path(folder).resolve().parents):
        raise DataError(folder, f"a folder outside the scene {scene}", "one inside it")
    there = [camera for camera in CAMERAS if (Path(root) / scene / "camera" / camera).is_dir()] or CAMERAS
    for camera in dict.fromkeys([*there, *test_cameras]):
        drive = PandasetScene(root, scene, camera)
        drive.path()  # poses that can't be read are found now, not when a training begins
        entries = [{"scene": scene, "camera": camera, "frame": k} for k in range(len(drive))]
        splits["test" if camera in test_cameras else "train"] += entries
    if not semseg_folder(Path(root) / scene).is_dir():
        raise DataError(semseg_folder(Path(root) / scene), "the classes of the returns", "no folder")
    if not splits["train"]:
        raise ArgumentError("test_cameras", "at least one camera less", ", ".join(test_cameras))
    place = relative_path(Path(root).resolve(), Path(folder).resolve())
    index = {"name": f"pandaset-{scene}", "reader": "pandaset", "root": place}
    index |= {"label_set": KITTI_14.name, "splits": {split: frames for split, frames in splits.items() if frames}}
    write_json(path, index)
    return path


def relative_path(path: str | Path, folder: str | Path) -> str:
    """Return the way from a folder to a path; on Windows, from one drive to another, the whole path.

    Parameters
    ----------
    path, folder : path-like
        Where to, and where from.

    Examples
    --------
    >>> relative_path("data/kitti", "data/index").replace(os.sep, "/")
    '../kitti'
    """
    try:
        return os.path.relpath(path, folder)
    except ValueError:  # only ntpath raises it
        return os.fspath(path)


def _entry(path: Path, content: Any, key: str) -> Any:
    """Return the value of a key."""
    if not isinstance(content, dict) or key not in content:
        raise DataError(path, f"an object with the key {key!r}", repr(content)[:200])
    return content[key]


def _frame(path: Path, entry: Any, keys: tuple[str, ...]) -> LabelledFrame:
    """Check one entry of a split."""
    *drive, frame = (_entry(path, entry, key) for key in (*keys, "frame"))
    sound_names = all(isinstance(name, str) and re.fullmatch(r"[\w-]+", name) for name in drive)
    if not sound_names or type(frame) is not int or not 0 <= frame < MOST_FRAMES:
        raise DataError(path, 'a frame like {"date": "2026_01_01", "drive": "0001", "frame": 9}', entry)
    return LabelledFrame(tuple(drive), frame)


def _check_leaks(path: Path, splits: dict[str, tuple[LabelledFrame, ...]]) -> None:
    """Check that no frame is listed twice and no drive is in two splits, so that test frames are never trained on."""
    split_of: dict[tuple[str, ...], str] = {}
    for split, frames in splits.items():
        if len(set(frames)) != len(frames):
            raise DataError(path, f"each frame of {split} once", "a frame that comes twice")
        for frame in frames:
            if split_of.setdefault(frame.drive, split) != split:
                raise DataError(path, "each drive in one split", f"{' '.join(frame.drive)} in two")
