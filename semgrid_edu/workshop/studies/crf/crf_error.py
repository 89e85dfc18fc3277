"""Error against time of every way to run mean field, kernel error and convergence error told apart (eq. (3), (4)).

Two things separate a result from the fixed point of exact mean field. Its kernel may differ from the Gaussian: the
*kernel error* compares it with the exact kernel after the same number of updates. And it may have been stopped early:
the *convergence error* compares it with the same kernel when nothing changes any more.
"""

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams, mean_field, mean_field_accurate, mean_field_naive
from semgrid_edu.errors import ArgumentError
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import versions
from semgrid_edu.storage.reading import resumable_json
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table
from semgrid_edu.workshop.studies.crf.crf_scenes import CrfProblem, crf_scenes
from semgrid_edu.workshop.studies.crf.nystrom import mean_field_low_rank

ITERATIONS = (1, 2, 3, 5, 10, 20, 50, 100)
"""Numbers of updates at which each way is timed and compared."""
MOST, TOLERANCE = 1000, 1e-5
"""Converged: no update changes a probability by more than this, or so many updates have been made."""
RANKS = (64, 256, 512)
"""Numbers of landmarks of the low-rank kernel."""
ROUNDS, ENOUGH = 3, 1.0
"""Calls that take less than this many seconds in all are repeated up to three times; the shortest time counts."""

ERRORS = ("total", "kernel", "convergence")
"""What is told apart: the distance from the exact kernel, converged; and its two parts."""

Way = Callable[[NDArray, NDArray, CrfParams, int, float], NDArray]
"""A way to run mean field: takes unary, values, params, iterations and tolerance, and returns Q."""


def crf_ways(seed: int = 0) -> dict[str, Way]:
    """Return every way to run mean field, by name, the one with the exact kernel first.

    Parameters
    ----------
    seed : int
        Seed for the landmarks of the low-rank kernels.

    Returns
    -------
    dict of str to callable
    """
    return {
        "naive": mean_field_naive,
        "all pairs": partial(mean_field_accurate, radius=np.inf),
        "accurate": mean_field_accurate,
        "lattice": mean_field,
        **{f"rank {rank}": partial(mean_field_low_rank, rank=rank, seed=seed) for rank in RANKS},
    }


def crf_error(log: str | Path, seed: int = 0, scenes: Mapping[str, Sequence[CrfProblem]] | None = None) -> dict:
    """Measure error and time of every way on every scene.

    Parameters
    ----------
    log : path-like
        Takes each scene as soon as it is done. If the file exists, scenes that it holds aren't measured again.
    seed : int
        Seed for the particles of the filter and for the landmarks.
    scenes : mapping of str to sequence of CrfProblem, optional
        What to measure on; `crf_scenes` when left out.

    Returns
    -------
    dict
        "scenes": by name from `measure_scene`; and all that made them. JSON can hold it.

    Raises
    ------
    ArgumentError
        When the seed is negative.
    DataError
        When the log is something else, or was begun with another seed.
    """
    if seed < 0:
        raise ArgumentError("seed", "a whole number from 0 up", seed)
    identity = {"seed": seed, "iterations": list(ITERATIONS)}
    done = resumable_json(log, identity, "scenes")
    for name, problems in (scenes or crf_scenes(seed)).items():
        if name not in done:
            done[name] = measure_scene(problems, seed, name)
            write_json(log, identity | {"scenes": done})
    return identity | {
        "scenes": done,
        "command": f"semgrid-edu reproduce crf-error --seed {seed}",
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "versions": versions("numpy", "scipy", "numba", "torch"),
    }


