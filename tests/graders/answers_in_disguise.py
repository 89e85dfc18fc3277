"""Answers that give away too little or the right thing in other types: code that a student could add to any answer.

It wraps each function of an answer, so that one list tries all exercises: what a submission gives for inputs that it
doesn't know (`POINTLESS`), the types of numbers in which an honest one may calculate (`HONEST`), and one that leaves
nothing of its arguments (`SPOILING`).
"""

import ast

WRAPPING = """
def _disguised(answer, number):
    import functools, itertools, numpy as np

    def each(value, change):
        if isinstance(value, tuple):
            return tuple(each(part, change) for part in value)
        if isinstance(value, dict):
            return {name: each(part, change) for name, part in value.items()}
        if hasattr(value, "table"):
            return type(value)(value.names, np.asarray(change(value.table), float))
        array = np.asarray(value)
        return change(array) if array.dtype.kind in "iuf" or array.dtype.kind == "b" and array.ndim else fixed(value)

    def fixed(value):
        seen.append(value)
        return value if number is None else seen[0]

    seen, calls = [], itertools.count()
    rng = np.random.default_rng(1)

    @functools.wraps(answer)
    def disguised(*arguments, **named):
        _depth.append(answer)
        try:
            result = answer(*arguments, **named)
        finally:
            _depth.pop()
        return result if _depth else each(result, change)

    def change(right):
        CHANGE

    return disguised

_depth = globals().get("_depth", [])
for _name in NAMES:
    globals()[_name] = _disguised(globals()[_name], NUMBER)
"""

POINTLESS = {
    "empty": "return np.empty(0)",
    "broadcast": "return np.empty((0, 1, 1))",
    "zeros": "return np.zeros(right.shape)",
    "constant": "return np.full(right.shape, 0.3)",
    "NaN": "return np.full(right.shape, np.nan)",
    "noise": "return rng.uniform(0, 1, right.shape)",
}
"""What an answer gives instead of the right result, for inputs that it doesn't know."""

HONEST = {
    "float32": """
        return right.astype(np.float32) if right.dtype.kind == "f" else right""",
    "other numbers": """
        from array import array
        from collections import deque
        from decimal import Decimal
        from fractions import Fraction
        from mpmath import mpf
        from sympy import Float
        if right.dtype.kind != "f":
            return deque(right.tolist()) if right.ndim else right.item()
        exact = (lambda x: Fraction(x) if np.isfinite(x) else x)
        kind = (exact, Decimal, mpf, lambda x: Float(x, 20))[next(calls) % 4]
        if right.size > 10_000:  # nobody calculates a map so, and a million fractions take half a minute
            return right.astype(np.longdouble)
        if right.ndim == 0:
            return kind(right.item())
        if right.ndim == 1 and next(calls) % 2:
            return array("d", right.tolist())
        return deque(np.vectorize(kind, otypes=[object])(right).tolist() if right.size else right.tolist())""",
}
"""The right result in another type."""

SPOILING = """
def _spoil(value):
    import dataclasses, numpy as np
    if isinstance(value, np.ndarray) and value.flags.writeable:
        value[...] = np.zeros_like(value)
    elif dataclasses.is_dataclass(value):
        _spoil(vars(value))
    elif isinstance(value, (list, tuple, dict)):
        for part in value.values() if isinstance(value, dict) else value:
            _spoil(part)
    if isinstance(value, list):
        value.clear()

def _spoiling(answer):
    import functools

    @functools.wraps(answer)
    def spoiling(*arguments, **named):
        result = answer(*arguments, **named)
        _spoil((arguments, named))
        return result

    return spoiling

for _name in NAMES:
    globals()[_name] = _spoiling(globals()[_name])
"""
"""Each function zeroes the arrays that it was given, and empties the lists."""


def disguise(code, change, pointless):
    """Return the code that wraps the functions of an answer; "" for an answer without functions."""
    return _around(code, WRAPPING.replace("CHANGE", change).replace("NUMBER", "0" if pointless else "None"))


def spoil(code):
    """Return an answer whose functions spoil what they are given."""
    return code + _around(code, SPOILING)


def _around(code, wrapping):
    """Return the code that wraps the functions of an answer; "" for an answer without functions."""
    names = [node.name for node in ast.parse(code).body if isinstance(node, ast.FunctionDef) and node.name[0] != "_"]
    return wrapping.replace("NAMES", repr(names)) if names else ""
