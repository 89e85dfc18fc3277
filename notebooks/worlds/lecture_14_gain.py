"""The gain from the memory of classes, in cells that are in view, were seen before, or were never seen (section 3).

Simulated streets have true labels in every cell; the labelled returns of a real scene are scored beside them. The
second part measures what one more frame is worth at each distance from the vehicle (`worth_by_distance`). In the folder
notebooks, `python -m worlds.lecture_14_gain PANDASET ../docs/results/memory.json --drives 12` measures all.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.special import softmax
from tqdm.auto import tqdm

from semgrid_edu.datasets.pandaset import CAMERAS, PandasetScene
from semgrid_edu.datasets.samples import sample_drive, sample_weights, segnet_real_weights
from semgrid_edu.fast import load_net
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE
from semgrid_edu.memory import MemoryParams, View, remember_drive, smooth_drive
from semgrid_edu.occupancy import PlanarMotion
from semgrid_edu.occupancy.planar_motion import look_up
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.simulation import simulate
from semgrid_edu.workshop.simulation.sensors.rig import KITTI_AHEAD
from worlds.lecture_04_scenes import labelled_frame
from worlds.lecture_14_counts import MEMORY, ONE, SMOOTHED, GainCounts, memory_tables

HELD_OUT = 1400
"""Seed of the first drive for seed 0; each further seed adds 1000. The memory's parameters are from other drives."""

FRAMES = 20
"""Number of frames of a simulated drive, 2 s."""

BLOCK = 2.0
"""Seconds of one camera of the real scene that count as one drive: neighbouring frames look alike."""

LAST = 5
"""Number of maps that are joined: half a second."""

FAINTEST = 1e-4
"""Probability that a product takes in place of a smaller one, so that one frame alone can't forbid a class for ever."""


def last_maps(views: Iterable[View], spec: GridSpec, join: Callable, moved: bool = True) -> Iterator[NDArray]:
    """Combine the last maps: a simple baseline.

    Parameters
    ----------
    views, spec : iterable of View, GridSpec
        As `Stages.remember` takes them.
    join : callable
        What to make of the last maps, (K, C, H, W), in the cells of now; NaN where a map didn't reach.
    moved : bool
        Whether to compensate the vehicle's motion. Otherwise maps are combined cell by cell, as if it were stopped.
    """
    last: deque[View] = deque(maxlen=LAST)
    for view in views:
        last.append(view)
        yield join(np.stack([_seen_from(view, earlier, spec) if moved else earlier.grid for earlier in last]))


def _seen_from(now: View, earlier: View, spec: GridSpec) -> NDArray:
    motion = PlanarMotion.from_poses(earlier.frame.T_world_from_lidar, now.frame.T_world_from_lidar)
    return look_up(earlier.grid, np.full(len(earlier.grid), np.nan, np.float32), spec, spec, motion)


def _product(maps: NDArray) -> NDArray:
    return softmax(np.nansum(np.log(np.maximum(maps, FAINTEST)), axis=0), axis=0)


CRF = " + CRF"
"""The suffix of a method's name when the CRF comes after it."""

FIRST = {
    "mean of five maps, not moved": partial(last_maps, join=partial(np.nanmean, axis=0), moved=False),
    "mean of five maps": partial(last_maps, join=partial(np.nanmean, axis=0)),
    "product of five maps": partial(last_maps, join=_product),
}
"""Simple baselines, by name."""


def grids_of(frames: Sequence[Frame], weights: Path) -> tuple[list[View], list[dict[str, NDArray]]]:
    """Send a drive through the stages, and return its views, and what each method makes of its frames, by name.

    Parameters
    ----------
    frames : sequence of Frame
        The frames in the order of time.
    weights : Path
        Those of the network.
    """
    stages = Stages.fast(load_net(weights, frames[0].camera), memory=True)
    results = list(run_pipeline(frames, stages))
    views = [View(result.frame, result.belief, result.grid) for result in results]
    methods = {MEMORY: [result.remembered for result in results]}
    methods |= {
        name: list(of(views, stages.architecture.grid)) for name, of in (FIRST | {SMOOTHED: smooth_drive}).items()
    }
    found = [{ONE: result.grid, f"{ONE}{CRF}": result.refined} for result in results]
    for name, maps in methods.items():
        for of_frame, view, one in zip(found, views, maps, strict=True):
            of_frame[name] = one
            of_frame[f"{name}{CRF}"] = stages.refine(np.log(np.maximum(one, 1e-6)), view.belief.probability)
    return views, found


