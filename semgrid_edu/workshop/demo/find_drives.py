"""What drive is in a folder: the layouts that have a reader here, and readers of one's own."""

import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from semgrid_edu.datasets.drive_files import BAGS, FROM_BAG, what_is
from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.kitti_raw import VIEWS, KittiRawDrive
from semgrid_edu.datasets.pandaset import CAMERAS, PandasetScene
from semgrid_edu.datasets.semantic_kitti import SemanticKittiSequence
from semgrid_edu.errors import DataError
from semgrid_edu.stages.hints import in_short
from semgrid_edu.storage.files import found_at
from semgrid_edu.workshop.demo.stages_file import imported
from semgrid_edu.workshop.paper.datasets.kitti_tracking import KittiTrackingRun

DEPTH = 3
"""How many folders below the one that is given are searched: a drive lies below its date, below the data set."""

SHOWN = 8
"""Largest number of drives that an error lists."""


class FoundDrive(NamedTuple):
    """A drive in a layout that is known.

    Parameters
    ----------
    kind : str
        The layout, such as "KITTI raw".
    folder : Path
        The folder that identifies the drive: giving it alone finds this drive.
    open : callable
        Takes the data set's name for a camera, or None for its first one, and returns the drive.
    """

    kind: str
    folder: Path
    open: Callable[[str | None], FrameSequence]


def drive_at(path: str | Path, camera: str | None = None) -> tuple[str, FrameSequence]:
    """Open the one drive that is in a folder, or below it.

    Parameters
    ----------
    path : path-like
        The folder: a drive, or one above it that holds no other.
    camera : str, optional
        The data set's name for the camera.

    Returns
    -------
    str
        The kind of drive that was found, such as "KITTI raw".
    FrameSequence
        The drive.

    Raises
    ------
    DataError
        When there is no drive, or more than one, or it has one camera and another is asked for.

    Examples
    --------
    >>> from semgrid_edu.datasets.samples import sample_drive
    >>> drive_at(sample_drive().folder)[0]
    'KITTI raw'
    """
    path = _existing(path, "the folder of a drive")
    found = find_drives(path)
    if not found:
        kinds = "a drive of KITTI raw, KITTI tracking, SemanticKITTI or PandaSet"
        advice = what_is(path)
        raise DataError(path, f"{kinds}, or --reader FILE", f"what looks like {advice}" if advice else "none of them")
    if len(found) > 1:
        listed = [str(one.folder.relative_to(path.resolve())) for one in found[:SHOWN]]
        more = [f"and {len(found) - SHOWN} more"] if len(found) > SHOWN else []
        raise DataError(path, "one drive; give the folder of the one to show", ", ".join(listed + more))
    return found[0].kind, found[0].open(camera)


def _existing(path: str | Path, what: str) -> Path:
    """Return the path of a folder, or raise an error if there is none."""
    path = Path(path)
    if path.is_file() and path.suffix in BAGS:
        raise DataError(path, what, FROM_BAG)
    if not path.is_dir():
        raise DataError(path, what, "a file" if path.exists() else "no folder")
    return path


def find_drives(path: Path) -> list[FoundDrive]:
    """Find the drives in a folder and at most `DEPTH` folders below it.

    Parameters
    ----------
    path : Path
        An existing folder; or one within a drive of KITTI raw, such as its velodyne_points.

    Returns
    -------
    list of FoundDrive
        In the order of their folders.
    """
    path = path.resolve()
    above = [folder for folder in path.parents[:2] if folder.name.endswith("_sync")]
    folders = above or [path, *_below(path, DEPTH)]
    return [drive for folder in folders for drive in _drives_of(folder)]


def _below(folder: Path, depth: int) -> Iterator[Path]:
    """Yield the folders below one, down to a depth."""
    for parent, names, _ in os.walk(folder):
        names.sort()
        yield from (Path(parent, name) for name in names)
        if len(Path(parent).relative_to(folder).parts) == depth - 1:
            names.clear()  # os.walk goes no deeper


def _drives_of(folder: Path) -> Iterator[FoundDrive]:
    """Yield the drive that a folder is, in any layout that is known."""
    root = folder.parent.parent
    named = re.fullmatch(r"(\d{4}_\d\d_\d\d)_drive_(\d+)_sync", folder.name)
    if named and folder.parent.name == named[1]:  # 2011_09_26/2011_09_26_drive_0013_sync
        yield FoundDrive(
            "KITTI raw", folder, lambda camera: KittiRawDrive(root, *named.groups(), view=camera or VIEWS[0])
        )
    if (folder / "lidar" / "poses.json").is_file():
        yield FoundDrive(
            "PandaSet", folder, lambda camera: PandasetScene(folder.parent, folder.name, camera or CAMERAS[0])
        )
    if folder.parent.name == "sequences" and (folder / "velodyne").is_dir():  # sequences/00
        yield FoundDrive("SemanticKITTI", folder, _one_camera(lambda: SemanticKittiSequence(root, folder.name), folder))
    if folder.parent.name == "velodyne" and root.name == "training" and folder.name.isdecimal():
        run = int(folder.name)  # training/velodyne/0013
        yield FoundDrive("KITTI tracking", folder, _one_camera(lambda: KittiTrackingRun(root.parent, run), folder))


def _one_camera(read: Callable[[], FrameSequence], folder: Path) -> Callable[[str | None], FrameSequence]:
    """Return a function that opens a drive of a data set with a single camera."""

    def opened(camera: str | None) -> FrameSequence:
        if camera is not None:
            raise DataError(folder, "no --camera: its reader knows one", camera)
        return read()

    return opened


def read_with(reader: str | Path, folder: str | Path) -> FrameSequence:
    """Read a recording with a class from a Python file.

    Parameters
    ----------
    reader : path-like
        The file, which is executed. It defines one class derived from `FrameSequence`, which is called with the folder.
    folder : path-like
        The folder of the recording.

    Returns
    -------
    FrameSequence
        The recording.

    Raises
    ------
    DataError
        When there is no such folder, Python can't import the file, it doesn't define exactly one such class, the class
        fails, or the recording has no frames.
    """
    reader = Path(reader)
    folder = _existing(folder, "the folder of a recording")
    if reader.suffix != ".py" or not reader.is_file():
        raise DataError(
            reader,
            "a Python file with a class derived from FrameSequence",
            "another file" if reader.is_file() else found_at(reader),
        )
    module = imported(reader)
    classes = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, FrameSequence) and value.__module__ == module.__name__
    ]
    if len(classes) != 1:
        names = ", ".join(one.__name__ for one in classes) or "none"
        raise DataError(reader, "one class derived from FrameSequence", names)
    (reader_class,) = classes
    try:
        drive = reader_class(folder)
        n_frames = len(drive)
    except Exception as error:
        expected = f"what {reader_class.__name__} of {reader.name} can read"
        raise DataError(folder, expected, in_short(error, module.__file__)) from error
    if n_frames == 0:
        raise DataError(folder, f"frames for {reader_class.__name__} of {reader.name}", "none")
    return drive
