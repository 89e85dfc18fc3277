"""Plain values as bytes, which may pass between a student's process and the grader's. Never a pickle.

A message is one line of JSON, followed by the bytes of its arrays. Reading it creates numbers, texts, containers,
arrays and a few of the package's records, and runs nothing that the sender wrote.
"""

import json
import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.storage.files import table_beside

RECORDS: tuple[str, ...] = table_beside(__file__)["records"]
"""The package's records that may pass; the last part is the class."""

KINDS = "?biufcUS"
"""The kinds of array that may pass, in numpy's letters: booleans, numbers and texts."""

MAX_BYTES = 10_000_000
"""Limit for all arrays of a result, bytes. It is 100 times what exercises return, as tests may broadcast results."""

MAX_INPUT = 150_000_000
"""Limit for all arrays among arguments, bytes: several frames of a drive, with images, are larger than a result."""

MAX_JSON = 10_000_000
"""Limit for a message without its arrays, bytes: room for lists of half a million numbers."""

MAX_KEYS = 20_000
"""Limit for the entries of a set or dict: keys that are chosen to collide take quadratic time."""

REPLIES: dict[str, type | tuple[type, ...]] = {
    **dict.fromkeys(("result", "changed", "arguments", "named"), object),
    **dict.fromkeys(("streams", "error", "values"), dict),
    **dict.fromkeys(("done", "functions", "shown", "traceback"), list),
    **dict.fromkeys(("callback", "number"), int),
}
"""The types of the parts of a reply, by their names; all others are texts."""

MAX_MESSAGE = MAX_INPUT + MAX_JSON
"""Limit for a message that is read, bytes: changed arguments come back, images perhaps as float64."""


class NotPlainError(TypeError):
    """A value that can't be sent."""


def encode(value: Any, callbacks: list[Callable] | None = None, max_bytes: int = MAX_BYTES) -> bytes:
    """Turn a value into bytes.

    Parameters
    ----------
    value : object
        None, a boolean, number or text; a list, tuple, set or dict of such; an array of these, or what numpy turns
        into an array (a tensor, a table, a fraction); one of `RECORDS`.
    callbacks : list of callable, optional
        Collects the functions within `value`; the other side gets their numbers. Without it no function can pass.
    max_bytes : int
        Limit for all arrays together.

    Raises
    ------
    NotPlainError
        When a part of the value is something else.
    """
    arrays: list[NDArray] = []
    tree = _tree(value, arrays, callbacks)
    head = json.dumps({"value": tree, "arrays": [[array.dtype.str, array.shape] for array in arrays]})
    if len(head) > MAX_JSON or sum(array.nbytes for array in arrays) > max_bytes:
        raise NotPlainError("more than can be sent: is it as long as it should be, and an array rather than a list?")
    return b"".join([head.encode(), b"\n", *(array.tobytes() for array in arrays)])


def decode(data: bytes, callback: Callable[[int], Callable] | None = None) -> Any:
    """Turn bytes back into the value that `encode` was given; an array is a plain one with new memory.

    Parameters
    ----------
    data : bytes
        The message.
    callback : callable, optional
        Turns the number of a function into a function to call in its place.

    Raises
    ------
    ArgumentError
        When the bytes are no such message.
    """
    head, _, rest = data.partition(b"\n")
    try:
        if len(head) > MAX_JSON:
            raise ValueError(f"{len(head)} bytes of JSON")
        message = json.loads(head)
        return _value(message["value"], _arrays(message["arrays"], rest), callback)
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError, MemoryError) as error:
        raise ArgumentError("data", "a message of plain values", f"{type(error).__name__}: {error}") from error


def check_reply(reply: dict) -> None:
    """Raise when a reply isn't made as `Worker` makes it: a student's code may have sent it.

    Parameters
    ----------
    reply : dict
        The reply.

    Raises
    ------
    TypeError
        When a part of it is of another type.
    """
    parts = [*reply.items(), *dict(reply.get("error", {})).items(), *dict(reply.get("streams", {})).items()]
    shown = [one for data in list(reply.get("shown", [])) for one in dict(data).items()]
    texts = [*shown, *(("", one) for name in ("functions", "traceback") for one in dict(parts).get(name, []))]
    for name, value in [*parts, *texts]:
        if not isinstance(value, REPLIES.get(name, str)):
            raise TypeError(f"{name} of a reply is a {type(value).__name__}")


def _tree(value: Any, arrays: list[NDArray], callbacks: list[Callable] | None) -> Any:
    """Return a value as JSON holds it; its arrays are added to the list."""

    def trees(values: Any) -> list:
        return [_tree(one, arrays, callbacks) for one in values]

    if value is None or type(value) in (bool, int, float, str):
        return value
    if type(value) is list:
        return trees(value)
    if isinstance(value, str) and not isinstance(value, np.generic):
        return str.__str__(value)  # a text with a name may print that name
    for kind in (int, float):
        if isinstance(value, kind) and not isinstance(value, np.generic):
            return kind(value)
    if isinstance(value, set | frozenset | dict) and len(value) > MAX_KEYS:
        raise NotPlainError(f"a {type(value).__name__} of {len(value)} entries, more than {MAX_KEYS}")
    for kind in (tuple, set, frozenset):
        if isinstance(value, kind):
            return {kind.__name__: trees(value)}
    if isinstance(value, dict):
        return {"dict": [trees(pair) for pair in value.items()]}
    if _path(value) in RECORDS:
        return {"record": _path(value), "fields": trees(getattr(value, field.name) for field in fields(value))}
    if isinstance(value, np.generic | complex):
        return {"scalar": _tree(np.array(value), arrays, callbacks)}
    if callable(value) and callbacks is not None:
        callbacks.append(value)
        return {"function": len(callbacks) - 1}
    return _array_tree(value, arrays, callbacks)


