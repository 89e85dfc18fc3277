"""Error against time of every way to run mean field: its kernel error and its convergence error (eq. (3), (4)).

Two things separate a result from the fixed point of exact mean field. Its kernel may differ from the Gaussian: the
*kernel error* compares it with the exact kernel after the same number of updates. And it may have been stopped early:
the *convergence error* compares it with the same kernel when nothing changes any more. Both are measured on the shipped
drive, on the compact grid and on crops of the paper's. docs/results/crf_error.json was made by

    PYTHONPATH=.:notebooks python notebooks/worlds/lecture_11_error.py docs/results/crf_error.json
"""

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams, mean_field_naive
from semgrid_edu.datasets.samples import sample_drive, sample_weights
from semgrid_edu.fast import mean_field
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import build_net, load_net
from semgrid_edu.pipeline import Stages, network_image
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table
from worlds.lecture_11_accurate import mean_field_accurate
from worlds.lecture_11_other_ways import mean_field_low_rank

ITERATIONS = (1, 2, 3, 5, 10, 20, 50, 100)
"""Numbers of updates at which each way is timed and compared."""
REFERENCE = "naive"
"""The way with the exact kernel."""
MOST, TOLERANCE = 1000, 1e-5
"""Mean field has converged when no update changes a probability by more than the tolerance, or after 1000 updates."""
RANKS = (64, 256, 512)
"""Numbers of landmarks of the low-rank kernel."""
ROUNDS, ENOUGH = 3, 1.0
"""Calls that take less than this many seconds in all are repeated up to three times; the shortest time counts."""

ERRORS = ("total", "kernel", "convergence")
"""The distance from the converged result with the exact kernel, and its two parts."""

Way = Callable[[NDArray, NDArray, CrfParams, int, float], NDArray]
"""A way to run mean field: takes unary, values, params, iterations and tolerance, and returns Q."""

FRAME, CROP, N_CROPS = 9, 64, 3
"""The frame of the shipped drive, at which the filter has seen one second; rows and columns of a crop, and the number
of crops, one ahead of the other, the first at the vehicle."""


class CrfProblem(NamedTuple):
    """The inputs of the CRF.

    Parameters
    ----------
    unary : (C, H, W) float32
        phi_u of eq. (3).
    values : (4, H, W) float32
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        Weights, widths and normalisation.
    """

    unary: NDArray[np.float32]
    values: NDArray[np.float32]
    params: CrfParams


def crf_scenes(seed: int = 0) -> dict[str, list[CrfProblem]]:
    """Return the grids of the shipped drive, each with the default parameters for the size of its cells.

    The shipped network was trained on the compact grid. It is convolutional, so that it takes the paper's grid as well.
    Its labels there are worse, but we compare only inference.

    Parameters
    ----------
    seed : int
        Seed for the filter's particles.

    Returns
    -------
    dict of str to list of CrfProblem
        "compact grid" (142 x 62 cells) and "64 x 64 crops" of the paper's grid, small enough for all pairs of cells.
    """
    compact, paper = (sample_problem(spec, seed) for spec in (GridSpec.compact(), GridSpec.paper()))
    return {"compact grid": [compact], "64 x 64 crops": crops(paper)}


def sample_problem(spec: GridSpec, seed: int = 0) -> CrfProblem:
    """Return the results of the shipped SegNet and the filter at frame `FRAME` of the shipped drive.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    seed : int
        Seed for the filter's particles.
    """
    drive = sample_drive()
    trained = load_net(sample_weights(), drive.camera)
    net = build_net(replace(trained.need_architecture(), grid=spec), drive.camera)
    net.load_state_dict(trained.state_dict())
    stages = Stages.fast(net.eval(), seed=seed)
    *_, belief = stages.track((drive[k] for k in range(FRAME + 1)), spec)
    o = belief.probability
    image = network_image(drive[FRAME], trained.need_architecture().image_size)
    log_g = stages.fuse(stages.sample(stages.segment(image)), o)
    return CrfProblem(-log_g, o, CrfParams.for_cells(spec.cell))


