"""What is doubtful about a data set, before hours of work are based on it (section 4)."""

from pathlib import Path

from semgrid_edu.datasets.index import DatasetIndex, load_index
from semgrid_edu.datasets.readers.kitti_labels import read_label_set
from semgrid_edu.datasets.readers.kitti_raw import KittiRawDrive, drive_folder
from semgrid_edu.errors import DataError


def dataset_doubts(dataset_dir: str | Path, *splits: str) -> list[str]:
    """List what is doubtful about the drives of some splits, without reading their scans and images.

    Parameters
    ----------
    dataset_dir : path-like
        The folder of the data set, such as data/minikitti.
    *splits : str
        Such as "train".

    Returns
    -------
    list of str
        One line for each doubtful thing, from `KittiRawDrive.doubts`.

    Raises
    ------
    ArgumentError
        When there is no such split.
    DataError
        When a drive is missing, or its labels are of another label set than the index says.
    """
    index = load_index(dataset_dir)
    for split in splits:
        check_label_sets(index, split)
    drives = [drive for split in splits for drive in index.frames_by_drive(split)]
    return [line for date, drive in drives for line in KittiRawDrive(index.root, date, drive).doubts()]


def check_label_sets(index: DatasetIndex, split: str) -> None:
    """Check that the drives of a split have labels of the label set that the index names.

    Parameters
    ----------
    index : DatasetIndex
        The data set.
    split : str
        One of its splits.

    Raises
    ------
    DataError
        When a drive has labels of another label set: the same numbers would stand for other classes.
    """
    for date, drive in index.frames_by_drive(split):
        path = drive_folder(index.root, date, drive) / "labels" / "label_set.txt"
        if path.exists() and (found := read_label_set(path)) != index.label_set:
            raise DataError(path, f"{index.label_set.name}, the label set of the data set {index.name}", found.name)