def _array_tree(value: Any, arrays: list[NDArray], callbacks: list[Callable] | None) -> Any:
    """Return what numpy takes for an array, as JSON holds it."""
    plain = isinstance(value, np.ndarray | range | list) or hasattr(value, "__array__")
    try:
        array = np.asarray(value)
        array = array if plain or array.dtype.kind in "?biufc" else array.astype(float)  # a fraction, a deque
    except Exception:
        kind = type(value).__name__
        raise NotPlainError(f"a {kind} where numbers, texts, arrays, lists or dicts are expected") from None
    if array.dtype.kind == "O":
        return {"objects": _tree(array.tolist(), arrays, callbacks)}
    if array.dtype.kind not in KINDS:
        raise NotPlainError(f"an array of {array.dtype}, where numbers, booleans or texts are expected")
    arrays.append(array)
    tree = {"array": len(arrays) - 1}
    return tree if plain or array.ndim else {"scalar": tree}


def _path(value: Any) -> str | None:
    """Return the dotted path of a record's class."""
    return f"{type(value).__module__}.{type(value).__qualname__}" if is_dataclass(value) else None


def _arrays(described: list, data: bytes) -> dict[int, NDArray]:
    """Cut the bytes of a message into arrays, each of which may be used once in the value."""
    found = []
    start = 0
    for text, shape in described:
        dtype = np.dtype(text)
        if dtype.kind not in KINDS or not all(type(n) is int and n >= 0 for n in shape):
            raise ValueError(f"an array of {text} and shape {shape}")
        end = start + dtype.itemsize * math.prod(shape)
        if end > len(data):
            raise ValueError(f"{len(data)} bytes where {end} are needed")
        found.append(np.frombuffer(data[start:end], dtype).reshape(shape).copy())
        start = end
    return dict(enumerate(found))


def _value(tree: Any, arrays: dict[int, NDArray], callback: Callable[[int], Callable] | None) -> Any:
    """Return the value that a tree of JSON describes."""
    if isinstance(tree, list):
        return [_value(one, arrays, callback) for one in tree]
    if isinstance(tree, str):
        return writable(tree)
    if not isinstance(tree, dict):
        return tree
    kind, content = next(iter(tree.items()))
    if kind == "array":
        return arrays.pop(content)
    if kind == "function":
        return callback(content)
    if kind == "record":
        return _record(content, _value(tree["fields"], arrays, callback))
    inner = _value(content, arrays, callback)
    if kind in ("set", "frozenset", "dict") and len(inner) > MAX_KEYS:
        raise ValueError(f"a {kind} of {len(inner)} entries")
    makers = {"tuple": tuple, "set": set, "frozenset": frozenset, "dict": dict, "scalar": lambda array: array[()]}
    return np.array(inner, dtype=object) if kind == "objects" else makers[kind](inner)


def writable(text: str) -> str:
    """Return a text with a question mark for each half of a surrogate pair, since no file can hold one.

    Parameters
    ----------
    text : str
        Any text.
    """
    return text.encode("utf-8", "replace").decode()


def _record(path: str, values: list) -> Any:
    """Return a record of the package."""
    if path not in RECORDS:
        raise ValueError(f"a record {path!r}")
    module, _, name = path.rpartition(".")
    return getattr(import_module(module), name)(*values)


def put_back(original: Any, changed: Any) -> Any:
    """Apply the changes that a function in another process made to its copy of an argument; return the result.

    Parameters
    ----------
    original : object
        What the caller has. Its arrays, lists and dicts are changed in place; where that isn't possible, `changed` is
        returned.
    changed : object
        What the copy became.

    Examples
    --------
    >>> inner = np.zeros(2)
    >>> put_back([inner, 1], [np.ones(2), 2, 3])
    [array([1., 1.]), 2, 3]
    >>> inner
    array([1., 1.])
    """
    if type(original) is not type(changed):
        return changed
    alike = isinstance(original, np.ndarray) and (original.shape, original.dtype) == (changed.shape, changed.dtype)
    if alike and original.flags.writeable:
        original[...] = changed
    elif isinstance(original, list):
        original[:] = [*map(put_back, original, changed), *changed[len(original) :]]
    elif isinstance(original, dict):
        now = {key: put_back(original[key], value) if key in original else value for key, value in changed.items()}
        original.clear()
        original.update(now)
    elif isinstance(original, tuple):
        return tuple(map(put_back, original, changed))
    else:
        return changed
    return original


class Wire:
    """Both directions of a connection; each message is its length in eight bytes, then its bytes.

    Parameters
    ----------
    incoming, outgoing : binary file
        The two pipes.
    """

    def __init__(self, incoming: BinaryIO, outgoing: BinaryIO) -> None:
        self.incoming = incoming
        self.outgoing = outgoing

    def send(self, message: bytes) -> None:
        """Send a message.

        Parameters
        ----------
        message : bytes
            The message.
        """
        self.outgoing.write(len(message).to_bytes(8, "big") + message)
        self.outgoing.flush()

    def receive(self) -> bytes | None:
        """Return the next message; None if the other side has hung up, or sends something that isn't a message."""
        head = self.incoming.read(8)
        length = int.from_bytes(head, "big")
        if len(head) < 8 or length > MAX_MESSAGE:
            return None
        message = self.incoming.read(length)
        return message if len(message) == length else None
