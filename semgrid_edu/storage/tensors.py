"""Named tensors (safetensors) and named arrays (npz) on disk: atomic writes and checked reading."""

import io
from lzma import LZMAError
from pathlib import Path
from zipfile import BadZipFile
from zlib import error as ZlibError

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import atomic_path, found_at, write_bytes
from semgrid_edu.storage.reading import read_bytes


def write_arrays(path: str | Path, arrays: dict[str, NDArray]) -> None:
    """Write arrays to one compressed file, atomically.

    The same arrays give the same bytes, because the members of an npz file have no date.

    Parameters
    ----------
    path : path-like
        The .npz file to write; its folder is created when missing.
    arrays : dict of str to array
        Arrays of numbers or strings, by name.

    Raises
    ------
    OSError
        When the file can't be written, for example because the disk is full. The error names the file, which is
        unchanged.
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
    """
    content = io.BytesIO(read_bytes(Path(path)))
    try:
        with np.load(content, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (ValueError, EOFError, AttributeError, NotImplementedError, BadZipFile, LZMAError, ZlibError) as error:
        raise DataError(path, "an npz file of arrays", error) from error


def write_tensors(path: str | Path, tensors: dict[str, Tensor], header: dict[str, str] | None = None) -> None:
    """Write tensors and a header to one file, atomically.

    Parameters
    ----------
    path : path-like
        The safetensors file to write; its folder is created when missing.
    tensors : dict of str to Tensor
        Tensors by name, contiguous and on the CPU.
    header : dict of str to str, optional
        What a reader should know. With more than one entry, the same tensors may give different bytes, because
        safetensors doesn't fix the order of the entries.

    Raises
    ------
    OSError
        When the file can't be written, for example because the disk is full. The error names the file, which is
        unchanged.
    """
    write_bytes(path, save(tensors, metadata=header))


def read_tensors(path: str | Path) -> tuple[dict[str, str], dict[str, Tensor]]:
    """Read the header and the tensors of a safetensors file.

    Parameters
    ----------
    path : path-like
        The safetensors file to read.

    Returns
    -------
    header : dict of str to str
        Empty when the file has none.
    tensors : dict of str to Tensor
        Tensors by name, on the CPU.
    """
    if not Path(path).is_file():
        raise DataError(path, "a safetensors file", found_at(path))
    try:
        with safe_open(path, framework="pt") as file:
            return file.metadata() or {}, {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as error:
        raise DataError(path, "a safetensors file", error) from error
