"""The resources that a student's process and its folder use, measured from outside."""

import os
import shutil
import stat
import subprocess
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from math import inf
from pathlib import Path

MAX_FILES = 20_000
"""How many files and folders a process may have."""

SAMPLE_INTERVAL, MAX_SAMPLING = 0.01, 600.0
"""Seconds between two measurements of the memory of child processes, and for how long they are repeated."""

CLOCK_TICK = 0.02
"""By how many seconds the system may date a file too early."""

MEGABYTE = 1_000_000


def namespace_of(pid: int) -> str:
    """Return the name of the namespace of a process's children; "" if this process is in the same one.

    Parameters
    ----------
    pid : int
        The process.
    """
    name = _link(Path(f"/proc/{pid}/ns/pid_for_children"))
    return name if name != _link(Path("/proc/self/ns/pid")) else ""


def _link(path: Path) -> str:
    """Return the target of a link, "" if it can't be read."""
    with suppress(OSError):
        return str(path.readlink())
    return ""


def memory_of(pid: int) -> dict[str, int]:
    """Return what Linux reports about a process's memory, by the names of proc(5), in kilobytes of 1000 bytes.

    Parameters
    ----------
    pid : int
        The process.
    """
    lines = (line.split() for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return {line[0].rstrip(":"): int(line[1]) * 1024 // 1000 for line in lines if line[-1] == "kB"}


def processes_in(namespace: str) -> list[Path]:
    """Return `/proc/PID` of each process in a namespace.

    Parameters
    ----------
    namespace : str
        What `namespace_of` returned. Without a name the list is empty, since the processes can't be told from others.
    """
    if not namespace:
        return []
    return [place for place in Path("/proc").glob("[0-9]*") if _link(place / "ns" / "pid") == namespace]


def has_ended(process: Path) -> bool:
    """Return whether a process has ended with all its threads; a zombie has.

    Parameters
    ----------
    process : Path
        `/proc/PID`.
    """
    with suppress(OSError):
        return _state(process) in "ZX" and threads_of([process]) < 2
    return True


def _state(place: Path) -> str:
    """Return the letter that tells what a process or thread does."""
    return (place / "stat").read_text().rpartition(")")[2].split()[0]


def processes_below(pid: int) -> list[Path]:
    """Return `/proc/PID` of all descendants of a process.

    Parameters
    ----------
    pid : int
        The process.
    """
    found: list[Path] = []
    for tasks in Path(f"/proc/{pid}/task").glob("[0-9]*"):
        with suppress(OSError):
            for child in map(int, (tasks / "children").read_text().split()):
                found += [Path(f"/proc/{child}"), *processes_below(child)]
    return found


def threads_of(processes: Iterable[Path], owner: int | None = None) -> int:
    """Return how many threads some processes have.

    Parameters
    ----------
    processes : iterable of Path
        `/proc/PID` of each.
    owner : int, optional
        Number of the user whose processes count; by default all count.
    """
    found = 0
    for tasks in (place / "task" for place in processes):
        with suppress(OSError):
            found += sum(1 for _ in tasks.iterdir()) if owner in (None, tasks.stat().st_uid) else 0
    return found


def busy_threads(processes: Iterable[Path]) -> int:
    """Return how many threads of some processes run, or wait for a processor.

    Parameters
    ----------
    processes : iterable of Path
        `/proc/PID` of each.
    """
    found = 0
    for task in (task for place in processes for task in place.glob("task/*")):
        with suppress(OSError):
            found += _state(task) == "R"
    return found


def memory_held(processes: list[Path]) -> int:
    """Return the bytes of memory that some processes hold together, shared memory counted once, without their files.

    Parameters
    ----------
    processes : list of Path
        `/proc/PID` of each.
    """
    kinds = ("Pss_Anon:", "Pss_Shmem:", "SwapPss:")
    held = 0
    for place in processes:
        with suppress(OSError):
            lines = map(str.split, (place / "smaps_rollup").read_text().splitlines())
            held += sum(int(line[1]) for line in lines if line[0] in kinds)
    return 1024 * held


def deleted_bytes(processes: list[Path], each: int) -> int:
    """Return the bytes on disk of deleted files that some processes still have open or mapped.

    Parameters
    ----------
    processes : list of Path
        `/proc/PID` of each.
    each : int
        What to count for a file whose size the system doesn't report.
    """
    sizes: dict[int, int] = {}
    for place in processes:
        with suppress(OSError):
            mapped = [line.split(maxsplit=5) for line in (place / "maps").read_text(errors="replace").splitlines()]
            sizes |= {int(line[4]): each for line in mapped if line[-1].endswith("(deleted)") and line[4] != "0"}
            for opened in (place / "fd").iterdir():
                with suppress(OSError):
                    found = opened.stat()
                    if stat.S_ISREG(found.st_mode) and not found.st_nlink:
                        sizes[found.st_ino] = found.st_blocks * 512
    return sum(sizes.values())


def exceeds_disk_limits(folder: Path, max_bytes: int) -> bool:
    """Return whether the files in a folder are too large together, too many, or can't be listed.

    Parameters
    ----------
    folder : Path
        The folder.
    max_bytes : int
        Limit for all files together.
    """
    return disk_use(folder, max_bytes) > max_bytes


def disk_use(folder: Path, max_bytes: float = inf, since: float = -inf) -> float:
    """Return the bytes on disk of the files in a folder: infinity when they are too many or can't be listed.

    Parameters
    ----------
    folder : Path
        The folder.
    max_bytes : float
        Files beyond this sum aren't looked at.
    since : float
        Only files that were changed since then, seconds of `time.time`.
    """
    size = 0
    count = 0
    waiting = [str(folder)]
    while waiting:
        try:
            with os.scandir(waiting.pop()) as entries:
                for entry in entries:
                    # A file that has just been deleted must not hide the others beside it.
                    with suppress(FileNotFoundError):
                        found = entry.stat(follow_symlinks=False)
                        used = getattr(found, "st_blocks", 0) * 512 or found.st_size
                        size = size + used * (found.st_mtime >= since)
                        count = count + 1
                        if stat.S_ISDIR(found.st_mode):
                            waiting.append(entry.path)
                    if size > max_bytes or count > MAX_FILES:
                        return inf
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError:  # a closed folder, or a path that is too long for the system
            return inf
    return size


def delete_folder(folder: Path) -> None:
    """Delete a folder, even if it was made unreadable, or too deep for `shutil.rmtree`.

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


class PeakMemory:
    """The growth of a process's memory to its peak, measured from outside while a `with` block runs.

    Written and mapped files count, and the memory of descendants. Only Linux can measure this; elsewhere it is 0.

    Parameters
    ----------
    pid : int
        The process.
    folder : Path
        The only folder to which it may write.
    """

    def __init__(self, pid: int, folder: Path) -> None:
        self.pid = pid
        self.folder = folder
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self._sample_family, daemon=True)
        try:
            Path(f"/proc/{pid}/clear_refs").write_text("5")  # resets the peak
            self.held: int | None = memory_of(pid)["VmRSS"]
        except (OSError, KeyError):
            self.held = None

    def __enter__(self) -> "PeakMemory":
        """Begin."""
        self.began = time.time() - CLOCK_TICK
        self.first = memory_held([Path(f"/proc/{self.pid}")])
        self.largest = 0.0
        if self.held is not None:
            self.thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        """End."""
        self.ended.set()

    def megabytes(self) -> float:
        """Return by how much the memory has grown at most."""
        if self.held is None:
            return 0.0
        self.ended.set()
        self.thread.join()
        alone = (memory_of(self.pid)["VmHWM"] - self.held) / 1000
        self._sample()
        return max(alone, (self.largest - self.first) / MEGABYTE)

    def _sample_family(self) -> None:
        """Measure again and again, because a child's memory has no peak that outlives it."""
        until = time.monotonic() + MAX_SAMPLING
        while not self.ended.wait(SAMPLE_INTERVAL) and time.monotonic() < until:
            self._sample()

    def _sample(self) -> None:
        """Measure files, and what the process and its descendants hold, unless its own peak tells everything."""
        below = processes_below(self.pid)
        family = [Path(f"/proc/{self.pid}"), *below]
        written = disk_use(self.folder, since=self.began) + deleted_bytes(family, 0)
        if written or below:
            self.largest = max(self.largest, written + memory_held(family))
