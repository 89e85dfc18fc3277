"""Where arrays that are made of a data set are kept."""

import os
from pathlib import Path

CACHE_VARIABLE = "SEMGRID_EDU_CACHE"
"""The environment variable that names a folder for what is made of data sets; `semgrid-edu --cache` sets it, and worker
processes inherit it."""


def cache_folder(dataset_dir: Path) -> Path:
    """Return the folder for what is made of a data set.

    Parameters
    ----------
    dataset_dir : Path
        The folder of the data set.

    Returns
    -------
    Path
        The folder that `CACHE_VARIABLE` names, which all data sets share; `cache` in that of the data set when the
        variable isn't set.
    """
    chosen = os.environ.get(CACHE_VARIABLE)
    return Path(chosen) if chosen else dataset_dir / "cache"
