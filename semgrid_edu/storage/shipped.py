"""Folders that are shipped with the package: in a clone they lie beside it, in a wheel inside it."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of the package."""


def shipped_folder(name: str) -> Path:
    """Return where a shipped folder is.

    Parameters
    ----------
    name : str
        Its name in a clone, such as "data_samples". A wheel holds only the parts that pyproject.toml names.

    Returns
    -------
    Path
        The folder inside the package where there is one, as in a wheel; else the one beside the package.

    Examples
    --------
    >>> (shipped_folder("data_samples") / "sample").is_dir()
    True
    """
    inside = PACKAGE / name
    return inside if inside.is_dir() else PACKAGE.parent / name
