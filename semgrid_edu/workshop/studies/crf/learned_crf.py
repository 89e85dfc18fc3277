"""Ways to learn a CRF on the grids of a network: from which drives, what, and with which loss (section 3.5)."""

import math
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from semgrid_edu.crf import CrfParams
from semgrid_edu.crf.layer import CrfLayer
from semgrid_edu.datasets.index import INDEX_FILE
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.networks import load_net
from semgrid_edu.storage.files import sha256
from semgrid_edu.storage.provenance import short_path, write_provenance
from semgrid_edu.training import TrainingParams
from semgrid_edu.training.crf import CRF_TRAINING, train_crf
from semgrid_edu.workshop.studies.crf.crf_scores import grid_outputs

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
    dataset_dir: str | Path,
    weights: str | Path,
    folder: str | Path,
    variant: CrfVariant,
    params: TrainingParams = CRF_TRAINING,
    seed: int = 0,
    resume: bool = False,
) -> None:
    """Train a CRF on the grids that a network makes of the frames of a split, and write down how it was made.

    The network stays as it is, so its grids are computed once.

    Parameters
    ----------
    dataset_dir : path-like
        A data set with the split of the variant.
    weights : path-like
        The network.
    folder : path-like
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
    began, frames = datetime.now(UTC), TrainingSet(dataset_dir, variant.split)
    outputs = grid_outputs(load_net(weights, frames.camera), frames)
    start = CrfParams.for_cells(frames.spec.cell)
    updates = MEAN_FIELD_UPDATES
    layer = CrfLayer(start, len(frames.label_set), iterations=updates, learn_compatibility=variant.label_costs)
    params = replace(params, weight_limit=variant.weight_limit)
    train_crf(layer, *outputs, folder, params, seed, resume)
    write_provenance(
        folder,
        _train_command(dataset_dir, weights, folder, variant, params, seed),
        seed,
        ("torch", "numpy", "safetensors"),
        date=f"{began:%Y-%m-%d}",
        minutes=round((datetime.now(UTC) - began).total_seconds() / 60, 1),
        resumed=resume,
        # JSON has no infinity.
        params={name: str(value) if value == math.inf else value for name, value in asdict(params).items()},
        crf=layer.description(),
        dataset=sha256(Path(dataset_dir) / INDEX_FILE),
        network=sha256(weights),
    )


def _train_command(
    dataset_dir: str | Path,
    weights: str | Path,
    folder: str | Path,
    variant: CrfVariant,
    params: TrainingParams,
    seed: int,
) -> str:
    data, out = (Path(path).resolve().name for path in (dataset_dir, folder))
    options = [
        f"--data {data} --split {variant.split} --weights {short_path(weights)} --out {out}",
        "--label-costs" if variant.label_costs else "",
        f"--weight-limit {variant.weight_limit:g} --seed {seed} --iterations {params.grid_iterations}",
    ]
    return " ".join(["semgrid-edu train-crf", *filter(None, options)])
