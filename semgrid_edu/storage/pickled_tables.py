"""Tables that pandas pickled and gzip packed, read without pandas and without running what a pickle asks for.

A pickle is a program: it names functions, and whoever loads it calls them. Here every name stands for an empty class
that only keeps what it is given (`_StandIn`), names that no table needs are refused, and the columns are then taken
out of what was kept. So nothing that a hostile file asks for is run.
"""

import gzip
import io
import pickle
import pickletools
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_bytes

MOST_BYTES = 256 * 2**20
"""Unpacked bytes from which on a file is no table of this kind: thirty times a scan of 170,000 returns."""

MOST_OPERATIONS = 10**6
"""Operations from which on a pickle is no table of this kind: a column of text takes two for each row."""

_EXPECTED = "a gzipped pickle of a pandas table"


class _StandIn:
    """Keeps what a pickle hands to a class or function of numpy or pandas, and does nothing with it."""

    __slots__ = ("args", "state")

    def __new__(cls, *args: object) -> "_StandIn":
        made = object.__new__(cls)
        made.args, made.state = args, None
        return made

    def __setstate__(self, state: object) -> None:
        self.state = state


_NAMES = {
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
"""All that a table's pickle may name, by the modules that numpy and pandas have kept it in."""

_STAND_INS = {name: type(name, (_StandIn,), {"__slots__": ()}) for name in _NAMES}


class _TableUnpickler(pickle.Unpickler):
    """Gives each name its stand-in."""

    def find_class(self, module: str, name: str) -> type[_StandIn]:
        if module not in _NAMES.get(name, ()):
            raise pickle.UnpicklingError(f"one that names {module}.{name}, which no table needs")
        return _STAND_INS[name]


def read_pickled_table(path: Path) -> dict[str, NDArray]:
    """Read the columns of a table that pandas (0.25 to 3) wrote with `to_pickle("....pkl.gz")`.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    dict of str to (N,) array
        The columns by name, all of one length: numbers, booleans, or objects such as text.

    Raises
    ------
    DataError
        When the file is missing, damaged, longer than `MOST_BYTES` or has more than `MOST_OPERATIONS`, holds something
        else, or names a class that belongs neither to numpy's arrays nor to pandas' tables.
    """
    content = _unpacked(path)
    try:
        _check_operations(content)
        return _columns(_TableUnpickler(io.BytesIO(content)).load())
    except Exception as error:  # a damaged pickle can raise any
        found = str(error) if isinstance(error, pickle.UnpicklingError) else f"{type(error).__name__}: {error}"
        raise DataError(path, _EXPECTED, found[:300]) from error


def _unpacked(path: Path) -> bytes:
    """Return what gzip packed, and stop at `MOST_BYTES`."""
    packed = io.BytesIO(read_bytes(path))
    try:
        content = gzip.GzipFile(fileobj=packed).read(MOST_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise DataError(path, _EXPECTED, error) from error
    if len(content) > MOST_BYTES:
        raise DataError(path, f"at most {MOST_BYTES} bytes, unpacked", "more")
    return content


def _check_operations(content: bytes) -> None:
    """Refuse a pickle of too many operations, before they are done: one byte can ask for an object of 200 bytes.

    Five bytes can ask for a memo, the list of objects to come back to, of tens of gigabytes.
    """
    for done, (operation, argument, _) in enumerate(pickletools.genops(content)):
        numbered = argument if operation.name in ("PUT", "LONG_BINPUT") else 0
        if max(done, numbered) >= MOST_OPERATIONS:
            raise pickle.UnpicklingError(f"more than {MOST_OPERATIONS} operations")


def _columns(table: _StandIn) -> dict[str, NDArray]:
    """Return the columns of a table. pandas keeps columns of one type together, as the rows of a block."""
    state = _of(table, "DataFrame").state
    manager = _of(state["_mgr"] if "_mgr" in state else state["_data"], "BlockManager")
    if manager.args:  # since pandas 1.3
        blocks, axes = manager.args
        pairs = [_of(block, "_unpickle_block").args[:2] for block in blocks]
    else:
        content = manager.state[3]["0.14.1"]
        axes, pairs = content["axes"], [(block["values"], block["mgr_locs"]) for block in content["blocks"]]
    names = _array(_of(axes[0], "_new_Index").args[1]["data"]).tolist()
    columns: dict[str, NDArray] = {}
    for values, places in pairs:
        rows = np.atleast_2d(_array(values))
        columns |= dict(zip((names[place] for place in _places(places)), rows, strict=True))
    even = len({len(column) for column in columns.values()}) <= 1 and all(one.ndim == 1 for one in columns.values())
    if not even or sorted(columns) != sorted(map(str, names)):
        raise pickle.UnpicklingError("a table whose columns differ in length, come twice or are missing")
    return {name: columns[name] for name in names}


def _places(places: _StandIn) -> range | list[int]:
    """Return which columns a block holds."""
    return range(*places.args) if isinstance(places, _STAND_INS["slice"]) else _array(places).tolist()


def _array(values: _StandIn) -> NDArray:
    """Return a numpy array, from what it was pickled as."""
    if isinstance(values, _STAND_INS["__pyx_unpickle_NDArrayBacked"]):  # text, since pandas 3
        values = values.state[1]
    if isinstance(values, _STAND_INS["_frombuffer"]):  # protocol 5
        data, dtype, shape, order = values.args
    else:
        _, shape, dtype, fortran, data = _of(values, "_reconstruct").state
        order = "F" if fortran else "C"
    kind = _of(dtype, "dtype")
    if not re.fullmatch(r"[fiub][1248]|O8?", kind.args[0]):
        raise pickle.UnpicklingError(f"an array of the type {kind.args[0]!r}")
    if kind.args[0].startswith("O"):
        flat = np.fromiter(data, object, len(data))
    else:
        flat = np.frombuffer(data, np.dtype(kind.args[0]).newbyteorder(kind.state[1]))
    return flat.reshape(shape, order=order)


def _of(thing: object, name: str) -> Any:
    """Return a stand-in, refusing one of another class."""
    if not isinstance(thing, _STAND_INS[name]):
        raise pickle.UnpicklingError(f"a pickle with {type(thing).__name__} in place of {name}")
    return thing
