"""CMCDOT on test streets with what is hard for it: wire mesh, hedges, glass, walls coming into view, convoys."""

from datetime import UTC, datetime

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.experiments.occupancy import GRIDS
from semgrid_edu.experiments.scenes import known_scenes
from semgrid_edu.experiments.street_scores import StreetScores
from semgrid_edu.occupancy import Cmcdot, CmcdotParams, SensorModel
from semgrid_edu.simulation.drive import PERIOD
from semgrid_edu.simulation.test_streets import FRAMES, TEST_STREETS, named_street
from semgrid_edu.storage.provenance import versions


def measure_streets(
    seed: int = 0,
    drives: int = 4,
    grids: tuple[str, ...] = tuple(GRIDS),
    streets: tuple[str, ...] = TEST_STREETS,
    frames: int = FRAMES,
    params: CmcdotParams | None = None,
) -> dict[str, object]:
    """Run CMCDOT over drives through the test streets, and score it.

    Parameters
    ----------
    seed : int
        Seed for the drives and for the particles.
    drives : int
        Number of drives through each street, at least one.
    grids : tuple of str
        "paper", "compact" or both.
    streets : tuple of str
        Of `TEST_STREETS`.
    frames : int
        Number of frames of each drive, ten a second, at least one.
    params : CmcdotParams, optional
        The filter's parameters; its defaults when left out.

    Returns
    -------
    dict
        "scores" by grid and street (see `StreetScores.summary`), and all that made them; JSON can hold it.

    Raises
    ------
    ArgumentError
        When there is no such grid or street, or nothing to do.
    """
    began = datetime.now(UTC)
    if not grids or not set(grids) <= set(GRIDS):
        raise ArgumentError("grid", " or ".join(GRIDS), ", ".join(grids) or "none")
    if seed < 0:
        raise ArgumentError("seed", "a whole number from 0 up", seed)
    if min(drives, frames) < 1:
        raise ArgumentError("drives, frames", "at least one", f"{drives}, {frames}")
    params = params or CmcdotParams()
    scores = {
        grid: {street: _score(seed, drives, frames, grid, street, params) for street in streets} for grid in grids
    }
    return {
        "scores": scores,
        "drives": drives,
        "frames": frames,
        "command": f"semgrid-edu reproduce streets --seed {seed} --drives {drives}"
        + (f" --grid {grids[0]}" if len(grids) == 1 else ""),
        "seed": seed,
        "date": f"{began:%Y-%m-%d}",
        "minutes": round((datetime.now(UTC) - began).total_seconds() / 60, 1),
        "versions": versions("numpy", "scipy", "numba", "embreex", "trimesh"),
    }


def _score(seed: int, drives: int, frames: int, grid: str, street: str, params: CmcdotParams) -> dict[str, object]:
    """Score the filter on all drives through one street."""
    spec, scores = GRIDS[grid], StreetScores(GRIDS[grid])
    for number in 1000 * seed + np.arange(drives):
        drive, tracker = named_street(street, int(number), frames), Cmcdot(spec, params, seed=seed)
        scores.begin(drive.moving)
        for scene in known_scenes(drive, spec, SensorModel(), f"{street}, {grid} grid, drive {number}"):
            scores.add(scene, tracker.step(scene.frame.points_grid, scene.motion, PERIOD))
        scores.end()
    return scores.summary()
