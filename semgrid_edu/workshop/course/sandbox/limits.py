"""The limits that a student's process sets for itself before the first line of the student's code runs."""

import os
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import semgrid_edu
from semgrid_edu.storage.files import shipped_folder, table_beside
from semgrid_edu.workshop.course.sandbox import linux
from semgrid_edu.workshop.course.sandbox.resources import MEGABYTE

PARTS = ("memory", "written files", "processes", "files", "modes and dates of files", "network", "signals")
"""Everything that is limited here; the grader's process limits time."""

MAX_OPEN = 256
"""How many files, pipes and sockets a process may have open: what lies in them is the kernel's memory."""

SYSTEM: tuple[str, ...] = table_beside(__file__)["system"]
"""The parts of a Linux system that programs need."""


@dataclass(frozen=True)
class Limits:
    """How much a student's process may use.

    Parameters
    ----------
    memory : int
        How much memory its code may use, megabytes.
    written : int
        The size of the largest file that it may write, megabytes; all its files together may be three times as large.
    processes : int
        How many processes and threads the user may have in all.
    """

    memory: int = 4000
    written: int = 100
    processes: int = 100


def limit_this_process(limits: Limits, folder: Path) -> list[str]:
    """Limit this process and everything that it will start, for good; return which of `PARTS` are limited.

    Parameters
    ----------
    limits : Limits
        How much it may use.
    folder : Path
        The only folder to which it may write.
    """
    # If memory runs out, Linux kills this process and its children first.
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("1000")
    done = _limit_resources(limits)
    if linux.landlock_version():
        done += linux.give_up_files(*_readable(), [folder, Path("/dev/null")])
    # Landlock restricts TCP only; without sockets there is no network at all.
    return [*done, "network", "modes and dates of files"] if linux.give_up_calls() else done


def _limit_resources(limits: Limits) -> list[str]:
    """Set the limits of POSIX: memory beyond what the process holds now, files, processes."""
    if sys.platform == "win32":
        return []
    import resource

    kinds = {
        "memory": (resource.RLIMIT_AS, _held() + limits.memory * MEGABYTE),
        "written files": (resource.RLIMIT_FSIZE, limits.written * MEGABYTE),
    }
    _set(resource.RLIMIT_CORE, 0)
    _set(resource.RLIMIT_NOFILE, MAX_OPEN)
    # The superuser is exempt from this one.
    if os.getuid():
        kinds["processes"] = resource.RLIMIT_NPROC, limits.processes
    return [part for part, (kind, value) in kinds.items() if _set(kind, value)]


def limit_grader(megabytes: int) -> None:
    """Limit the memory of this process, so that a huge answer raises an error and doesn't end a class's grading.

    Parameters
    ----------
    megabytes : int
        How much it may use beyond what it holds now. Processes that it starts may set another limit.
    """
    if sys.platform != "win32":
        import resource

        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_AS, (_held() + megabytes * MEGABYTE, hard))


def _held() -> int:
    """Return the size of this process's address space, bytes; 0 where there is no `/proc`."""
    import resource

    held = Path("/proc/self/statm")
    return int(held.read_text().split()[0]) * resource.getpagesize() if held.exists() else 0


def _set(kind: int, value: int) -> bool:
    """Set one limit of POSIX; return False if the system doesn't allow it."""
    import resource

    try:
        resource.setrlimit(kind, (value, value))
    except (ValueError, OSError):
        return False
    return True


def _readable() -> tuple[list[Path], list[Path]]:
    """Return folders that a student's code may list, and files and folders that it may read.

    It may read Python, libraries, and this package except for the sources of the exercises.
    """
    package = Path(semgrid_edu.__file__).parent
    hidden = shipped_folder("notebooks")
    look = []
    read = []
    for place in (*SYSTEM, sys.prefix, sys.base_prefix, package, shipped_folder("data_samples")):
        above, without = _all_but(Path(place).resolve(), hidden.resolve())
        look += above
        read += without
    return look, read


def _all_but(folder: Path, hidden: Path) -> tuple[list[Path], list[Path]]:
    """Return the folders on the way to a hidden folder, and everything else in them."""
    if hidden in (folder, *folder.parents):
        return [], []
    if folder not in hidden.parents:
        return [], [folder]
    look = [folder]
    read = []
    for child in folder.iterdir():
        # The target of a link is readable only if it is listed itself.
        if not child.is_symlink():
            inner = _all_but(child, hidden)
            look += inner[0]
            read += inner[1]
    return look, read