def crops(problem: CrfProblem) -> list[CrfProblem]:
    """Cut squares out of the middle columns, from the vehicle ahead.

    Parameters
    ----------
    problem : CrfProblem
        A grid of at least `CROP` columns and `N_CROPS` times as many rows.
    """
    _, height, width = problem.unary.shape
    left = (width - CROP) // 2
    squares = [np.s_[:, row - CROP : row, left : left + CROP] for row in height - CROP * np.arange(N_CROPS)]
    return [CrfProblem(problem.unary[square], problem.values[square], problem.params) for square in squares]


def crf_ways(seed: int = 0) -> dict[str, Way]:
    """Return every way to run mean field, by name.

    Parameters
    ----------
    seed : int
        Seed for the landmarks of the low-rank kernels.
    """
    return {
        REFERENCE: mean_field_naive,
        "all pairs": partial(mean_field_accurate, radius=np.inf),
        "accurate": mean_field_accurate,
        "lattice": mean_field,
        **{f"rank {rank}": partial(mean_field_low_rank, rank=rank, seed=seed) for rank in RANKS},
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
        The text of the progress bars.

    Returns
    -------
    dict
        "shape" (C, H, W), "grids" (their number), "reference" (the way with the exact kernel) and "ways": for each way
        the "seconds", and the "total", "kernel" and "convergence" errors, a list each, as long as `ITERATIONS`.
        Errors come from `distance`. "settled", a list of one, is the kernel error when both have converged.
    """
    ways = crf_ways(seed)
    every = [
        {way: _run(infer, problem) for way, infer in tqdm(ways.items(), desc=name, unit="way")} for problem in problems
    ]
    merged = {way: _merged([_errors(runs[way], runs[REFERENCE]) for runs in every]) for way in ways}
    return {"shape": list(problems[0].unary.shape), "grids": len(problems), "reference": REFERENCE, "ways": merged}


def distance(found: NDArray, reference: NDArray) -> dict[str, float]:
    """Compare two results of mean field.

    Parameters
    ----------
    found, reference : (C, H, W) float
        Distributions over the classes in each cell.

    Returns
    -------
    dict of str to float
        "mean" and "max" over the cells of the total variation, 0..1, and "labels", the share of the cells whose most
        probable classes differ.
    """
    variation = np.abs(found - reference).sum(axis=0) / 2
    differ = found.argmax(axis=0) != reference.argmax(axis=0)
    return {"mean": float(variation.mean()), "max": float(variation.max()), "labels": float(differ.mean())}


def _run(infer: Way, problem: CrfProblem) -> dict:
    """Return seconds and Q at each number of updates, and the converged Q."""
    infer(problem.unary[:, :4, :4], problem.values[:, :4, :4], problem.params, 1, 0.0)  # compiles
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
    """Average over grids, but take the largest of each "max"."""

    def over_grids(same: Sequence[dict]) -> dict:
        return {of: float((np.max if of == "max" else np.mean)([one[of] for one in same])) for of in same[0]}

    merged = {"seconds": np.mean([one["seconds"] for one in found], axis=0).tolist()}
    for error in (*ERRORS, "settled"):
        merged[error] = [over_grids(same) for same in zip(*(one[error] for one in found), strict=True)]
    return merged


def crf_error_tables(result: dict, iterations: int = 10) -> str:
    """Return a table per scene: times and errors after some number of updates.

    Parameters
    ----------
    result : dict
        What docs/results/crf_error.json holds.
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
        title = f"{name}, {grid} cells, {iterations} updates, against {scene['reference']}"
        tables.append(f"{title}\n\n{markdown_table(rows)}")
    return "\n\n".join(tables)


def main(out: Path, seed: int = 0) -> None:
    """Measure every scene, write the result and print it.

    Parameters
    ----------
    out : Path
        A JSON file.
    seed : int
        Seed for the particles of the filter and for the landmarks.
    """
    scenes = {name: measure_scene(problems, seed, name) for name, problems in crf_scenes(seed).items()}
    made = made_by("python notebooks/worlds/lecture_11_error.py", "numpy", "scipy", "numba", "torch")
    found = {"seed": seed, "iterations": list(ITERATIONS), "scenes": scenes, **made}
    out.write_text(json.dumps(found, indent=1))
    print(crf_error_tables(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
