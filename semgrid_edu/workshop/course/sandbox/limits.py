"""The limits of a student's process: what it sets for itself before the first line of the student's code runs.

The folder of a student's process: how much it holds, and its end, whatever was made of it.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import semgrid_edu
from semgrid_edu.storage.provenance import shipped_folder
from semgrid_edu.workshop.course.sandbox import linux as landlock
from semgrid_edu.workshop.course.sandbox import linux as seccomp

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


PARTS = ("memory", "written files", "processes", "files", "network", "signals")
"""All that is limited here; the grader's own process limits time."""

MEGABYTE = 1_000_000

SYSTEM = (
    *("/usr", "/lib", "/lib32", "/lib64", "/bin", "/sbin", "/sys", "/proc", "/dev/urandom", "/dev/random", "/dev/zero"),
    *("/etc/fonts", "/etc/group", "/etc/ld.so.cache", "/etc/localtime", "/etc/nsswitch.conf", "/etc/passwd"),
)
"""What programs need of a Linux system."""


@dataclass(frozen=True)
class Limits:
    """How much a student's process may take.

    Parameters
    ----------
    memory : int
        How much memory its code may take, megabytes.
    written : int
        The size of the largest file that it may write, megabytes; all its files may take three times as much.
    processes : int
        How many processes and threads the user may have in all.
    """

    memory: int = 4000
    written: int = 100
    processes: int = 100


def limit_this_process(limits: Limits, folder: Path) -> list[str]:
    """Limit this process, and all that it will start, for good.

    Parameters
    ----------
    limits : Limits
        How much it may take.
    folder : Path
        The only folder to which it may write.

    Returns
    -------
    list of str
        Those of `PARTS` that have been limited.
    """
    _be_first_to_end()
    done = _limit_resources(limits)
    if landlock.version():
        done += landlock.restrict(*_readable(), [folder, Path("/dev/null")])
    # Landlock knows of networks only TCP; without sockets there is none.
    return [*done, "network"] if seccomp.refuse_calls() else done


def threads_of_this_user() -> int:
    """Return how many threads the user of this process has; 0 where Linux's `/proc` isn't there to tell."""
    user, count = os.getuid() if hasattr(os, "getuid") else None, 0
    for tasks in Path("/proc").glob("[0-9]*/task"):
        try:
            count += sum(1 for _ in tasks.iterdir()) if tasks.stat().st_uid == user else 0
        except OSError:
            continue
    return count


def _limit_resources(limits: Limits) -> list[str]:
    """Set what POSIX offers: memory beyond what the process holds now, files, processes."""
    if sys.platform == "win32":
        return []
    import resource

    held = Path("/proc/self/statm")
    pages = int(held.read_text().split()[0]) if held.exists() else 0
    wanted = {
        "memory": (resource.RLIMIT_AS, pages * resource.getpagesize() + limits.memory * MEGABYTE),
        "written files": (resource.RLIMIT_FSIZE, limits.written * MEGABYTE),
    }
    _set(resource.RLIMIT_CORE, 0)
    # The superuser is exempt from this one.
    if os.getuid():
        wanted["processes"] = resource.RLIMIT_NPROC, limits.processes
    return [part for part, (kind, value) in wanted.items() if _set(kind, value)]


def _be_first_to_end() -> None:
    """Let Linux end this process and its children before any other when all memory is taken."""
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("1000")


def _set(kind: int, value: int) -> bool:
    """Set one limit of POSIX; False when the system refuses."""
    import resource

    try:
        resource.setrlimit(kind, (value, value))
    except (ValueError, OSError):
        return False
    return True


def _readable() -> tuple[list[Path], list[Path]]:
    """Return folders that a student's code may look into, and files and folders that it may read.

    It may read Python, its libraries, the system's, and this package without the sources of the exercises.
    """
    package, hidden = Path(semgrid_edu.__file__).parent, shipped_folder("notebooks")
    places = [Path(sys.prefix), Path(sys.base_prefix), package, shipped_folder("data_samples")]
    look, read = [], [Path(path) for path in SYSTEM]
    for place in places:
        above, without = _all_but(place.resolve(), hidden.resolve())
        look += above
        read += without
    return look, read


def _all_but(folder: Path, hidden: Path) -> tuple[list[Path], list[Path]]:
    """Return the folders between a folder and one that is hidden in it, and all else in them."""
    if hidden in (folder, *folder.parents):
        return [], []
    if folder not in hidden.parents:
        return [], [folder]
    look, read = [folder], []
    for child in _children(folder):
        inner = _all_but(child, hidden)
        look += inner[0]
        read += inner[1]
    return look, read


def _children(folder: Path) -> Iterator[Path]:
    """Return what is in a folder, links left out: what they point to is named by itself, or not to be read."""
    return (child for child in folder.iterdir() if not child.is_symlink())
