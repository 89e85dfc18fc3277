"""Atomic files and folders, checksums, tables beside modules, one writer per folder, shipped and cache folders."""

import errno
import hashlib
import json
import os
import shutil
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from filelock import FileLock, Timeout

from semgrid_edu.errors import DataError

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of the package, without symbolic links."""


CACHE_VARIABLE = "SEMGRID_EDU_CACHE"
"""The environment variable that names the cache folder; `semgrid-edu --cache` sets it for this and worker processes."""


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`, which is renamed to `path` when the block ends without an error.

    Readers see the old file or the new one, never half of one. If the block raises an error or the process is killed,
    the old file is unchanged.

    Parameters
    ----------
    path : path-like
        The file to write; its folder is created when missing.

    Yields
    ------
    Path
        Where to write. It has the suffix of `path`, for writers that choose a format by the suffix.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "a.txt"
    >>> with atomic_path(target) as temporary:
    ...     _ = temporary.write_text("whole")
    >>> target.read_text()
    'whole'
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(descriptor)
    temporary = Path(name)
    try:
        with named_errors(path):
            yield temporary
            temporary.chmod(0o644)
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: str | Path) -> Iterator[Path]:
    """Yield a temporary folder beside `path`, which is renamed to `path` when the block ends without an error.

    Parameters
    ----------
    path : path-like
        The folder to write, new or empty, see `check_new_folder`.

    Yields
    ------
    Path
        Where to write.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "new"
    >>> with atomic_folder(target) as temporary:
    ...     _ = (temporary / "a.txt").write_text("whole")
    >>> [path.name for path in target.iterdir()]
    ['a.txt']
    """
    path = Path(path).resolve()
    check_new_folder(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}-"))
    try:
        with named_errors(path):
            yield temporary
            temporary.chmod(0o755)
            if path.exists():
                path.rmdir()  # Windows renames nothing over a folder, even if it is empty
            temporary.rename(path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def named_errors(path: str | Path) -> Iterator[None]:
    """Add the name of a file to system errors that lack one, such as "disk full".

    Parameters
    ----------
    path : path-like
        The file that the block writes.
    """
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def found_at(path: str | Path) -> str:
    """Return what is at a path, in the words of an error.

    Parameters
    ----------
    path : path-like
        The path.

    Returns
    -------
    str
        "a file", "a folder", "a pipe, a socket or a device" or "no such file".
    """
    path = Path(path)
    if path.is_file():
        return "a file"
    if path.is_dir():
        return "a folder"
    return "a pipe, a socket or a device" if path.exists() else "no such file"


def check_writable(path: str | Path) -> None:
    """Check that a file can be written, before starting long work whose result would otherwise be lost.

    Parameters
    ----------
    path : path-like
        The file. Its folder need not exist, and isn't made: what is refused leaves nothing behind.

    Raises
    ------
    DataError
        If the path is a folder, a pipe or a device, or can't be in a folder.
    OSError
        When its folder can't be made or written to.
    """
    path = Path(path)
    if path.exists() and not path.is_file():
        raise DataError(path, "a file to write", found_at(path))
    _check_takes_files(path.parent)


def _check_takes_files(folder: Path) -> None:
    """Raise an error if a folder can't be written to, or can't be made; it isn't made."""
    place = Path(os.path.realpath(folder))
    while not _is_there(place):
        place = place.parent
    if not place.is_dir():
        raise DataError(folder, "a folder", f"the {'file' if place.exists() else 'link to nowhere'} {place}")
    try:
        tempfile.TemporaryFile(dir=place).close()
    except OSError as error:
        error.filename = str(folder)  # in place of the temporary file's
        raise


def _is_there(path: Path) -> bool:
    """Return whether something has this name; unlike `Path.exists`, also a link to nowhere."""
    try:
        path.lstat()
    except OSError as error:
        if error.errno not in (errno.ENOENT, errno.ENOTDIR, errno.ELOOP):
            raise
        return False
    return True


def check_new_folder(path: str | Path) -> None:
    """Check that a folder can be written without losing anything, before starting long work.

    Parameters
    ----------
    path : path-like
        The folder. Neither it nor the one that holds it is made.

    Raises
    ------
    DataError
        When it is a file, isn't empty, or can't be in a folder.
    OSError
        When the folder that holds it can't be made or written to.
    """
    place = Path(path).resolve()
    if place.exists() and (not place.is_dir() or any(place.iterdir())):
        raise DataError(path, "a new or an empty folder", "one with files in it" if place.is_dir() else "a file")
    _check_takes_files(place.parent)


