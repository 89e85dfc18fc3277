"""Read tables that pandas pickled and gzip compressed, without running code from a hostile pickle.

A pickle is a program: it names functions, and loading it calls them. Here it may only name what pandas needs to rebuild
a table (`_ALLOWED`).
"""

import gzip
import io
import pickle
import pickletools
import zlib
from pathlib import Path
from typing import NamedTuple

from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_bytes

MOST_BYTES = 256 * 2**20
"""Largest uncompressed size of a table: thirty times a scan of 170,000 returns."""

MOST_OPERATIONS = 10**6
"""Largest number of operations in a table's pickle: a text column takes two per row."""

_EXPECTED = "a gzipped pickle of a pandas table"

_ALLOWED = {
    "DataFrame": ("pandas.core.frame", "pandas"),
    "BlockManager": ("pandas.core.internals.managers",),
    "_unpickle_block": ("pandas._libs.internals",),
    "_new_Index": ("pandas.core.indexes.base",),
    "Index": ("pandas.core.indexes.base", "pandas"),
    "RangeIndex": ("pandas.core.indexes.range", "pandas"),
    "Int64Index": ("pandas.core.indexes.numeric",),
    "__pyx_unpickle_NDArrayBacked": ("pandas._libs.arrays",),
    "StringArray": ("pandas.core.arrays.string_", "pandas.arrays"),
    "StringDtype": ("pandas.core.arrays.string_", "pandas"),
    "_reconstruct": ("numpy.core.multiarray", "numpy._core.multiarray"),
    "_frombuffer": ("numpy.core.numeric", "numpy._core.numeric"),
    "ndarray": ("numpy",),
    "dtype": ("numpy",),
    "slice": ("builtins",),
}
"""All names that a table's pickle may use, with the modules that hold them in pandas 0.25 to 3 and numpy 1 and 2."""

_MOVED = {
    ("pandas.core.indexes.numeric", "Int64Index"): ("pandas", "Index"),
    ("numpy.core.multiarray", "_reconstruct"): ("numpy._core.multiarray", "_reconstruct"),
    ("numpy.core.numeric", "_frombuffer"): ("numpy._core.numeric", "_frombuffer"),
}
"""The modules of today's pandas and numpy that define names which have moved."""


class _TableUnpickler(pickle.Unpickler):
    """An unpickler that looks up only the names that a table needs."""

    def find_class(self, module: str, name: str) -> object:
        if module not in _ALLOWED.get(name, ()):
            raise pickle.UnpicklingError(f"one that names {module}.{name}, which no table needs")
        return super().find_class(*_MOVED.get((module, name), (module, name)))


class PickledTable(NamedTuple):
    """The contents of a table.

    Parameters
    ----------
    columns : dict of str to (N,) array
        The columns by name, all of the same length: numbers, booleans, or objects such as text.
    rows : (N,) array
        The name of each row, pandas' index: two tables belong together row by row if these agree.
    """

    columns: dict[str, NDArray]
    rows: NDArray


def read_pickled_table(path: Path) -> PickledTable:
    """Read a table that pandas (0.25 to 3) wrote with `to_pickle("....pkl.gz")`.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    PickledTable
        Its columns, and the names of its rows.

    Raises
    ------
    DataError
        When the file is missing, damaged, longer than `MOST_BYTES` or has more than `MOST_OPERATIONS`, holds something
        else, or names what isn't allowed; or when pandas isn't installed.
    """
    try:
        from pandas import DataFrame
    except ModuleNotFoundError:
        expected = "pandas, which reads PandaSet's tables (pip install 'semgrid_edu[pandaset]')"
        raise DataError(path, expected, "no module named pandas") from None
    content = _uncompressed(path)
    try:
        _check_operations(content)
        table = _TableUnpickler(io.BytesIO(content)).load()
        if not isinstance(table, DataFrame):
            raise pickle.UnpicklingError(f"{type(table).__name__} in place of DataFrame")
        columns = {str(name): _column(table[name].to_numpy()) for name in table.columns}
        return PickledTable(columns, table.index.to_numpy())
    except Exception as error:  # a damaged pickle can raise any
        found = str(error) if isinstance(error, pickle.UnpicklingError) else f"{type(error).__name__}: {error}"
        raise DataError(path, _EXPECTED, found[:300]) from error


def _column(values: NDArray) -> NDArray:
    """Check that a column has one value per row: two columns with the same name would have more."""
    if values.ndim != 1 or values.dtype.kind not in "fiubO":
        raise pickle.UnpicklingError(f"a column of the shape {values.shape} and the type {values.dtype}")
    return values


def _uncompressed(path: Path) -> bytes:
    """Uncompress a file, up to `MOST_BYTES`."""
    compressed = io.BytesIO(read_bytes(path))
    try:
        content = gzip.GzipFile(fileobj=compressed).read(MOST_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise DataError(path, _EXPECTED, error) from error
    if len(content) > MOST_BYTES:
        raise DataError(path, f"at most {MOST_BYTES} bytes, unpacked", "more")
    return content


def _check_operations(content: bytes) -> None:
    """Reject a pickle with too many operations before any is run: one byte can create an object of 200 bytes.

    Five bytes can create a memo (the list of objects to refer back to) of tens of gigabytes.
    """
    for done, (operation, argument, _) in enumerate(pickletools.genops(content)):
        memo_size = argument if operation.name in ("PUT", "LONG_BINPUT") else 0
        if max(done, memo_size) >= MOST_OPERATIONS:
            raise pickle.UnpicklingError(f"more than {MOST_OPERATIONS} operations")
