"""Ways to train for real streets, scored on labelled returns of a PandaSet scene that were kept apart (section 4).

One scene is one corner of one city for eight seconds. A camera that is left out sees another side of it; a later time
sees the same side again. Neither stands for other streets.
"""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf import expected_calibration_error
from semgrid_edu.crf.temperature import Reliability
from semgrid_edu.datasets.index import DatasetIndex, LabelledFrame
from semgrid_edu.datasets.readers.pandaset import CAMERAS, PandasetScene
from semgrid_edu.datasets.samples import sample_weights
from semgrid_edu.datasets.training_set import Mixture, TrainingSet, sets_by_camera
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import METRICS
from semgrid_edu.networks import WEIGHTS, Architecture, SemanticGridNet, build_net, load_net
from semgrid_edu.networks.build import plane_sampler
from semgrid_edu.occupancy import State
from semgrid_edu.pipeline import Stages
from semgrid_edu.storage.files import named_rows, sha256, table_beside
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.training import CHECKPOINT, TrainingParams, train
from semgrid_edu.workshop.scoring.confusions import FrameConfusions
from semgrid_edu.workshop.scoring.counting import GridCounts, count_grids
from semgrid_edu.workshop.scoring.grids import network_grids
from semgrid_edu.workshop.scoring.score_with_interval import (
    markdown_table,
    on_cells,
    per_cent,
    score_with_interval,
    shown,
)

TABLE = table_beside(__file__)
VARIANTS = named_rows(TABLE["variants"])
"""The ways to train, by name."""

LATER = "later"
"""The split in time."""

STATE_TABLE = "occupancy state alone"
"""The baseline that a network must beat: the most frequent class of each state in the training frames."""

BLOCK = 2.0
"""Seconds of one camera that count as one drive in an interval: neighbouring frames look alike."""

Part = tuple[TrainingSet, list[int]]
"""The frames of a camera, and the numbers of some of them."""

Counted = dict[str, list[tuple[str, GridCounts]]]
"""For each method what it is called in the counts of each part, and these counts."""


def compare_real(
    root: str | Path, scene: str, simulated: str | Path, runs: str | Path, seed: int = 0
) -> dict[str, object]:
    """Train networks in each of `VARIANTS` for each of two splits of a scene, and score what was kept apart.

    A cell counts when a labelled return of its own scan lies in it and the camera may see it. Networks learn from the
    returns of the neighbouring scans too.

    Parameters
    ----------
    root, scene : path-like, str
        As `PandasetScene` takes them.
    simulated : path-like
        The data set of simulated streets that some ways learn from as well, such as data/minikitti.
    runs : path-like
        Takes one folder per training run. A run that has ended isn't repeated, and one that was interrupted is resumed.
    seed : int
        First seed for initial weights and for the order of the frames; a row of `VARIANTS` says how many are used.

    Returns
    -------
    dict
        "scores": by split and method "pixel accuracy" and "class accuracy" with intervals over blocks of two seconds,
        the recall of each class, and the "ECE"; and all that made them. JSON can hold it.
    """
    views = {camera: _frames(Path(root), scene, camera) for camera in CAMERAS}
    streets = sets_by_camera(simulated, "train")
    found, weights = {}, {}
    for split, (training, test) in splits(views).items():
        found[split] = _scores_by_method([_count_states(training, test)])
        for name, variant in VARIANTS.items():
            if split == LATER and name not in TABLE["later"]:
                continue
            counted = []
            for k in range(seed, seed + (variant.seeds if split != LATER else 1)):
                folder = Path(runs) / f"{split}, {name}, {k}"
                net = _trained(variant, training, streets, folder, k)
                weights[folder.name] = sha256(folder / WEIGHTS) if variant.grid else sha256(_start(variant))
                counted.append(_count(name, net, test))
            found[split] |= _scores_by_method(counted)
    command = f"semgrid-edu reproduce real-streets --scene {scene} --seed {seed}"
    return {"scores": found, "weights": weights, "seed": seed, **made_by(command, "numpy", "torch", "numba")}


def splits(views: dict[str, TrainingSet]) -> dict[str, tuple[list[Part], list[Part]]]:
    """Return what is learnt from and what is kept apart, by the name of the split.

    Parameters
    ----------
    views : dict of str to TrainingSet
        The frames of each camera.
    """
    whole = {camera: (frames, list(range(len(frames)))) for camera, frames in views.items()}
    first = [(frames, ks[: round(TABLE["learnt"] * len(ks))]) for frames, ks in whole.values()]
    last = [(frames, ks[round((TABLE["learnt"] + TABLE["skipped"]) * len(ks)) :]) for frames, ks in whole.values()]
    left_out = [whole[camera] for camera in TABLE["left_out"]]
    others = [part for camera, part in whole.items() if camera not in TABLE["left_out"]]
    return {"two cameras left out": (others, left_out), LATER: (first, last)}


def _frames(root: Path, scene: str, camera: str) -> TrainingSet:
    """Open all frames of a camera; "true" is what the returns of each scan alone say of the cells in view."""
    drive = PandasetScene(root, scene, camera)
    listed = tuple(LabelledFrame((scene, camera), k) for k in range(len(drive)))
    frames = TrainingSet(DatasetIndex(root, f"pandaset-{scene}", KITTI_14, {camera: listed}, PandasetScene), camera)
    spec, ignored = frames.spec, np.uint8(IGNORE)
    own = [np.where(drive.undecided(k, spec), drive.truth(k, spec, 0, 0), ignored) for k in range(len(drive))]
    frames.arrays["true"] = np.stack(own)
    frames.drives = tuple(f"{camera}, {int(frame.time / BLOCK)}" for frame in drive)
    return frames


