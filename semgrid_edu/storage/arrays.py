"""Named arrays on disk: compressed npz files that are written whole or not at all, and read with checks."""

import io
from pathlib import Path
from zipfile import BadZipFile
from zlib import error as ZlibError

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import atomic_path
from semgrid_edu.storage.reading import read_bytes


def write_arrays(path: str | Path, arrays: dict[str, NDArray]) -> None:
    """Write arrays to one compressed file, atomically.

    The same arrays give the same bytes, because the members of an npz file carry no date.

    Parameters
    ----------
    path : path-like
        The .npz file to write; its folder is made when missing.
    arrays : dict of str to array
        Arrays of numbers or strings, by name.

    Raises
    ------
    OSError
        When the file can't be written, for example because the disk is full. The error names the file, which stays as
        it was.
    """
    with atomic_path(path) as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **arrays)


def read_arrays(path: str | Path) -> dict[str, NDArray]:
    """Read the arrays of an npz file.

    Parameters
    ----------
    path : path-like
        A file that `write_arrays` wrote.

    Returns
    -------
    dict of str to array
        Arrays by name, in memory.

    Raises
    ------
    DataError
        When the file is missing or damaged, or holds objects, which would have to be unpickled.
    """
    content = io.BytesIO(read_bytes(Path(path)))
    try:
        with np.load(content, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (ValueError, EOFError, AttributeError, NotImplementedError, BadZipFile, ZlibError) as error:
        raise DataError(path, "an npz file of arrays", error) from error
