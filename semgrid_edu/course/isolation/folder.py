"""The folder of a student's process: how much it holds, and its end, whatever was made of it."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

MOST_FILES = 20_000
"""How many files and folders there may be."""


def _inside(folder: Path, closed: list[str]) -> Iterator[os.DirEntry]:
    """Yield all that is in a folder, each folder before what is in it; the list takes those that can't be looked into.

    Python's own walk fails in folders that are too deep.
    """
    waiting = [str(folder)]
    while waiting:
        place = waiting.pop()
        try:
            with os.scandir(place) as found:
                for entry in found:
                    yield entry
                    if entry.is_dir(follow_symlinks=False):
                        waiting.append(entry.path)
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError:
            closed.append(place)


def takes_too_much(folder: Path, most: int) -> bool:
    """Return whether the files in a folder take too much room, are too many, or hide where nobody can look.

    Parameters
    ----------
    folder : Path
        The folder.
    most : int
        How much room they may take, bytes.
    """
    closed: list[str] = []
    size = count = 0
    for entry in _inside(folder, closed):
        with suppress(FileNotFoundError):
            found = entry.stat(follow_symlinks=False)
            size, count = size + (getattr(found, "st_blocks", 0) * 512 or found.st_size), count + 1
        if size > most or count > MOST_FILES:
            return True
    return bool(closed)


def delete(folder: Path) -> None:
    """Delete a folder, also one that was made so that it can't be read, or is too deep for Python's own way.

    Parameters
    ----------
    folder : Path
        The folder.
    """
    folder.chmod(0o700)
    for entry in _inside(folder, []):
        if entry.is_dir(follow_symlinks=False):
            Path(entry.path).chmod(0o700)
    if shutil.which("rm"):
        subprocess.run(["rm", "-rf", "--", folder], capture_output=True, check=False)
    else:
        shutil.rmtree(folder, ignore_errors=True)
