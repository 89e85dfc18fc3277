"""Doubts about a data set, which every command that uses one reports before hours of work begin."""

from pathlib import Path

import semgrid_edu.workshop.paper.datasets  # noqa: F401 (adds the paper's readers to those that dataset.json can name)
from semgrid_edu.datasets.index import INDEX_FILE, load_index
from semgrid_edu.errors import DataError
from semgrid_edu.workshop.doubts import drive_doubts


def dataset_doubts(dataset_dir: str | Path, *splits: str) -> list[str]:
    """List the doubts about the drives of some splits.

    Parameters
    ----------
    dataset_dir : path-like
        The folder of the data set, such as data/minikitti.
    *splits : str
        Such as "train".

    Returns
    -------
    list of str
        One line for each doubt, from `drive_doubts`.
    """
    index = load_index(dataset_dir)
    for split in splits:
        if split not in index.splits:
            raise DataError(Path(dataset_dir) / INDEX_FILE, f"the split {split}", ", ".join(index.splits) or "none")
    drives = [drive for split in splits for drive, _ in index.drives(split)]
    return [doubt for drive in drives for doubt in drive_doubts(drive)]
