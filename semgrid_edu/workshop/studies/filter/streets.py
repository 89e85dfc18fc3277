"""CMCDOT on test streets with what is hard for it: wire mesh, hedges, glass, walls coming into view, convoys."""

from datetime import UTC, datetime

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.occupancy import Cmcdot, CmcdotParams, SensorModel
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, per_cent
from semgrid_edu.workshop.simulation.drive import PERIOD
from semgrid_edu.workshop.simulation.named_streets import FRAMES, TEST_STREETS, named_street
from semgrid_edu.workshop.studies.filter.cell_scores import SCENERY
from semgrid_edu.workshop.studies.filter.scenes import GRIDS, check_request, known_scenes, made_by
from semgrid_edu.workshop.studies.filter.street_scores import StreetScores

_EMPTY = {"cells": 0, "called": None}


def measure_streets(
    seed: int = 0,
    drives: int = 6,
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
    check_request(seed, drives, frames, grids)
    if not streets or not set(streets) <= set(TEST_STREETS):
        raise ArgumentError("streets", " or ".join(TEST_STREETS), ", ".join(streets) or "none")
    params = params or CmcdotParams()
    scores = {
        grid: {street: _score(seed, drives, frames, grid, street, params) for street in streets} for grid in grids
    }
    return {"scores": scores, **made_by("streets", seed, drives, frames, grids, began)}


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


def streets_tables(result: dict) -> str:
    """Return the tables of a result as Markdown, two for each grid: what stands, and what moves.

    The first says which share of the hit cells of scenery is called DYNAMIC, in the worst frame too and for each kind
    of thing, and of standing cars. The second says which share of the hit cells of moving things is called DYNAMIC; for
    which share of cars and frames the speed is right within 1.5 m/s; the median time until something is found; which
    share of the followers in a convoy is found within 0.5 s of the car ahead; which share of the cells that something
    has left is still called occupied.

    Parameters
    ----------
    result : dict
        From `measure_streets`, or from the JSON file that it was written to.

    Returns
    -------
    str
    """
    return "\n\n".join(
        f"{grid} grid, per cent\n\n{markdown_table(_standing(scores))}\n\n{markdown_table(_moving(scores))}"
        for grid, scores in result["scores"].items()
    )


def _standing(scores: dict[str, dict]) -> list[list[str]]:
    """Return the rows of the table about what stands."""
    kinds = [*SCENERY.values(), "standing cars"]
    rows = [["stands, called DYNAMIC", "cells", "all scenery", "worst frame", *kinds]]
    for street, one in scores.items():
        shares = [per_cent(one["cells"].get(name, _EMPTY)["called"]) for name in ("scenery", *kinds)]
        cells = one["cells"].get("scenery", _EMPTY)["cells"]
        rows.append([street, str(cells), shares[0], per_cent(one["worst frame"]), *shares[1:]])
    return rows


def _moving(scores: dict[str, dict]) -> list[list[str]]:
    """Return the rows of the table about what moves, streets without anything that moves left out."""
    rows = [["moves", "cars DYNAMIC", "speed right", "cars found after", "walkers DYNAMIC, to 25 m", "to 50 m"]]
    rows[0] += ["walkers found after", "next car within 0.5 s", "left, still occupied"]
    for street, one in scores.items():
        if not any(one["found after"].values()):
            continue
        cars, near, far, left = (
            per_cent(one["cells"][name]["called"]) for name in ("moving cars", "walkers, near", "walkers, far", "left")
        )
        waits = {name: _median(times) for name, times in one["found after"].items()}
        delays = one["found after the car ahead"]
        soon = f"{sum(t is not None and t <= 0.5 for t in delays)} of {len(delays)}" if delays else "-"
        speed = per_cent(one["speed error"]["within 1.5 m/s"])
        rows.append([street, cars, speed, waits["cars"], near, far, waits["pedestrians"], soon, left])
    return rows


def _median(times: list[float | None]) -> str:
    """Return the median of times with its unit; what was never found counts as infinitely late."""
    median = np.median([np.inf if time is None else time for time in times]) if times else np.nan
    return f"{median:.1f} s" if np.isfinite(median) else "never" if times else "-"
