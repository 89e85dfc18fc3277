"""The limits that a student's process sets for itself before the first line of the student's code runs."""

import os
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import semgrid_edu
from semgrid_edu.storage.files import shipped_folder, table_beside
from semgrid_edu.workshop.course.sandbox import linux

PARTS = ("memory", "written files", "processes", "files", "modes and dates of files", "network", "signals")
"""All that is limited here; the grader's own process limits time."""

MEGABYTE = 1_000_000

SYSTEM: tuple[str, ...] = table_beside(__file__)["system"]
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
    """Limit this process, and all that it will start, for good; return which of `PARTS` have been limited.

    Parameters
    ----------
    limits : Limits
        How much it may take.
    folder : Path
        The only folder to which it may write.
    """
    # Linux ends this process and its children before any other when all memory is taken.
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("1000")
    done = _limit_resources(limits)
    if linux.landlock_version():
        done += linux.give_up_files(*_readable(), [folder, Path("/dev/null")])
    # Landlock knows of networks only TCP; without sockets there is none.
    return [*done, "network", "modes and dates of files"] if linux.give_up_calls() else done


def _limit_resources(limits: Limits) -> list[str]:
    """Set what POSIX offers: memory beyond what the process holds now, files, processes."""
    if sys.platform == "win32":
        return []
    import resource

    wanted = {
        "memory": (resource.RLIMIT_AS, _held() + limits.memory * MEGABYTE),
        "written files": (resource.RLIMIT_FSIZE, limits.written * MEGABYTE),
    }
    _set(resource.RLIMIT_CORE, 0)
    # The superuser is exempt from this one.
    if os.getuid():
        wanted["processes"] = resource.RLIMIT_NPROC, limits.processes
    return [part for part, (kind, value) in wanted.items() if _set(kind, value)]


def limit_grader(megabytes: int) -> None:
    """Limit the memory of this process: what a student's answer makes of it is then an error, not the end of a class.

    Parameters
    ----------
    megabytes : int
        How much it may take beyond what it holds now. Processes that it starts may set another limit.
    """
    if sys.platform != "win32":
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[1]
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_AS, (_held() + megabytes * MEGABYTE, most))


def _held() -> int:
    """Return the bytes of addresses that this process holds; 0 where there is no `/proc` to ask."""
    import resource

    held = Path("/proc/self/statm")
    return int(held.read_text().split()[0]) * resource.getpagesize() if held.exists() else 0


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
    look, read = [], [Path(path) for path in SYSTEM]
    for place in (Path(sys.prefix), Path(sys.base_prefix), package, shipped_folder("data_samples")):
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
    for child in folder.iterdir():
        # What a link points to is named by itself, or not to be read.
        if not child.is_symlink():
            inner = _all_but(child, hidden)
            look += inner[0]
            read += inner[1]
    return look, read
