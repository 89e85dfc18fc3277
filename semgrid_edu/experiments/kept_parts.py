"""Results that are kept part by part while an experiment runs, so that an interrupted one goes on where it was."""

import json
from pathlib import Path

from semgrid_edu.errors import DataError


def read_parts(log: str | Path, identity: dict[str, object], key: str) -> dict[str, dict]:
    """Return the parts that a file holds.

    Parameters
    ----------
    log : path-like
        The file of a result, finished or not; it may be missing.
    identity : dict
        What makes the experiment, such as its seed: the file must say the same. JSON must give it back as it is.
    key : str
        Under which the file keeps its parts.

    Returns
    -------
    dict of str to dict
        The parts by name; none when there is no file.

    Raises
    ------
    DataError
        When the file is something else, or was made by another experiment.
    """
    path = Path(log)
    if not path.exists():
        return {}
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        found, parts = {name: content[name] for name in identity}, dict(content[key])
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(path, "a result of this experiment, or no file", f"something else: {error!r}") from error
    if found != identity:
        raise DataError(path, f"a result of {identity}", f"{found}: choose another file")
    return parts