def check_ours(mark: str, *paths: str | Path, force: bool | None = None) -> None:
    """Check that files are writable and that no other program's file would be lost; every command does so first.

    A file is ours if it contains the mark that its writer puts into it, such as the command in a result. Empty files
    may be replaced too.

    Parameters
    ----------
    mark : str
        What our files contain.
    *paths : path-like
        The files. The first one contains the mark, and the others belong to it.
    force : bool, optional
        Whether to replace other files anyway; None if the command has no such option.

    Raises
    ------
    DataError
        When one of the files isn't ours, or can't be written.
    OSError
        As for `check_writable`.
    """
    ours = force or (Path(paths[0]).is_file() and mark.encode() in Path(paths[0]).read_bytes())
    for path in map(Path, paths):
        check_writable(path)
        if not ours and path.exists() and path.stat().st_size:
            found = "something else, which would be lost" + " without --force" * (force is False)
            raise DataError(path, "a new file, or an earlier result of this command", found)


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write bytes to a file, atomically.

    Parameters
    ----------
    path : path-like
        The file to write; its folder is created when missing.
    content : bytes
        The content of the file.
    """
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: str | Path, content: str) -> None:
    """Write text to a file, atomically, as UTF-8 with unix line ends.

    Parameters
    ----------
    path : path-like
        The file to write; its folder is created when missing.
    content : str
        The content of the file.
    """
    write_bytes(path, content.encode())


def write_json(path: str | Path, content: object) -> None:
    """Write an object to a file, atomically, as JSON that a person can read and git can compare.

    Parameters
    ----------
    path : path-like
        The file to write; its folder is created when missing.
    content : object
        Anything that JSON can hold.
    """
    write_text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def sha256(path: str | Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal.

    Parameters
    ----------
    path : path-like
        The file to read.
    """
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def table_beside(module: str, name: str | None = None) -> dict[str, Any]:
    """Read one of the package's tables, a TOML file beside a module; its lists become tuples.

    Parameters
    ----------
    module : str
        The `__file__` of the module.
    name : str, optional
        The name of the table's file without its suffix; the module's name by default.
    """
    path = Path(module)
    return _with_tuples(tomllib.loads(path.with_name(f"{name or path.stem}.toml").read_text(encoding="utf-8")))


def _with_tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _with_tuples(part) for name, part in value.items()}
    return tuple(map(_with_tuples, value)) if isinstance(value, list) else value


def named_rows(table: dict[str, dict]) -> dict[str, SimpleNamespace]:
    """Return the rows of a table by their names, each with its columns as attributes.

    Parameters
    ----------
    table : dict
        A part of what `table_beside` returns: rows by their names.
    """
    return {name: SimpleNamespace(**row) for name, row in table.items()}


LOCK = ".lock"
"""Name of the lock file. It is empty; a killed process leaves it behind, which does no harm."""

PATIENCE = 1.0
"""Seconds to wait for a lock: after a command is killed, its worker processes take a moment to end."""


@contextmanager
def sole_writer(folder: str | Path) -> Iterator[None]:
    """Keep other processes from writing to a folder while the block runs.

    When a process is killed, its lock is released at once, so that the next one can resume.

    Parameters
    ----------
    folder : path-like
        The folder; it is created when missing.

    Raises
    ------
    DataError
        When another block, of this process or of another one, writes to the folder, or it is a file.
    OSError
        When the folder can't be made or written to.

    Examples
    --------
    >>> import tempfile
    >>> with sole_writer(tempfile.mkdtemp()):
    ...     print("nobody else writes here")
    nobody else writes here
    """
    folder = Path(folder)
    _check_takes_files(folder)
    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / LOCK)
    try:
        lock.acquire(timeout=PATIENCE)
    except Timeout:
        raise DataError(folder, "a folder that no other process writes to", f"{LOCK} locked by another one") from None
    try:
        yield
    finally:
        with suppress(OSError):  # Windows doesn't delete open files
            (folder / LOCK).unlink()
        lock.release()  # after unlinking: `filelock` rejects a file that was removed while it waited


def shipped_folder(name: str) -> Path:
    """Return where a shipped folder is.

    Parameters
    ----------
    name : str
        Its name in a clone, such as "data_samples". A wheel holds only the parts that pyproject.toml names.

    Returns
    -------
    Path
        The folder inside the package if there is one, as in a wheel; else the folder beside the package.

    Examples
    --------
    >>> (shipped_folder("data_samples") / "sample").is_dir()
    True
    """
    inside = PACKAGE / name
    return inside if inside.is_dir() else PACKAGE.parent / name


def cache_folder(dataset_dir: Path) -> Path:
    """Return the folder for caching what is computed from a data set.

    Parameters
    ----------
    dataset_dir : Path
        The folder of the data set.

    Returns
    -------
    Path
        The folder that `CACHE_VARIABLE` names, which all data sets share; by default `cache` in the data set's folder.
    """
    chosen = os.environ.get(CACHE_VARIABLE)
    return Path(chosen) if chosen else dataset_dir / "cache"