def measure_scene(problems: Sequence[CrfProblem], seed: int = 0, name: str = "") -> dict:
    """Measure error and time of every way on some grids of the same shape.

    Parameters
    ----------
    problems : sequence of CrfProblem
        The grids. Times and errors are averaged over them; of largest errors the largest is kept.
    seed : int
        Seed for the landmarks of the low-rank kernels.
    name : str
        What the progress bar says.

    Returns
    -------
    dict
        "shape" (C, H, W), "grids" (their number), "reference" (the way with the exact kernel) and "ways": for each way
        the "seconds", and the "total", "kernel" and "convergence" errors, a list each, as long as `ITERATIONS`.
        Errors are those of `distance`. "settled", a list of one, is the kernel error when both have converged.
    """
    shape, found = problems[0].unary.shape, []
    ways = crf_ways(seed)
    with tqdm(total=len(problems) * len(ways), desc=name, unit="way") as bar:
        for problem in problems:
            runs = {}
            for way, infer in ways.items():
                runs[way] = _run(infer, problem)
                bar.update()
            exact = next(iter(runs.values()))
            found.append({way: _errors(run, exact) for way, run in runs.items()})
    merged = {way: _merged([one[way] for one in found]) for way in ways}
    return {"shape": list(shape), "grids": len(problems), "reference": next(iter(ways)), "ways": merged}


def distance(found: NDArray, reference: NDArray) -> dict[str, float]:
    """Compare two results of mean field.

    Parameters
    ----------
    found, reference : (C, H, W) float
        Distributions over the classes in each cell.

    Returns
    -------
    dict
        "mean" and "max" over the cells of the total variation, 0..1, and "labels", the share of the cells whose most
        probable classes differ.
    """
    variation = np.abs(found - reference).sum(axis=0) / 2
    differ = found.argmax(axis=0) != reference.argmax(axis=0)
    return {"mean": float(variation.mean()), "max": float(variation.max()), "labels": float(differ.mean())}


def _run(infer: Way, problem: CrfProblem) -> dict:
    """Return seconds and Q at each number of updates, and the converged Q."""
    corner = CrfProblem(*(a[:, :4, :4] for a in problem[:2]), problem.params)
    infer(*corner, 1, 0.0)  # compiles
    seconds, Q = zip(*(_timed(lambda n=n: infer(*problem, n, 0.0)) for n in ITERATIONS), strict=True)
    return {"seconds": seconds, "Q": Q, "settled": infer(*problem, MOST, TOLERANCE)}


def _timed(call: Callable[[], NDArray]) -> tuple[float, NDArray]:
    seconds: list[float] = []
    while len(seconds) < ROUNDS and sum(seconds) < ENOUGH:
        began = perf_counter()
        Q = call()
        seconds.append(perf_counter() - began)
    return min(seconds), Q


def _errors(run: dict, exact: dict) -> dict:
    """Return the seconds and the three errors of a run."""
    return {
        "seconds": list(run["seconds"]),
        "total": [distance(Q, exact["settled"]) for Q in run["Q"]],
        "kernel": [distance(Q, other) for Q, other in zip(run["Q"], exact["Q"], strict=True)],
        "convergence": [distance(Q, run["settled"]) for Q in run["Q"]],
        "settled": [distance(run["settled"], exact["settled"])],
    }


def _merged(found: Sequence[dict]) -> dict:
    """Average over grids; of "max" take the largest."""
    return {
        "seconds": np.mean([one["seconds"] for one in found], axis=0).tolist(),
        **{
            error: [
                {of: float((np.max if of == "max" else np.mean)([e[of] for e in same])) for of in same[0]}
                for same in zip(*(one[error] for one in found), strict=True)
            ]
            for error in (*ERRORS, "settled")
        },
    }


def crf_error_tables(result: dict, iterations: int = 10) -> str:
    """Return a table per scene: times and errors after some number of updates.

    Parameters
    ----------
    result : dict
        From `crf_error`, or from the JSON file that it was written to.
    iterations : int
        One of `ITERATIONS`.

    Returns
    -------
    str
        Mean total variations and shares of labels that differ, per cent.
    """
    k, tables = result["iterations"].index(iterations), []
    for name, scene in result["scenes"].items():
        rows = [["", "ms", *(f"{e}: mean TV %" for e in ERRORS), *(f"{e}: labels %" for e in ERRORS)]]
        for way, found in scene["ways"].items():
            errors = [f"{100 * found[e][k][of]:.4f}" for of in ("mean", "labels") for e in ERRORS]
            rows.append([way, f"{1000 * found['seconds'][k]:.1f}", *errors])
        grid = " x ".join(map(str, scene["shape"][1:]))
        tables.append(
            f"{name}, {grid} cells, {iterations} updates, against {scene['reference']}\n\n{markdown_table(rows)}"
        )
    return "\n\n".join(tables)
