"""Ways to train for real streets, scored on held-out labelled returns of a PandaSet scene (section 4).

A scene shows a few seconds of one street corner. Cameras that are left out of training see another side of it; a later
time shows the same side again. Neither shows how well a network does in other streets.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray

from semgrid_edu.datasets.index import DatasetIndex, LabelledFrame
from semgrid_edu.datasets.pandaset import CAMERAS, PandasetScene
from semgrid_edu.datasets.samples import sample_weights
from semgrid_edu.datasets.training_set import Mixture, Sample
from semgrid_edu.fast import TrainingSet, build_net, load_net
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import METRICS
from semgrid_edu.networks import IMAGE_STAGE, WEIGHTS, Architecture, load_imagenet, with_mean_scores
from semgrid_edu.networks.imagenet import INSTALLED
from semgrid_edu.storage.files import check_writable, sha256, table_beside, write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.training.devices import open_fabric
from semgrid_edu.workshop.scoring.calibration import expected_calibration_error, reliability_of_sums
from semgrid_edu.workshop.scoring.confusions import FrameConfusions, GridCounts, count_grids
from semgrid_edu.workshop.scoring.grids import NETWORK, crf_refinement, majority_by_state, network_grids
from semgrid_edu.workshop.scoring.score_with_interval import (
    compared,
    markdown_table,
    on_cells,
    per_cent,
    score_with_interval,
    shown,
)

if TYPE_CHECKING:
    from lightning_fabric import Fabric


class WayToTrain(NamedTuple):
    """One way to train for real streets.

    Parameters
    ----------
    architecture : Architecture
        The network to train from fresh weights, if the way doesn't start from a shipped one.
    start : str, optional
        The image network of the shipped compact network to start from.
    mean_of : str, optional
        The way whose image networks, one for each seed, score images together; the fusion network alone learns.
    params : TrainingParams, optional
        How to train it; None to score the initial network.
    imagenet : bool
        Whether the image network starts from the installed ImageNet weights.
    with_simulated : bool
        Whether every other training step uses frames of simulated streets.
    fill_gaps : bool
        Whether cells far from any label are learned as unknown, see `TrainingSet.with_gaps_filled`.
    """

    architecture: Architecture
    start: str | None = None
    mean_of: str | None = None
    params: TrainingParams | None = None
    imagenet: bool = False
    with_simulated: bool = False
    fill_gaps: bool = False


def _way(architecture: dict | None = None, training: dict | None = None, **fields) -> WayToTrain:
    """Return the way described by a row of the table beside this file."""
    params = None if training is None else TrainingParams(**training)
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in (architecture or {}).items()}
    return WayToTrain(Architecture(**values), params=params, **fields)


TABLE = table_beside(__file__)
WAYS = {name: _way(**row) for name, row in TABLE["ways"].items()}
"""The ways to train, by name, from the table beside this file."""

LEFT_OUT, LATER = "each pair of cameras left out", "later"
"""The splits: by camera, in as many rounds as there are pairs, and in time, in one round."""

STATE_TABLE = "occupancy state alone"
"""The baseline that a network must beat: the most frequent class of each state in the training frames."""

BLOCK = 2.0
"""Seconds of one camera that count as one drive in an interval: neighbouring frames look alike."""

Part = tuple[TrainingSet, list[int]]
Round = tuple[list[Part], list[Part]]
Counted = dict[str, list[tuple[str, GridCounts]]]
"""A part: frames of one camera, and the numbers of those that are meant. A round: what is learned from, what is scored.
Counted: for each method and camera what the method is called in the counts, and the counts."""


def compare_real(
    root: str | Path, scene: str, simulated: str | Path, runs: str | Path, seed: int = 0, device: str = "cpu"
) -> dict[str, object]:
    """Train networks on one part of a scene in each of `WAYS`, and score them on the other part, for two splits.

    The split by camera has a round for each pair of cameras: a network that hasn't learned from them is scored on them.
    A cell counts if it is in view of the camera and contains a labelled return of the frame's own scan. Networks are
    trained on the returns of the neighbouring scans too.

    Parameters
    ----------
    root, scene : path-like, str
        As `PandasetScene` takes them.
    simulated : path-like
        The data set of simulated streets that some ways learn from as well, such as data/minikitti.
    runs : path-like
        Takes a folder per scene, which holds one folder per training run, and the arrays that are made of the frames. A
        run that has ended isn't repeated, and one that was interrupted is resumed.
    seed : int
        First seed for initial weights and for the order of the frames; `TABLE["seeds"]` networks learn in each way.
    device : str
        "cpu", "cuda", "cuda:N" or "auto", where networks learn; they are scored on the CPU.

    Returns
    -------
    dict
        "scores": by split and method both accuracies with intervals over seeds and blocks of two seconds, each also as
        "above the table" of occupancy states, recalls, pixel accuracies by camera, and "ECE"; and what made them.

    Raises
    ------
    ArgumentError
        When the seed is negative, or there is no such device.
    DataError
        When there is no such scene, it lacks a camera or labels, or a file is damaged.
    """
    fabric = open_fabric(device)
    runs = Path(runs) / scene
    sizes = {Architecture.image_size, *map(image_size_of, WAYS)}
    of_size = {size: splits(open_views(root, scene, runs, size)) for size in sizes}
    simulated_sizes = {image_size_of(name) for name, way in WAYS.items() if way.with_simulated}
    streets = {size: TrainingSet.by_camera(simulated, "train", image_size=size) for size in simulated_sizes}
    found = {}
    weights = {}
    seeds = range(seed, seed + TABLE["seeds"])
    for split, usual in of_size[Architecture.image_size].items():
        table = _joined(_count_states(*one) for one in usual)[STATE_TABLE]
        found[split] = {STATE_TABLE: _scores_of([table], table)}
        for name in TABLE["later"] if split == LATER else WAYS:
            counted = []
            rounds = of_size[image_size_of(name)][split]
            tests = [test for _, test in rounds]
            for k in seeds if WAYS[name].params else seeds[:1]:
                files = _networks(name, rounds, streets, runs / split, seeds, k, fabric)
                weights |= {run: sha256(file) for run, file in files.items()}
                counted.append(_joined(_count(name, *one) for one in zip(files.values(), tests, strict=True)))
            found[split] |= {method: _scores_of([one[method] for one in counted], table) for method in counted[0]}
    command = "python -m worlds.lecture_08_real_streets PANDASET MINIKITTI RUNS OUT"
    command += f" --scene {scene} --seed {seed} --device {device}"
    return {"scores": found, "weights": weights, "seed": seed, **made_by(command, "numpy", "torch", "numba")}


def image_size_of(name: str) -> tuple[int, int]:
    """Return the size of the images that a way's networks see.

    Parameters
    ----------
    name : str
        A key of `WAYS`.
    """
    return WAYS[WAYS[name].mean_of or name].architecture.image_size


def open_views(
    root: str | Path, scene: str, runs: Path, image_size: tuple[int, int] = Architecture.image_size
) -> dict[str, TrainingSet]:
    """Open the frames of every camera, by its name.

    Parameters
    ----------
    root, scene : path-like, str
        As `PandasetScene` takes them.
    runs : Path
        Takes the arrays that are made of the frames.
    image_size : (int, int)
        Height and width to which images are resized, pixels.
    """
    drives = {camera: PandasetScene(root, scene, camera) for camera in CAMERAS}  # before any is read: all are needed
    check_writable(runs / "run")
    return {camera: open_frames(drive, runs, image_size) for camera, drive in drives.items()}


def splits(views: dict[str, TrainingSet]) -> dict[str, list[Round]]:
    """Return the frames to learn from and those to score on, in each round, by the name of the split.

    Parameters
    ----------
    views : dict of str to TrainingSet
        The frames of each camera.

    Returns
    -------
    dict of str to list of (list of Part, list of Part)
        Training and test frames, camera by camera.
    """
    whole = {camera: (frames, list(range(len(frames)))) for camera, frames in views.items()}
    first = [(frames, ks[: round(TABLE["learnt"] * len(ks))]) for frames, ks in whole.values()]
    last = [(frames, ks[round((TABLE["learnt"] + TABLE["skipped"]) * len(ks)) :]) for frames, ks in whole.values()]
    rounds = [
        ([part for camera, part in whole.items() if camera not in pair], [whole[camera] for camera in pair])
        for pair in TABLE["left_out"]
    ]
    return {LEFT_OUT: rounds, LATER: [(first, last)]}


def open_frames(
    drive: PandasetScene, folder: Path, image_size: tuple[int, int] = Architecture.image_size
) -> TrainingSet:
    """Open all frames of a camera; "true" is what the returns of each scan alone say of the cells in view.

    Parameters
    ----------
    drive : PandasetScene
        The camera's drive.
    folder : Path
        Takes the arrays that are made of the frames.
    image_size : (int, int)
        Height and width to which images are resized, pixels.
    """
    root = drive.folder.parent
    scene = drive.folder.name
    camera = drive.view.name
    listed = tuple(LabelledFrame((scene, camera), k) for k in range(len(drive)))
    index = DatasetIndex(root, f"pandaset-{scene}", KITTI_14, {camera: listed}, PandasetScene, folder)
    frames = TrainingSet(index, camera, image_size=image_size)
    spec = frames.spec
    ignored = np.uint8(IGNORE)
    own = [np.where(drive.undecided(k, spec), drive.truth(k, spec, 0, 0), ignored) for k in range(len(drive))]
    frames.arrays["true"] = np.stack(own)
    frames.drives = tuple(f"{camera}, {int(frame.time / BLOCK)}" for frame in drive)
    return frames


class _Subset(TrainingSet):
    """Some frames of a training set, by number."""

    def __init__(self, frames: TrainingSet, numbers: list[int]) -> None:
        self.__dict__ |= frames.__dict__
        self.drives = tuple(frames.drives[k] for k in numbers)
        self.arrays = {name: frames.arrays[name][numbers] for name in (*Sample._fields, "true")}


def _networks(
    name: str,
    rounds: list[Round],
    streets: dict[tuple[int, int], list[TrainingSet]],
    split: Path,
    seeds: range,
    k: int,
    fabric: "Fabric",
) -> dict[str, Path]:
    """Return the files of the weights that are learned in each round with seed k, by the names of their runs."""
    way = WAYS[name]
    files = {}
    for r, (training, _) in enumerate(rounds):
        of_runs = [split.with_name(f"{split.name} {r}, {way.mean_of}, {s}") / IMAGE_STAGE for s in seeds if way.mean_of]
        starts = of_runs or ([sample_weights(way.start)] if way.start else [])
        folder = split.with_name(f"{split.name} {r}, {name}, {k}")
        if way.params and not (folder / WEIGHTS).exists():
            simulated = [streets[image_size_of(name)]] if way.with_simulated else []
            parts = [_Subset(*part) for part in training]
            if way.fill_gaps:
                parts = [part.with_gaps_filled() for part in parts]
            mixture = Mixture([parts, *simulated])
            _train(way, starts, mixture, folder, k, fabric)
        files[folder.name] = folder / WEIGHTS if way.params else starts[0]
    return files


def _train(way: WayToTrain, starts: list[Path], mixture: Mixture, folder: Path, seed: int, fabric: "Fabric") -> None:
    """Train a network, or go on where an interrupted run was."""
    nets = [load_net(start, mixture.camera) for start in starts]
    net = with_mean_scores(nets or [build_net(way.architecture, mixture.camera, seed)])
    if way.imagenet:
        load_imagenet(net.segmenter, INSTALLED)
    params = replace(way.params, batch_size=min(way.params.batch_size, *map(len, mixture.parts)))
    train(net, mixture, folder, params, seed, resume=True, fabric=fabric)


def _count(name: str, weights: Path, test: list[Part]) -> Counted:
    """Count the errors of a network and of its refined grids on all parts."""
    counts: Counted = {}
    for frames in (_Subset(*part) for part in test):
        net = load_net(weights, frames.camera)
        found = count_grids(network_grids(net, frames, {"CRF": crf_refinement(frames.spec.cell)}), frames)
        for method in found.methods:
            counts.setdefault(method.replace(NETWORK, name), []).append((method, found))
    return counts


def _count_states(training: list[Part], test: list[Part]) -> Counted:
    """Count the errors of the most frequent class of each occupancy state."""
    learned = [_Subset(*part).arrays for part in training]
    truths = np.concatenate([arrays["true"].reshape(-1, 1, 1) for arrays in learned])
    occupancy = np.concatenate([np.moveaxis(arrays["occupancy"], 1, -1).reshape(-1, 4, 1, 1) for arrays in learned])
    best = majority_by_state(truths, occupancy)[:, 0, 0]  # every cell of every frame counts as one grid
    called = [(frames, best[frames.arrays["occupancy"].argmax(axis=1)]) for frames in (_Subset(*part) for part in test)]
    return {STATE_TABLE: [(STATE_TABLE, count_grids(lambda k, c=c: {STATE_TABLE: c[k]}, f)) for f, c in called]}


def _joined(rounds: Iterable[Counted]) -> Counted:
    """Put the cameras of all rounds together, method by method."""
    joined: Counted = {}
    for counted in rounds:
        for method, parts in counted.items():
            joined.setdefault(method, []).extend(parts)
    return joined


def _scores_of(seeds: list[list[tuple[str, GridCounts]]], table: list[tuple[str, GridCounts]]) -> dict[str, object]:
    """Return the scores of a method from its counts on each camera, by seed, beside those of the table of states."""
    kept, of_table = (on_cells(_by_block(some), "semantic", KITTI_14) for some in (seeds, [table]))
    metrics = ("pixel accuracy", "class accuracy")
    parts = [part for one in seeds for part in one]
    total = kept.sum(axis=(0, 1))[: KITTI_14.n_semantic]
    diagrams = [counted.reliability[name] for name, counted in parts if name in counted.reliability]
    return {
        **{name: score_with_interval(kept, METRICS[name]) for name in metrics},
        "above the table": {name: compared(kept, of_table, METRICS[name]) for name in metrics},
        "recall": {KITTI_14.names[c]: total[c, c] / row.sum() for c, row in enumerate(total) if row.any()},
        "cameras": dict(map(_share_right, zip(*seeds, strict=True))),
        "cells": int(kept[0].sum()),
        "frames": sum(len(counted.confusions.drives) for _, counted in seeds[0]),
        "ECE": expected_calibration_error(reliability_of_sums(sum(diagrams))) if diagrams else None,
    }


def _by_block(seeds: list[list[tuple[str, GridCounts]]]) -> NDArray:
    """Return the confusions of each seed and block of two seconds, (S, V, C, C); rows: labelled returns."""
    drives = tuple(drive for _, counted in seeds[0] for drive in counted.confusions.drives)
    of_parts = [[counted.confusions.of(name, "true").counts[name] for name, counted in parts] for parts in seeds]
    return np.stack([FrameConfusions(drives, {"": np.concatenate(parts)}).by_drive("") for parts in of_parts])


def _share_right(one_camera: tuple[tuple[str, GridCounts], ...]) -> tuple[str, float]:
    """Return the name of a camera, and the pixel accuracy on it over all seeds."""
    confusions = _by_block([[part] for part in one_camera]).sum(axis=(0, 1))
    return one_camera[0][1].confusions.drives[0].partition(",")[0], METRICS["pixel accuracy"](confusions)


def real_streets_table(result: dict[str, object]) -> str:
    """Return both splits as Markdown tables, per cent.

    Parameters
    ----------
    result : dict
        From `compare_real`.
    """
    return "\n\n".join(_table(split, methods) for split, methods in result["scores"].items())


def _table(split: str, methods: dict[str, dict]) -> str:
    """Return the table of one split."""
    first = next(iter(methods.values()))
    classes = list(first["recall"])
    rows = [[f"{split}: {first['frames']} frames, {first['cells']} cells", "pixels", "classes", *classes, "ECE"]]
    for name, scores in methods.items():
        metrics = [shown(scores[metric]) for metric in ("pixel accuracy", "class accuracy")]
        rows.append([name, *metrics, *(per_cent(scores["recall"][c], 0) for c in classes), per_cent(scores["ECE"])])
    return markdown_table(rows)


def main(
    pandaset: Path, simulated: Path, runs: Path, out: Path, scene: str = "002", seed: int = 0, device: str = "cpu"
) -> None:
    """Train and score in every way, write the result and print its tables.

    Parameters
    ----------
    pandaset : Path
        The folder of PandaSet's scenes.
    simulated, runs
        As `compare_real` takes them.
    out : Path
        A JSON file.
    scene, seed, device
        As `compare_real` takes them.
    """
    result = compare_real(pandaset, scene, simulated, runs, seed, device)
    write_json(out, result)
    print(real_streets_table(result))


if __name__ == "__main__":
    typer.run(main)
