"""Results that are kept part by part while an experiment runs, so that an interrupted one goes on where it was."""

from pathlib import Path
from typing import Any

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_json


def read_parts(log: str | Path, identity: dict[str, object], key: str, kind: type = dict) -> dict[str, Any]:
    """Return the parts that a file holds.

    Parameters
    ----------
    log : path-like
        The file of a result, finished or not; it may be missing.
    identity : dict
        What makes the experiment, such as its seed: the file must say the same. JSON must give it back as it is.
    key : str
        Under which the file keeps its parts.
    kind : type
        What every part is.

    Returns
    -------
    dict of str to `kind`
        The parts by name; none when there is no file.

    Raises
    ------
    DataError
        When the file is something else, or was made by another experiment.
    """
    path = Path(log)
    if not path.exists():
        return {}
    content = read_json(path)
    found, parts = {name: content.get(name) for name in identity}, content.get(key)
    sound = isinstance(parts, dict) and all(isinstance(part, kind) for part in parts.values())
    if not sound or not identity.keys() <= content.keys():
        raise DataError(path, "a result of this experiment, or no file", f"something else: {repr(content)[:200]}")
    if found != identity:
        raise DataError(path, f"a result of {identity}", f"{found}: choose another file")
    return parts
