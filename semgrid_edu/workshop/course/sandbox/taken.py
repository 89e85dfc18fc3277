"""What a student's process and its folder take of the machine, seen from outside."""

import os
import shutil
import stat
import subprocess
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

MOST_FILES = 20_000
"""How many files and folders a process may have."""


def namespace_of(pid: int) -> str:
    """Return the name of the namespace of a process's children, "" if that is this process's own, too.

    Parameters
    ----------
    pid : int
        The process.
    """
    name = _link(Path(f"/proc/{pid}/ns/pid_for_children"))
    return name if name != _link(Path("/proc/self/ns/pid")) else ""


def _link(path: Path) -> str:
    """Return what a link says, "" where it can't be read."""
    with suppress(OSError):
        return str(path.readlink())
    return ""


def memory_of(pid: int) -> dict[str, int]:
    """Return what Linux tells of a process's memory, by the names of proc(5), kilobytes of 1000 bytes.

    Parameters
    ----------
    pid : int
        The process.
    """
    lines = (line.split() for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return {line[0].rstrip(":"): int(line[1]) * 1024 // 1000 for line in lines if line[-1] == "kB"}


def count_tasks(counts: Callable[[Path], bool]) -> int:
    """Return how many threads some processes have; 0 where there is no `/proc`.

    Parameters
    ----------
    counts : callable
        (`/proc/PID/task`) -> bool, whether the process counts.
    """
    found = 0
    for tasks in Path("/proc").glob("[0-9]*/task"):
        with suppress(OSError):
            found += sum(1 for _ in tasks.iterdir()) if counts(tasks) else 0
    return found


def takes_too_much(folder: Path, most: int) -> bool:
    """Return whether the files in a folder take more bytes, are too many, or lie where nobody can look.

    Parameters
    ----------
    folder : Path
        The folder.
    most : int
        Bytes of all files together.
    """
    size, count, waiting = 0, 0, [str(folder)]
    while waiting:
        try:
            with os.scandir(waiting.pop()) as entries:
                for entry in entries:
                    with suppress(FileNotFoundError):  # one that has just gone must not hide the others beside it
                        found = entry.stat(follow_symlinks=False)
                        size, count = size + (getattr(found, "st_blocks", 0) * 512 or found.st_size), count + 1
                        if stat.S_ISDIR(found.st_mode):
                            waiting.append(entry.path)
                    if size > most or count > MOST_FILES:
                        return True
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError:  # a closed folder, or a path that is too long for the system
            return True
    return False


def delete_folder(folder: Path) -> None:
    """Delete a folder, even if it was made unreadable, or too deep for Python's own way.

    Parameters
    ----------
    folder : Path
        The folder.
    """
    if shutil.which("rm"):
        for command in (["chmod", "-R", "u+rwX"], ["rm", "-rf"]):
            subprocess.run([*command, "--", folder], capture_output=True, check=False)
    else:
        shutil.rmtree(folder, ignore_errors=True)
