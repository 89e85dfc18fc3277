"""CMCDOT on test streets with what is hard for it: wire mesh, hedges, glass, walls coming into view, convoys."""

from itertools import product
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import Cmcdot
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, CmcdotParams, State
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, per_cent
from semgrid_edu.workshop.simulation.drive import PERIOD
from semgrid_edu.workshop.simulation.named_streets import FRAMES, TEST_STREETS, named_street
from semgrid_edu.workshop.simulation.things.materials import Kind
from semgrid_edu.workshop.studies.filter.cell_scores import FAR, NEAR, SCENERY, SETTLED_AFTER, share
from semgrid_edu.workshop.studies.filter.detection_latency import DetectionLatency
from semgrid_edu.workshop.studies.filter.occupancy import GRIDS, check_request, simulated_by
from semgrid_edu.workshop.studies.filter.scenes import KnownScene, hit_cells, known_scenes

LEAST_DYNAMIC = 0.3
"""A phantom is a standing cell that is more DYNAMIC than STATIC, with more than this probability of DYNAMIC."""
LEAST_CELLS = 60
"""Number of hit cells of scenery from which on a frame is looked at for the worst frame."""
CARS_AFTER, OTHERS_AFTER = 0.8, 1.5
"""Time, seconds, after which a filter should have found a car that moves in view; and a pedestrian, or any speed."""
_LOW, _AHEAD, _RIGHT = 0.7, (2.0, 40.0), -2.0


