"""CRFs that learn weights, widths and label costs on a network's grids, and their scores (sections 3.5, 4.3)."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

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
from semgrid_edu.storage.provenance import made_by, short_path, write_provenance
from semgrid_edu.training import TrainingParams
from semgrid_edu.training.checkpoint import CHECKPOINT, check_folder
from semgrid_edu.training.crf import CRF_TRAINING, train_crf
from semgrid_edu.workshop.scoring.evaluate import scores_table
from semgrid_edu.workshop.studies.crf import crf_scores

MEAN_FIELD_UPDATES = 5
"""Updates that a learnt CRF makes, in training and afterwards: Zheng et al. 2015 trained with as many."""


class CrfVariant(NamedTuple):
    """One way to learn a CRF.

    Parameters
    ----------
    split : str
        Where it learns: on "train", the drives that the network learned from, or on "validation", which it never saw.
    label_costs : bool
        Whether the label costs learn too, or only weights and widths.
    weight_limit : float
        Limit of the class weights in the loss: 1 for plain cross-entropy.
    """

    split: str
    label_costs: bool
    weight_limit: float

    @property
    def name(self) -> str:
        """What tables call it."""
        learns = "weights + label costs" if self.label_costs else "weights"
        loss = "plain" if self.weight_limit == 1 else "balanced"
        return f"learnt {learns}, {loss} loss, {'known' if self.split == 'train' else 'new'} drives"

    @property
    def folder(self) -> str:
        """Name of the folder of its training run."""
        return self.name.replace(" + ", "-").replace(", ", "-").replace(" ", "-")


VARIANTS = tuple(
    CrfVariant(split, label_costs, weight_limit)
    for split in ("validation", "train")
    for weight_limit in (TrainingParams.weight_limit, 1.0)
    for label_costs in (False, True)
)
"""All ways that are compared."""


def train_crf_on(
    dataset_dir: Path, weights: Path, folder: Path, variant: CrfVariant, params: TrainingParams, seed: int, resume: bool
) -> None:
    """Train a CRF on the grids that a network makes of the frames of a split, and write its provenance.

    The network stays as it is, so its grids are computed once.

    Parameters
    ----------
    dataset_dir : Path
        A data set with the split of the variant.
    weights : Path
        The network.
    folder : Path
        Where to write the files of `train_crf`, and `provenance.json`.
    variant : CrfVariant
        Where it learns, what learns, and with which loss.
    params : TrainingParams
        Number of steps, frames per step, rates; the variant's class weights replace theirs.
    seed : int
        Seed for the order of the frames.
    resume : bool
        Whether to continue a run that was interrupted.

    Raises
    ------
    ArgumentError
        When there is no such split, or as `train_crf` raises it.
    DataError
        When a file is missing or damaged, or the folder holds a run that would be overwritten.
    """
    check_folder(folder, resume)
    params, resumed = replace(params, weight_limit=variant.weight_limit), (folder / CHECKPOINT).exists()
    began, frames = datetime.now(UTC), TrainingSet(dataset_dir, variant.split)
    outputs = crf_scores.grid_outputs(load_net(weights, frames.camera), frames)
    layer = _untrained(frames, variant.label_costs)
    train_crf(layer, *outputs, folder, params, seed, resume)
    data, out = (path.resolve().name for path in (dataset_dir, folder))
    costs = " --label-costs" if variant.label_costs else ""
    write_provenance(
        folder,
        f"semgrid-edu train-crf --data {data} --split {variant.split} --weights {short_path(weights)} --out {out}"
        f"{costs} --weight-limit {variant.weight_limit:g} --seed {seed} --iterations {params.grid_iterations}",
        seed,
        ("torch", "numpy", "safetensors"),
        date=f"{began:%Y-%m-%d}",
        minutes=round((datetime.now(UTC) - began).total_seconds() / 60, 1),
        resumed=resumed,
        # JSON has no infinity.
        params={name: str(value) if value == math.inf else value for name, value in asdict(params).items()},
        crf=layer.description(),
        dataset=sha256(dataset_dir / INDEX_FILE),
        network=sha256(weights),
    )


def _untrained(frames: TrainingSet, label_costs: bool = False) -> CrfLayer:
    """Return a layer with the default parameters for these frames."""
    start = CrfParams.for_cells(frames.spec.cell)
    return CrfLayer(start, len(frames.label_set), iterations=MEAN_FIELD_UPDATES, learn_compatibility=label_costs)


def compare_learned_crfs(
    dataset: Path, validation: Path, weights: Path, runs: Path, params: TrainingParams = CRF_TRAINING, seed: int = 0
) -> dict[str, object]:
    """Learn a CRF in each of the ways of `VARIANTS`, and score all of them on the test split.

    Parameters
    ----------
    dataset : Path
        The data set that the network was trained on, with the splits "train" and "test".
    validation : Path
        A data set with the split "validation", drives that the network has never seen.
    weights : Path
        The network.
    runs : Path
        Takes one folder per training run. A run that has ended isn't repeated, and one that was interrupted is
        resumed.
    params : TrainingParams
        How to train.
    seed : int
        Seed for the order of the frames.

    Returns
    -------
    dict
        What `scores_on_test` returns, "learnt" (`learnt_values` of each CRF), and how it was made. JSON can hold it.

    Raises
    ------
    ArgumentError
        When a split is missing.
    DataError
        When a file is missing or damaged, or a drive of "validation" is one of "train" or "test".
    """
    crf_scores.refuse_known_drives(validation, dataset)
    data, layers = {"train": dataset, "validation": validation}, {}
    for variant in VARIANTS:
        folder = runs / variant.folder
        if not (folder / WEIGHTS).exists():
            train_crf_on(data[variant.split], weights, folder, variant, params, seed, resume=True)
        layers[variant.name] = load_crf(folder / WEIGHTS)
    named = {split: crf_scores.named_data(folder) for split, folder in data.items()}
    used = f"--data {named['train']['name']} --validation {named['validation']['name']} --weights {short_path(weights)}"
    return scores_on_test(dataset, weights, layers) | {
        "learnt": {name: learnt_values(layer) for name, layer in layers.items()},
        "params": asdict(params),
        "mean field updates": MEAN_FIELD_UPDATES,
        "data": named,
        "weights": {"file": short_path(weights), "sha256": sha256(weights)},
        "seed": seed,
        **made_by(f"semgrid-edu reproduce learned-crf {used} --seed {seed}", "numpy", "torch", "numba"),
    }


def scores_on_test(dataset: Path, weights: Path, layers: Mapping[str, CrfLayer]) -> dict[str, object]:
    """Score the network, the default CRF and trained ones on the test split.

    Parameters
    ----------
    dataset : Path
        A data set with the split "test".
    weights : Path
        The network.
    layers : dict of str to CrfLayer
        The trained CRFs by name.

    Returns
    -------
    dict
        From `scores_by_method`, with the names of the "classes".
    """
    test = TrainingSet(dataset, "test")
    outputs = crf_scores.grid_outputs(load_net(weights, test.camera), test)

    def grids() -> Iterator[tuple[str, NDArray]]:
        yield "network", crf_scores.refined_grids(outputs, None)
        yield "network + CRF", crf_scores.refined_grids(outputs, CrfParams.for_cells(test.spec.cell))
        for name, layer in {"untrained layer": _untrained(test), **layers}.items():
            yield name, layer_grids(layer, outputs)

    return crf_scores.scores_by_method(grids(), outputs, test) | {"classes": list(test.label_set.names)}


@torch.inference_mode()
def layer_grids(layer: CrfLayer, outputs: crf_scores.GridOutputs) -> NDArray[np.float32]:
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
    lines = [scores_table(result["scores"]), "", crf_scores.gains_text(result["gains"]), ""]
    for method, learnt in result["learnt"].items():
        named = (f"{name} {value:.3g}" for name, value in learnt.items() if name != "compatibility")
        lines.append(f"{method}: {', '.join(named)}")
    return "\n".join(lines)
