"""Where numba caches compiled functions, also when the installation is read-only."""

import os
import sys
import tempfile
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
"""The package's folder: numba caches compiled functions there if it can write to it."""

NUMBA_VARIABLE = "NUMBA_CACHE_DIR"
"""The environment variable that names numba's cache folder."""


def keep_compiled_functions() -> str:
    """Give numba a temporary folder if it can write to none of its usual ones.

    Without a writable folder, numba raises an error when a compiled function is defined. The environment variable must
    be set before numba is imported; worker processes inherit it.

    Returns
    -------
    str
        One line for the user; empty when numba finds a folder by itself.
    """
    chosen = [Path(os.environ[NUMBA_VARIABLE])] if os.environ.get(NUMBA_VARIABLE) else []
    if any(map(takes_files, [*chosen, *_usual_folders()])):
        return ""
    folder = str(_private_folder())
    os.environ[NUMBA_VARIABLE] = folder
    return f"neither the package nor your cache folder can be written to; compiled functions are kept in {folder}"


def _usual_folders() -> list[Path]:
    """Return where numba looks: beside the module, and in the user's cache folder."""
    return [PACKAGE / "fast" / "__pycache__", user_cache()]


def user_cache() -> Path:
    """Return the user's cache folder, found as numba finds it; it need not exist."""
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 (Path.home raises an error for a user without a home)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local"))
    if sys.platform == "darwin":
        return home / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME", home / ".cache"))


def takes_files(folder: Path) -> bool:
    """Return whether files can be written to a folder; create it if missing.

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


def _private_folder() -> Path:
    """Return a folder that only this user can write to: compiled functions are code."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"semgrid_edu-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if found.st_uid != user or (os.name == "posix" and found.st_mode & 0o077) or folder.is_symlink():
        folder = Path(tempfile.mkdtemp(prefix="semgrid_edu-"))
    return folder
