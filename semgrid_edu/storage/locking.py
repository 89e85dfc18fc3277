"""One writer at a time: a lock on a folder, which the system releases when its process ends, however it ends."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from semgrid_edu.errors import DataError

LOCK = ".lock"
"""Name of the file that is locked. It is empty; a process that is killed leaves it behind, which does no harm."""

PATIENCE = 1.0
"""Seconds to wait for a lock: when a command is killed, the processes that it had started end a moment later."""


@contextmanager
def sole_writer(folder: str | Path) -> Iterator[None]:
    """Keep other processes from writing to a folder as long as the block runs.

    After a kill the lock is free at once, so that the next process can go on.

    Parameters
    ----------
    folder : path-like
        The folder; it is created when missing.

    Raises
    ------
    DataError
        When another block, of this process or of another one, writes to the folder.
    OSError
        When the folder can't be made or takes no files.

    Examples
    --------
    >>> import tempfile
    >>> with sole_writer(tempfile.mkdtemp()):
    ...     print("nobody else writes here")
    nobody else writes here
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / LOCK)
    try:
        lock.acquire(timeout=PATIENCE)
    except Timeout:
        raise DataError(folder, "a folder that no other process writes to", f"{LOCK} locked by another one") from None
    try:
        yield
    finally:
        with suppress(OSError):  # Windows keeps files that are open
            (folder / LOCK).unlink()
        lock.release()  # only now: `filelock` refuses a file that was removed while it waited
