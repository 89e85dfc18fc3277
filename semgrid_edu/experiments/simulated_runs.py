"""What experiments on simulated drives have in common: their grids, what may be asked, and what made a result."""

from datetime import UTC, datetime

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.storage.provenance import versions

GRIDS = {"paper": GridSpec.paper(), "compact": GridSpec.compact()}


def check_request(seed: int, drives: int, frames: int, grids: tuple[str, ...]) -> None:
    """Refuse what can't be run, before the work starts.

    Parameters
    ----------
    seed : int
        Seed for the drives and for the particles.
    drives, frames : int
        Number of drives, and number of frames of each.
    grids : tuple of str
        Keys of `GRIDS`.

    Raises
    ------
    ArgumentError
        When there is no such grid, the seed is negative, or there is nothing to do.
    """
    if not grids or not set(grids) <= set(GRIDS):
        raise ArgumentError("grid", " or ".join(GRIDS), ", ".join(grids) or "none")
    if seed < 0:
        raise ArgumentError("seed", "a whole number from 0 up", seed)
    if min(drives, frames) < 1:
        raise ArgumentError("drives, frames", "at least one", f"{drives}, {frames}")


def made_by(
    experiment: str, seed: int, drives: int, frames: int, grids: tuple[str, ...], began: datetime
) -> dict[str, object]:
    """Return what made a result, to be kept with it.

    Parameters
    ----------
    experiment : str
        The command after `semgrid-edu reproduce`.
    seed, drives, frames, grids
        What was asked, as `check_request` takes it.
    began : datetime
        When the work started, UTC.

    Returns
    -------
    dict
        Numbers of drives and frames, command, seed, date, minutes and versions; JSON can hold it.
    """
    one_grid = f" --grid {grids[0]}" if len(grids) == 1 else ""
    return {
        "drives": drives,
        "frames": frames,
        "command": f"semgrid-edu reproduce {experiment} --seed {seed} --drives {drives}{one_grid}",
        "seed": seed,
        "date": f"{began:%Y-%m-%d}",
        "minutes": round((datetime.now(UTC) - began).total_seconds() / 60, 1),
        "versions": versions("numpy", "scipy", "numba", "embreex", "trimesh"),
    }