class StreetScores:
    """Counts over the frames of a street's drives, for one filter.

    What stands is scored from `SETTLED_AFTER` on, from 2 to 40 m ahead and from 2 m to the right, in cells with
    two returns or more between 0.7 and 1.6 m above the flat ground. What moves is scored in the hit cells of the
    `KnownScene`, up to 50 m away.

    Parameters
    ----------
    spec : GridSpec
        The grid of the frames.

    Attributes
    ----------
    cells : dict of str to [int, int]
        For each group of cells their number, and the number of those called DYNAMIC; in "left", called occupied.
    frames : list of (int, int)
        For each frame: hit cells of scenery, and phantoms among them.
    speed_errors : list of float
        For each car and each frame, `OTHERS_AFTER` in view: | |mean velocity in its hit cells| - its speed |, m/s.
    latency : DetectionLatency
        When each thing that moves is found.
    """

    def __init__(self, spec: GridSpec) -> None:
        self.spec, self.latency = spec, DetectionLatency()
        self.cells: dict[str, list[int]] = {}
        self.frames: list[tuple[int, int]] = []
        self.speed_errors: list[float] = []

    def add(self, scene: KnownScene, belief: Belief) -> None:
        """Score one frame.

        Parameters
        ----------
        scene : KnownScene
            What is true.
        belief : Belief
            What the filter says.
        """
        p = belief.probability
        moves = p[State.DYNAMIC] > p[State.STATIC]
        self.latency.add(scene, moves)
        if scene.frame.time >= SETTLED_AFTER:
            self._add_standing(scene, moves & (p[State.DYNAMIC] > LEAST_DYNAMIC))
        self._add_moving(scene, moves, belief.velocity)
        self._count("left", scene.left, p[State.STATIC] + p[State.DYNAMIC] > 0.5)

    def _count(self, name: str, cells: NDArray, called: NDArray) -> None:
        count = self.cells.setdefault(name, [0, 0])
        count[0] += int(cells.sum())
        count[1] += int((cells & called).sum())

    def _add_standing(self, scene: KnownScene, called: NDArray) -> None:
        """Count what stands, and what of it is a phantom."""
        truth, (x, y) = scene.truth, np.moveaxis(self.spec.centers(), -1, 0)
        hit = hit_cells(scene.frame.points_grid, self.spec, low=_LOW)
        stands = hit & (truth.state == State.STATIC) & (x > _AHEAD[0]) & (x < _AHEAD[1]) & (y < _RIGHT)
        scenery = stands & np.isin(truth.kind, list(SCENERY))
        self._count("scenery", scenery, called)
        self.frames.append((int(scenery.sum()), int((scenery & called).sum())))
        for kind, name in {**SCENERY, Kind.CAR: "standing cars"}.items():
            self._count(name, stands & (truth.kind == kind), called)

    def _add_moving(self, scene: KnownScene, moves: NDArray, velocity: NDArray) -> None:
        """Count what moves, and note the speed of each car."""
        truth, distance = scene.truth, self.spec.distances()
        moving = scene.hit & (truth.state == State.DYNAMIC) & (distance < FAR)
        cars, walkers = (moving & (truth.kind == kind) for kind in (Kind.CAR, Kind.PEDESTRIAN))
        self._count("moving cars", cars & np.isin(truth.instance, self.latency.in_view_for(scene, CARS_AFTER)), moves)
        settled = self.latency.in_view_for(scene, OTHERS_AFTER)
        for name, range_ in (("walkers, near", distance < NEAR), ("walkers, far", distance >= NEAR)):
            self._count(name, walkers & range_ & np.isin(truth.instance, settled), moves)
        for number in np.intersect1d(truth.instance[cars], settled):
            cells = cars & (truth.instance == number) & np.isfinite(velocity[0])
            if cells.any():
                speed, true_speed = (np.hypot(*v[:, cells].mean(axis=1)) for v in (velocity, truth.velocity))
                self.speed_errors.append(float(abs(speed - true_speed)))

    def summary(self) -> dict[str, object]:
        """Return all scores.

        Returns
        -------
        dict
            JSON can hold it. A share of no cells is None.
        """
        errors = np.array(self.speed_errors)
        return {
            "cells": {name: {"cells": n, "called": share(part, n)} for name, (n, part) in self.cells.items()},
            "worst frame": max((part / n for n, part in self.frames if n >= LEAST_CELLS), default=None),
            "speed error": {
                "cases": len(errors),
                "median": float(np.median(errors)) if len(errors) else None,
                "within 1.5 m/s": share(int((errors < 1.5).sum()), len(errors)),
            },
            **self.latency.summary(),
        }


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
    began = perf_counter()
    check_request(seed, drives, frames, grids)
    if not streets or not set(streets) <= set(TEST_STREETS):
        raise ArgumentError("streets", " or ".join(TEST_STREETS), ", ".join(streets) or "none")
    scores: dict[str, dict] = {grid: {} for grid in grids}
    for grid, street in product(grids, streets):
        spec, counts = GRIDS[grid], StreetScores(GRIDS[grid])
        for number in range(1000 * seed, 1000 * seed + drives):
            drive, tracker = named_street(street, number, frames), Cmcdot(spec, params or CmcdotParams(), seed=seed)
            counts.latency.begin(drive.moving)
            for scene in known_scenes(drive, spec, f"{street}, {grid} grid, drive {number}"):
                counts.add(scene, tracker.step(scene.frame.points_grid, scene.motion, PERIOD))
            counts.latency.end()
        scores[grid][street] = counts.summary()
    return {"scores": scores, **simulated_by("streets", seed, drives, frames, grids, began)}


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
        groups = [one["cells"].get(name, {"cells": 0, "called": None}) for name in ("scenery", *kinds)]
        scenery, *others = (per_cent(group["called"]) for group in groups)
        rows.append([street, str(groups[0]["cells"]), scenery, per_cent(one["worst frame"]), *others])
    return rows


def _moving(scores: dict[str, dict]) -> list[list[str]]:
    """Return the rows of the table about what moves, streets without anything that moves left out."""
    rows = [["moves", "cars DYNAMIC", "speed right", "cars found after", "walkers DYNAMIC, to 25 m", "to 50 m"]]
    rows[0] += ["walkers found after", "next car within 0.5 s", "left, still occupied"]
    for street, one in scores.items():
        if not any(one["found after"].values()):
            continue
        of = {name: per_cent(cells["called"]) for name, cells in one["cells"].items()}
        cars, walkers = (_median(times) for times in one["found after"].values())
        delays, speed = one["found after the car ahead"], per_cent(one["speed error"]["within 1.5 m/s"])
        soon = f"{sum(t is not None and t <= 0.5 for t in delays)} of {len(delays)}" if delays else "-"
        near, far = of["walkers, near"], of["walkers, far"]
        rows.append([street, of["moving cars"], speed, cars, near, far, walkers, soon, of["left"]])
    return rows


def _median(times: list[float | None]) -> str:
    """Return the median of times with its unit; what was never found counts as infinitely late."""
    median = np.median([np.inf if time is None else time for time in times]) if times else np.nan
    return f"{median:.1f} s" if np.isfinite(median) else "never" if times else "-"
