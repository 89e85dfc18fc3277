"""Whether a drive on disk is whole, and what is left of one that isn't."""

import shutil
from collections.abc import Collection
from pathlib import Path

from semgrid_edu.datasets.kitti_labels import KINDS
from semgrid_edu.errors import DataError

UNFINISHED = ".partial"
"""How the name of a drive's hidden folder ends as long as the drive isn't whole."""


def remove_unfinished(day: Path) -> None:
    """Remove what killed processes have left of drives. No other process may be writing drives there.

    Parameters
    ----------
    day : Path
        The folder of the drives of a day.
    """
    for partial in day.glob(f".*{UNFINISHED}"):
        shutil.rmtree(partial, ignore_errors=True)


def check_complete(folder: Path, n_frames: int, labelled: Collection[int]) -> None:
    """Check that a drive has all its files.

    Parameters
    ----------
    folder : Path
        The drive's folder.
    n_frames : int
        Number of frames.
    labelled : collection of int
        Numbers of the frames that have labels.

    Raises
    ------
    DataError
        When a file is missing.
    """
    per_frame = {"image_02/data": "png", "velodyne_points/data": "bin", "oxts/data": "txt"}
    expected = [f"{place}/{k:010d}.{suffix}" for place, suffix in per_frame.items() for k in range(n_frames)]
    expected += [f"labels/{kind}/{k:010d}.png" for kind in KINDS for k in labelled]
    expected += [f"{sensor}/timestamps.txt" for sensor in ("image_02", "velodyne_points", "oxts")]
    expected += ["labels/label_set.txt", "labels/objects.json"]
    missing = [name for name in expected if not (folder / name).is_file()]
    if missing:
        found = f"{len(missing)} missing, such as {missing[0]}"
        raise DataError(folder, f"all {len(expected)} files of a drive (delete the folder to make it anew)", found)
