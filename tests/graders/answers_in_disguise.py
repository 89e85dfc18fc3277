"""Answers whose results are changed: code that is added to any answer, so that one list tries all exercises.

The global `_kind` in the student's notebook chooses the change, at each call of a function that isn't inside another.
It is "right" by default; "spoil" keeps the right result, zeroes the arrays and empties the lists among the arguments.
"""

import ast

POINTLESS = ("empty", "broadcast", "zeros", "constant", "NaN", "noise")
"""What an answer gives instead of the right result, for inputs that it doesn't know."""

HONEST = ("float32",)
"""The right result in another type; what else is read as numbers arrives as such (`test_values`)."""

WRAPPING = """
def _disguised(answer):
    import dataclasses, functools, numpy as np
    fixed, rng = {}, np.random.default_rng(1)

    @functools.wraps(answer)
    def disguised(*arguments, **named):
        kind = globals().get("_kind", "right")
        _depth.append(answer)
        try:
            result = answer(*arguments, **named)
        finally:
            _depth.pop()
        if kind == "spoil":
            spoil((arguments, named))
        return result if _depth or kind in ("right", "spoil") else changed(result, kind)

    def changed(value, kind):
        if isinstance(value, tuple):
            return tuple(changed(part, kind) for part in value)
        if isinstance(value, dict):
            return {name: changed(part, kind) for name, part in value.items()}
        if hasattr(value, "table"):
            return type(value)(value.names, np.asarray(changed(value.table, kind), float))
        right = np.asarray(value)
        if not (right.dtype.kind in "iuf" or right.dtype.kind == "b" and right.ndim):
            return value if kind == "float32" else fixed.setdefault(kind, value)
        if kind == "empty":
            return np.empty(0)
        if kind == "broadcast":
            return np.empty((0, 1, 1))
        if kind == "noise":
            return rng.uniform(0, 1, right.shape)
        if kind in ("zeros", "constant", "NaN"):
            return np.full(right.shape, {"zeros": 0.0, "constant": 0.3, "NaN": np.nan}[kind])
        return right.astype(np.float32) if right.dtype.kind == "f" else right

    def spoil(value):
        if isinstance(value, np.ndarray) and value.flags.writeable:
            value[...] = np.zeros_like(value)
        elif dataclasses.is_dataclass(value):
            spoil(vars(value))
        elif isinstance(value, (list, tuple, dict)):
            for part in value.values() if isinstance(value, dict) else value:
                spoil(part)
        if isinstance(value, list):
            value.clear()

    return disguised

_depth = globals().get("_depth", [])
for _name in NAMES:
    globals()[_name] = _disguised(globals()[_name])
"""


def disguise(code):
    """Return an answer whose functions change their results as `_kind` demands."""
    names = [node.name for node in ast.parse(code).body if isinstance(node, ast.FunctionDef) and node.name[0] != "_"]
    return code + WRAPPING.replace("NAMES", repr(names)) if names else code
