"""Folders for what can be made anew: arrays that are made of a data set, and functions that numba compiles."""

import os
import sys
import tempfile
from pathlib import Path

CACHE_VARIABLE = "SEMGRID_EDU_CACHE"
"""The environment variable that names a folder for what is made of data sets; `semgrid-edu --cache` sets it, and worker
processes inherit it."""

PACKAGE = Path(__file__).parents[1]
"""The folder of the package, in which numba keeps what it compiles if it can."""

NUMBA_VARIABLE = "NUMBA_CACHE_DIR"
"""The environment variable that names numba's cache folder."""


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


def keep_compiled_functions() -> str:
    """Give numba a folder in the system's temporary one, if it could keep compiled functions nowhere else.

    Without such a folder numba refuses to import the package. The environment variable has to be set before numba is
    imported; worker processes inherit it.

    Returns
    -------
    str
        One line for the user; empty when numba finds a place by itself.
    """
    chosen = [Path(os.environ[NUMBA_VARIABLE])] if os.environ.get(NUMBA_VARIABLE) else []
    if any(map(takes_files, [*chosen, *_usual_folders()])):
        return ""
    os.environ[NUMBA_VARIABLE] = folder = str(_own_folder())
    return f"neither the package nor your cache folder can be written to; compiled functions are kept in {folder}"


def _usual_folders() -> list[Path]:
    """Return where numba looks: beside the module, and in the user's cache folder."""
    return [PACKAGE / "occupancy" / "__pycache__", user_cache()]


def user_cache() -> Path:
    """Return the user's cache folder, as numba does; it need not exist."""
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 (Path.home raises an error for a user without a home)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local"))
    if sys.platform == "darwin":
        return home / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME", home / ".cache"))


def takes_files(folder: Path) -> bool:
    """Return whether files can be written to a folder, which is created when missing.

    Parameters
    ----------
    folder : Path
        The folder.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _own_folder() -> Path:
    """Return a folder of this user alone: compiled functions are code, which nobody else may put there."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"semgrid_edu-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if found.st_uid != user or (os.name == "posix" and found.st_mode & 0o077) or folder.is_symlink():
        folder = Path(tempfile.mkdtemp(prefix="semgrid_edu-"))
    return folder