class _Some(TrainingSet):
    """Some frames of a training set."""

    def __init__(self, frames: TrainingSet, numbers: list[int]) -> None:
        self.__dict__ |= frames.__dict__
        self.drives = tuple(frames.drives[k] for k in numbers)
        self.arrays = {name: frames.arrays[name][numbers] for name in ("image", "labels", "occupancy", "truth", "true")}


def _start(variant: SimpleNamespace) -> Path:
    """Return the shipped network that a variant starts from."""
    return sample_weights(getattr(variant, "segmenter", "segnet"))


def _trained(
    variant: SimpleNamespace, training: list[Part], streets: list[TrainingSet], folder: Path, seed: int
) -> SemanticGridNet:
    """Train a network, unless that was done before."""
    real = [_Some(*part) for part in training]
    mixture = Mixture([real, streets] if getattr(variant, "together", False) else [real])
    net = _initial(variant, mixture, seed)
    if not variant.grid:
        return net
    if not (folder / WEIGHTS).exists():
        chosen = {name: getattr(variant, name) for name in ("end_to_end", "tint") if hasattr(variant, name)}
        params = TrainingParams(variant.image, variant.grid, min(6, *map(len, mixture.parts)), **chosen)
        train(net, mixture, folder, params, seed, (folder / CHECKPOINT).exists())
    return load_net(folder / WEIGHTS, mixture.camera)


def _initial(variant: SimpleNamespace, mixture: Mixture, seed: int) -> SemanticGridNet:
    """Return the network with which training begins."""
    if getattr(variant, "start", False):
        return load_net(_start(variant), mixture.camera)
    named = {
        name: getattr(variant, name) for name in ("segmenter", "uses_occupancy", "heights") if hasattr(variant, name)
    }
    return build_net(replace(Architecture(), **named), mixture.camera, seed)


def _count(name: str, net: SemanticGridNet, test: list[Part]) -> Counted:
    """Count the errors of a network, and of its refined grids, in all parts."""
    counted: Counted = {}
    for part in test:
        frames = _Some(*part)
        net.sampler = plane_sampler(net.need_architecture(), frames.camera)
        found = count_grids(network_grids(net, frames, {"CRF": Stages.of(net).refine}), frames)
        for method in found.methods:
            counted.setdefault(method.replace("network", name), []).append((method, found))
    return counted


def _count_states(training: list[Part], test: list[Part]) -> Counted:
    """Count the errors of the most frequent class of each occupancy state."""
    counts = np.zeros((len(State), KITTI_14.n_semantic), np.int64)
    for frames in (_Some(*part) for part in training):
        states, truth = frames.arrays["occupancy"].argmax(axis=1), frames.arrays["true"]
        np.add.at(counts, (states[truth != IGNORE], truth[truth != IGNORE]), 1)
    best = counts.argmax(axis=1)
    found = []
    for frames in (_Some(*part) for part in test):
        occupancy = frames.arrays["occupancy"]
        found.append(
            (STATE_TABLE, count_grids(lambda k, o=occupancy: {STATE_TABLE: best[o[k].argmax(axis=0)]}, frames))
        )
    return {STATE_TABLE: found}


def _scores_by_method(seeds: list[Counted]) -> dict[str, dict]:
    """Return what is said of each method, from the counts of each seed."""
    return {method: _scores_of([counted[method] for counted in seeds]) for method in seeds[0]}


def _scores_of(seeds: list[list[tuple[str, GridCounts]]]) -> dict[str, object]:
    """Return what is said of a method, from the counts of all cameras for each seed."""
    drives = tuple(drive for _, counted in seeds[0] for drive in counted.confusions.drives)
    matrices = np.stack([np.concatenate([_matrices(*part) for part in parts]) for parts in seeds])
    by_block = np.stack([FrameConfusions(drives, {"": one}).by_drive("") for one in matrices])
    kept = on_cells(by_block, "semantic", KITTI_14)
    total = matrices.sum(axis=(0, 1))[: KITTI_14.n_semantic]
    diagrams = [counted.reliability[name] for parts in seeds for name, counted in parts if name in counted.reliability]
    return {
        **{name: score_with_interval(kept, METRICS[name]) for name in ("pixel accuracy", "class accuracy")},
        "recall": {KITTI_14.names[c]: total[c, c] / row.sum() for c, row in enumerate(total) if row.any()},
        "cells": int(matrices[0].sum()),
        "frames": len(drives),
        "ECE": _calibration_error(sum(diagrams)) if diagrams else None,
    }


def _matrices(method: str, counted: GridCounts) -> NDArray[np.int64]:
    """Return the confusion matrix of each frame, (N, C, C), rows: labelled returns."""
    return counted.confusions.of(method, "true").counts[method]


def _calibration_error(sums: NDArray) -> float:
    """Return the expected calibration error of counts, summed confidences and hits by bin."""
    cells, confidence, right = sums
    several = np.maximum(cells, 1)
    return expected_calibration_error(Reliability(confidence / several, right / several, cells))


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
        recall = [per_cent(scores["recall"][c], 0) for c in classes]
        rows.append([name, *metrics, *recall, per_cent(scores["ECE"])])
    return markdown_table(rows)
