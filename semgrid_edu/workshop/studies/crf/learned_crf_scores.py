"""Scores on the test split of CRFs that learnt their weights, widths and label costs (section 3.5, claim of 4.3)."""

from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams
from semgrid_edu.crf.layer import CrfLayer, load_crf
from semgrid_edu.datasets.index import INDEX_FILE
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.networks import WEIGHTS, load_net
from semgrid_edu.storage.files import sha256
from semgrid_edu.storage.provenance import short_path, versions
from semgrid_edu.training import CHECKPOINT, TrainingParams
from semgrid_edu.training.crf import CRF_TRAINING
from semgrid_edu.workshop.scoring.confusions import drive_confusions
from semgrid_edu.workshop.scoring.evaluate import scores, scores_table
from semgrid_edu.workshop.studies.crf.crf_scores import (
    GridOutputs,
    gains_by_metric,
    gains_text,
    grid_outputs,
    refined_confusions,
    refined_grids,
    refuse_known_drives,
)
from semgrid_edu.workshop.studies.crf.learned_crf import MEAN_FIELD_UPDATES, VARIANTS, train_crf_on


def compare_learned_crfs(
    dataset_dir: str | Path,
    validation_dir: str | Path,
    weights: str | Path,
    runs: str | Path,
    params: TrainingParams = CRF_TRAINING,
    seed: int = 0,
) -> dict[str, object]:
    """Learn a CRF in each of the ways of `VARIANTS`, and score all of them on the test split.

    Parameters
    ----------
    dataset_dir : path-like
        The data set that the network was trained on, with the splits "train" and "test".
    validation_dir : path-like
        A data set with the split "validation", drives that the network has never seen.
    weights : path-like
        The network.
    runs : path-like
        Takes one folder per training run. A run that has ended isn't repeated, and one that was interrupted is
        resumed.
    params : TrainingParams
        How to train.
    seed : int
        Seed for the order of the frames.

    Returns
    -------
    dict
        What `scores_on_test` returns, "learnt" (`learnt_values` of each CRF), and all that made them. JSON can hold it.

    Raises
    ------
    ArgumentError
        When a split is missing.
    DataError
        When a file is missing or damaged, or a drive of "validation" is one of "train" or "test".
    """
    refuse_known_drives(validation_dir, dataset_dir)
    data = {"train": Path(dataset_dir), "validation": Path(validation_dir)}
    for variant in VARIANTS:
        folder = Path(runs) / variant.folder
        if not (folder / WEIGHTS).exists():
            resume = (folder / CHECKPOINT).exists()
            train_crf_on(data[variant.split], weights, folder, variant, params, seed, resume)
    layers = {variant.name: load_crf(Path(runs) / variant.folder / WEIGHTS) for variant in VARIANTS}
    names = {split: folder.resolve().name for split, folder in data.items()}
    return scores_on_test(dataset_dir, weights, layers) | {
        "learnt": {name: learnt_values(layer) for name, layer in layers.items()},
        "params": asdict(params),
        "mean field updates": MEAN_FIELD_UPDATES,
        "data": {split: {"name": names[split], "sha256": sha256(path / INDEX_FILE)} for split, path in data.items()},
        "weights": {"file": short_path(weights), "sha256": sha256(weights)},
        "command": f"semgrid-edu reproduce learned-crf --data {names['train']} --validation {names['validation']} "
        f"--weights {short_path(weights)} --seed {seed}",
        "seed": seed,
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "versions": versions("numpy", "torch", "numba"),
    }


def scores_on_test(dataset_dir: str | Path, weights: str | Path, layers: dict[str, CrfLayer]) -> dict[str, object]:
    """Score the network, the default CRF and trained ones on the test split.

    Parameters
    ----------
    dataset_dir : path-like
        A data set with the split "test".
    weights : path-like
        The network.
    layers : dict of str to CrfLayer
        The trained CRFs by name.

    Returns
    -------
    dict
        "frames"; by method "scores" (see `Scores`), "gains" over the network by metric (low, gain, high: see
        `gains_by_metric`), and "confusion".
    """
    test = TrainingSet(dataset_dir, "test")
    outputs = grid_outputs(load_net(weights, test.camera), test)
    default = CrfParams.for_cells(test.spec.cell)
    untrained = CrfLayer(default, len(test.label_set), iterations=MEAN_FIELD_UPDATES)
    methods = {
        "network": lambda: refined_grids(outputs, None),
        "network + CRF": lambda: refined_grids(outputs, default),
    }
    methods |= {
        name: partial(layer_grids, layer, outputs) for name, layer in {"untrained layer": untrained, **layers}.items()
    }
    per_drive = {
        name: drive_confusions(refined_confusions(outputs, run()), test.drives) for name, run in methods.items()
    }
    confusions = {name: drives.sum(axis=0) for name, drives in per_drive.items()}
    return {
        "frames": len(test),
        "scores": scores(confusions, test.label_set),
        "gains": {
            name: gains_by_metric(drives, per_drive["network"])
            for name, drives in per_drive.items()
            if name != "network"
        },
        "confusion": {name: confusion.tolist() for name, confusion in confusions.items()},
        "classes": list(test.label_set.names),
    }


@torch.inference_mode()
def layer_grids(layer: CrfLayer, outputs: GridOutputs) -> NDArray[np.float32]:
    """Refine every grid by a layer.

    Parameters
    ----------
    layer : CrfLayer
        The CRF.
    outputs : GridOutputs
        The network's grids.

    Returns
    -------
    (N, C, H, W) float32
        Q, the distribution over the classes in each cell.
    """
    frames = zip(outputs.log_g, np.array(outputs.occupancy), strict=True)
    shown = tqdm(frames, desc="CRF", total=len(outputs.truth), unit="frame")
    return np.stack([layer(*(torch.from_numpy(part)[None] for part in frame))[0].exp().numpy() for frame in shown])


def learnt_values(layer: CrfLayer) -> dict[str, object]:
    """Return what a CRF has learnt.

    Parameters
    ----------
    layer : CrfLayer
        The CRF.

    Returns
    -------
    dict
        "w1" and "w2"; "sigma_alpha" and "sigma_gamma", cells; "sigma_beta"; "compatibility", mu (C, C).
    """
    names = ("w1", "w2", "sigma_alpha", "sigma_beta", "sigma_gamma")
    values = torch.cat([layer.log_weights, layer.log_sigmas]).exp().tolist()
    return dict(zip(names, values, strict=True)) | {"compatibility": layer.compatibility.tolist()}


def learned_crf_table(result: dict) -> str:
    """Return scores, gains and learnt parameters as text to print.

    Parameters
    ----------
    result : dict
        From `compare_learned_crfs`.

    Returns
    -------
    str
        Scores in per cent; gains over the network without CRF in points, with 95 % intervals over test drives.
    """
    lines = [scores_table(result["scores"]), "", gains_text(result["gains"]), ""]
    for method, learnt in result["learnt"].items():
        named = (f"{name} {value:.3g}" for name, value in learnt.items() if name != "compatibility")
        lines.append(f"{method}: {', '.join(named)}")
    return "\n".join(lines)
