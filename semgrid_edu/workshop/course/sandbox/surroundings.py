"""The surroundings of a student's process: environment, compiled functions, and files that were handed in."""

import os
import shutil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.storage.files import atomic_path
from semgrid_edu.workshop.course.sandbox.values import MAX_BYTES

INHERITED = ("PATH", "PYTHONPATH", "LANG", "LC_ALL", "SYSTEMROOT")
"""The environment variables that a student's process inherits."""

PREPARED = ".prepared"
"""The folder of compiled functions, in the folder of a process; no file that is handed in gets there."""

ONLY_WHOLE = shutil.ignore_patterns(".*")
"""For copies of compiled functions: a file that another process is still writing has such a name."""


def worker_environment(folder: Path) -> dict[str, str]:
    """Return the environment of a worker: one thread per library, and all caches in its folder.

    Parameters
    ----------
    folder : Path
        The fresh folder of the process.
    """
    here = {name: str(folder / PREPARED) for name in ("NUMBA_CACHE_DIR", "MPLCONFIGDIR")}
    here |= {name: str(folder) for name in ("HOME", "TMPDIR", "IPYTHONDIR")}
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    # Freed memory is returned at once; otherwise a measurement wouldn't see that it is allocated again.
    freed = dict.fromkeys(("MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"), "1000000")
    inline = {"MPLBACKEND": "module://matplotlib_inline.backend_inline", "PYTHONDONTWRITEBYTECODE": "1"}
    return {name: os.environ[name] for name in INHERITED if name in os.environ} | here | threads | freed | inline


def keep_compiled(source: Path, target: Path) -> None:
    """Copy compiled functions to where others find them, so that a reader never gets half a file.

    Parameters
    ----------
    source, target : Path
        The two folders.
    """

    def replace_file(source: str, target: str) -> None:
        with atomic_path(target) as path:
            shutil.copyfile(source, path)

    shutil.copytree(source, target, ignore=ONLY_WHOLE, copy_function=replace_file, dirs_exist_ok=True)


def files_beside(folder: Path) -> dict[str, NDArray]:
    """Return the files beside a notebook, their bytes by their paths, until a message is full.

    Parameters
    ----------
    folder : Path
        The notebook's folder.
    """
    found = {}
    room = MAX_BYTES
    for path in sorted(one for one in folder.rglob("*") if one.is_file() and not one.is_symlink()):
        if path.suffix != ".ipynb" and PREPARED not in path.relative_to(folder).parts and path.stat().st_size <= room:
            found[path.relative_to(folder).as_posix()] = np.fromfile(path, np.uint8)
            room -= path.stat().st_size
    return found
