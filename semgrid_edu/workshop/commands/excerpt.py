"""`semgrid-edu data excerpt`: a few labelled frames of a data set, to ship or to try things on."""

from pathlib import Path

import torch

from semgrid_edu.datasets.index import INDEX_FILE
from semgrid_edu.datasets.training_arrays import SEED
from semgrid_edu.datasets.training_set import FRAMES, Sample
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.fast import TrainingSet
from semgrid_edu.storage.provenance import PROVENANCE, write_provenance
from semgrid_edu.storage.tensors import write_tensors


def write_excerpt(dataset_dir: str | Path, n_frames: int, folder: str | Path) -> None:
    """Keep a few labelled frames of a data set's split "train", evenly spaced.

    Parameters
    ----------
    dataset_dir : path-like
        The data set, such as data/minikitti.
    n_frames : int
        How many frames.
    folder : path-like
        The folder that takes `frames.safetensors` and `provenance.json`.

    Raises
    ------
    ArgumentError
        When the split has fewer frames.
    DataError
        When the folder is in the data set, contains it, or has the provenance of something else, which would be lost.
    """
    _check_place(Path(folder), Path(dataset_dir))
    training = TrainingSet(dataset_dir, "train")
    folder = Path(folder)
    if not 1 <= n_frames <= len(training):
        raise ArgumentError("n_frames", f"1 to {len(training)} frames", n_frames)
    chosen = [training[k * len(training) // n_frames] for k in range(n_frames)]
    tensors = dict(zip(Sample._fields, map(torch.stack, zip(*chosen, strict=True)), strict=True))
    write_tensors(folder / FRAMES, tensors)
    command = f"semgrid-edu data excerpt --data {Path(dataset_dir).name} --frames {n_frames} {folder.name}"
    write_provenance(folder, command, SEED, ("numpy", "torch", "numba"))


def _check_place(folder: Path, dataset_dir: Path) -> None:
    """Check that no other provenance is in the folder or would be mixed with the excerpt's."""
    here = folder.resolve()
    there = dataset_dir.resolve()
    if here.is_relative_to(there) or there.is_relative_to(here) or (folder / INDEX_FILE).exists():
        raise DataError(folder, f"a folder apart from the data set {dataset_dir}", "one that holds it or is part of it")
    if (folder / PROVENANCE).exists() and not (folder / FRAMES).exists():
        raise DataError(folder, "an empty folder, or an earlier excerpt", f"the {PROVENANCE} of something else")