def measure_memory(pandaset: str | Path, scene: str = "002", seed: int = 0, drives: int = 20) -> dict[str, object]:
    """Score the memory of classes beside one frame and beside what one would try first.

    Parameters
    ----------
    pandaset, scene : path-like, str
        As `PandasetScene` takes them.
    seed : int
        Seed for the simulated drives.
    drives : int
        Number of simulated drives, at least one.

    Returns
    -------
    dict
        "scores": for fresh simulated streets, for the sample drive, and for the real scene with two networks, by group
        of cells; "worth": what one more frame is worth on the fresh streets; and all that made them. JSON can hold it.
    """
    began = perf_counter()
    spec = GridSpec.compact()
    blocks = [block for camera in CAMERAS for block in real_blocks(PandasetScene(pandaset, scene, camera))]
    simulated = (_simulated(number) for number in range(HELD_OUT + 1000 * seed, HELD_OUT + 1000 * seed + drives))
    fresh, views = _scored(simulated, sample_weights(), spec)
    scores = {
        "fresh simulated streets": fresh,
        "sample drive": _scored([list(sample_drive())], sample_weights(), spec)[0],
        "real street, network from simulated streets": _scored(blocks, sample_weights(), spec)[0],
        "real street, network that learned from its frames": _scored(blocks, segnet_real_weights(), spec)[0],
    }
    worth = _worth(views, spec)
    command = f"python -m worlds.lecture_14_gain PANDASET OUT --scene {scene} --seed {seed} --drives {drives}"
    made = made_by(command, "numpy", "torch", "numba", "embreex", "trimesh")
    minutes = round((perf_counter() - began) / 60, 1)
    return {"scores": scores, "worth": worth, "drives": drives, "minutes": minutes, **made}


def _simulated(number: int) -> list[Frame]:
    drive = simulate(number, FRAMES, rig=KITTI_AHEAD)
    return [labelled_frame(drive, k) for k in range(FRAMES)]


def real_blocks(frames: Iterable[Frame]) -> list[list[Frame]]:
    """Cut the frames of a camera into blocks of `BLOCK` seconds, each of which is filtered by itself.

    Parameters
    ----------
    frames : iterable of Frame
        The frames in the order of time.
    """
    blocks: list[list[Frame]] = []
    for frame in frames:
        if not blocks or frame.time - blocks[-1][0].time >= BLOCK:
            blocks.append([])
        blocks[-1].append(frame)
    return blocks


def _scored(drives: Iterable[list[Frame]], weights: Path, spec: GridSpec) -> tuple[dict, list[list[View]]]:
    """Return the scores of some drives, and their views without images and returns."""
    counts = GainCounts(spec)
    kept = []
    for frames in tqdm(drives, desc="memory", unit="drive"):
        views, grids = grids_of(frames, weights)
        counts.add(frames, grids)
        kept.append([one._replace(frame=replace(one.frame, image=None, points=one.frame.points[:0])) for one in views])
    return counts.summary(), kept


def _worth(drives: Sequence[Sequence[View]], spec: GridSpec) -> dict[str, object]:
    """Return what one more frame is worth by distance, as JSON can hold it."""
    found = worth_by_distance(drives, spec)
    loss = {str(worth): row.tolist() for worth, row in zip(WORTHS, found.log_loss, strict=True)}
    return {"edges": list(EDGES), "log loss": loss, "cells": found.cells.tolist(), "best": found.best.tolist()}


WORTHS = (0.1, 0.2, 0.35, 0.5, 0.7, 1.0)
"""Exponents to try."""

EDGES = (0.0, 10.0, 20.0, 30.0, 45.0, 75.0)
"""Distances between the bands, metres."""


class WorthByDistance(NamedTuple):
    """How well classes are known with each exponent.

    Parameters
    ----------
    log_loss : (K, B) float64
        Mean of -log P(true class) in cells that the camera sees, nats, by exponent and band of distance.
    cells : (B,) int64
        Number of cells in each band.
    best : (B,) float64
        The exponent with the smallest loss.
    """

    log_loss: NDArray[np.float64]
    cells: NDArray[np.int64]
    best: NDArray[np.float64]


def worth_by_distance(
    drives: Sequence[Sequence[View]], spec: GridSpec, worths: Sequence[float] = WORTHS, edges: Sequence[float] = EDGES
) -> WorthByDistance:
    """Remember drives with one exponent after the other, everywhere the same, and score what the camera sees.

    Parameters
    ----------
    drives : sequence of sequences of View
        What the earlier stages made of the frames of each drive; the frames are labelled.
    spec : GridSpec
        The grid, (H, W) cells.
    worths : (K,) float
        The exponents.
    edges : (B + 1,) float
        Distances between the bands, metres.
    """
    distance = spec.distances()
    loss = np.zeros((len(worths), len(edges) - 1))
    cells = np.zeros(len(edges) - 1, np.int64)
    for k, worth in enumerate(worths):
        params = MemoryParams(near_exponent=worth, decay_distance=1e9)
        for views in drives:
            for view, remembered in zip(views, remember_drive(views, spec, params), strict=True):
                truth = view.frame.labels.birdseye_on(spec)
                seen = view.frame.labels.visible_on(spec) & (truth != IGNORE)
                surprise = -np.log(np.maximum(remembered[truth[seen], *np.nonzero(seen)], 1e-4))
                loss[k] += np.histogram(distance[seen], edges, weights=surprise)[0]
                cells += np.histogram(distance[seen], edges)[0] if k == 0 else 0
    loss /= np.maximum(cells, 1)
    return WorthByDistance(loss, cells, np.array(worths)[loss.argmin(axis=0)])


def main(pandaset: Path, out: Path, scene: str = "002", seed: int = 0, drives: int = 20) -> None:
    """Measure what memory gains, write the result and print its tables.

    Parameters
    ----------
    pandaset : Path
        The folder of PandaSet's scenes.
    out : Path
        A JSON file.
    scene, seed, drives
        As `measure_memory` takes them.
    """
    result = measure_memory(pandaset, scene, seed, drives)
    write_json(out, result)
    print(memory_tables(result))


if __name__ == "__main__":
    typer.run(main)
