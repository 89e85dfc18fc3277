"""What a function changed in its arguments, carried over to those of the caller."""

from typing import Any

import numpy as np


def put_back(original: Any, changed: Any) -> Any:
    """Change a value, as far as it can be changed in place, into what a copy of it became.

    Parameters
    ----------
    original : object
        What the caller holds: its arrays, lists and dicts are changed.
    changed : object
        The copy.

    Returns
    -------
    object
        `original` where it could be changed, otherwise `changed`.

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
    if isinstance(original, np.ndarray) and original.shape == changed.shape and original.flags.writeable:
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
