"""Train the compact network on a data set, with its provenance (paper, section 4.1)."""

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from semgrid_edu.datasets.index import INDEX_FILE
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.files import sha256
from semgrid_edu.networks import Architecture, build_net
from semgrid_edu.provenance import write_provenance
from semgrid_edu.training import TrainingParams, train


def train_compact(
    dataset_dir: str | Path,
    folder: str | Path,
    segmenter: str,
    params: TrainingParams,
    seed: int = 0,
    resume: bool = False,
) -> None:
    """Train on the split "train" of a data set.

    Parameters
    ----------
    dataset_dir : path-like
        Such as data/minikitti.
    folder : path-like
        Takes what `train` writes, and `provenance.json`, which also names the data by their index's SHA-256.
    segmenter : str
        The image network, as `build_segmenter` takes it.
    params : TrainingParams
    seed : int
        Of the initial weights, and of the order and looks of the frames.
    resume : bool
        Whether to continue a run that was interrupted.
    """
    dataset, began = TrainingSet(dataset_dir, "train"), datetime.now(UTC)
    train(build_net(Architecture(segmenter), dataset.camera, seed), dataset, folder, params, seed, resume)
    command = (
        f"semgrid-edu train --data {Path(dataset_dir).name} --out {Path(folder).name} "
        f"--segmenter {segmenter} --seed {seed} --iterations {params.grid_iterations}"
        + ("" if params.end_to_end else " --two-stage")
    )
    minutes = round((datetime.now(UTC) - began).total_seconds() / 60, 1)
    details = {"date": f"{began:%Y-%m-%d}", "minutes": minutes, "resumed": resume, "params": asdict(params)}
    details["dataset"] = sha256(Path(dataset_dir) / INDEX_FILE)
    write_provenance(folder, command, seed, ("torch", "numpy", "safetensors"), **details)
