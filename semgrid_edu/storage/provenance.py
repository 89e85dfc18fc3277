"""Provenance: how a result was made, checksums that show whether it was changed, and where shipped folders lie."""

import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import sha256, write_json
from semgrid_edu.storage.reading import read_json

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of the package."""

PROVENANCE = "provenance.json"
"""Name of the file in a folder of results that says how they were made."""


def versions(*packages: str) -> dict[str, str]:
    """Return the versions of Python, semgrid_edu and other packages.

    Parameters
    ----------
    *packages : str
        Names of the other packages.

    Returns
    -------
    dict of str to str
        The version of each by its name.

    Examples
    --------
    >>> sorted(versions("numpy"))
    ['numpy', 'python', 'semgrid_edu']
    """
    return {"python": platform.python_version()} | {name: version(name) for name in ("semgrid_edu", *packages)}


def made_by(command: str, *packages: str) -> dict[str, object]:
    """Return how a result was made: the command that repeats it, today's date, and versions.

    Parameters
    ----------
    command : str
        The command line.
    *packages : str
        Names of the packages whose versions matter, see `versions`.

    Returns
    -------
    dict
        "command", "date" (UTC) and "versions".
    """
    return {"command": command, "date": f"{datetime.now(UTC):%Y-%m-%d}", "versions": versions(*packages)}


def commit() -> str | None:
    """Return the commit of the package's source tree, with "+" after it when files were changed since.

    Returns
    -------
    str or None
        None when the package doesn't lie in a git checkout.
    """
    git = ["git", "-C", str(Path(__file__).parent)]
    try:
        head, changes = (
            subprocess.run([*git, *command], capture_output=True, text=True, check=True).stdout.strip()
            for command in (["rev-parse", "--short=12", "HEAD"], ["status", "--porcelain", "--untracked-files=no"])
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return head + ("+" if changes else "")


def write_provenance(folder: str | Path, command: str, seed: int, packages: tuple[str, ...], **details: object) -> None:
    """Record how the files of a folder were made, as its `provenance.json`.

    Parameters
    ----------
    folder : path-like
        The folder. All files below it are recorded with their SHA-256, except those in `cache/`, which can be made
        anew, and hidden files and folders, which a writer that was killed may leave.
    command : str
        The command that made the files.
    seed : int
        The seed that the command ran with.
    packages : tuple of str
        Names of the packages whose versions can change the result.
    **details
        What else a reader should know, such as a date, a duration or scores: whatever JSON can hold.
    """
    folder = Path(folder)
    write_json(
        folder / PROVENANCE,
        {"command": command, "seed": seed, "versions": versions(*packages), **details, "sha256": _checksums(folder)},
    )


def provenance_problems(folder: str | Path) -> list[str]:
    """Compare the files of a folder with its `provenance.json`.

    Parameters
    ----------
    folder : path-like
        A folder with a `provenance.json`.

    Returns
    -------
    list of str
        One line for each file that is missing, changed or not recorded; empty when all is as it was made.
    """
    folder = Path(folder)
    record = folder / PROVENANCE
    expected = read_json(record).get("sha256")
    if not isinstance(expected, dict):
        raise DataError(record, "a provenance file with checksums by file name", repr(expected)[:200])
    found = _checksums(folder)
    changed = sorted(name for name in expected.keys() | found.keys() if expected.get(name) != found.get(name))
    how = {name: "changed" if name in expected else f"not in {PROVENANCE}" for name in found}
    return [f"{folder / name}: {how.get(name, 'missing')}" for name in changed]


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


def short_path(weights: str | Path) -> str:
    """Return the last two parts of a path to weights: the folder, which names the network, and the file.

    Parameters
    ----------
    weights : path-like
        The file.

    Returns
    -------
    str
        Such as "segnet_compact/weights.safetensors".
    """
    return "/".join(Path(weights).resolve().parts[-2:])


def _checksums(folder: Path) -> dict[str, str]:
    files = {path.relative_to(folder): path for path in sorted(folder.rglob("*")) if path.is_file()}
    left_out = (PROVENANCE, "cache")
    return {
        name.as_posix(): sha256(path)
        for name, path in files.items()
        if name.parts[0] not in left_out and not any(part.startswith(".") for part in name.parts)
    }
