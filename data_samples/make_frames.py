"""How `frames/` was made: `python data_samples/make_frames.py DATASET N_FRAMES FOLDER`."""

import sys
from pathlib import Path

import torch

from semgrid_edu.datasets.training_arrays import SEED
from semgrid_edu.datasets.training_set import EXCERPT, FRAMES
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import TrainingSet
from semgrid_edu.storage.provenance import write_provenance
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
    training = TrainingSet(dataset_dir, "train")
    folder = Path(folder)
    if not 1 <= n_frames <= len(training):
        raise ArgumentError("n_frames", f"1 to {len(training)} frames", n_frames)
    chosen = [training[k * len(training) // n_frames] for k in range(n_frames)]
    tensors = {name: torch.stack([getattr(frame, name) for frame in chosen]) for name in EXCERPT}
    write_tensors(folder / FRAMES, tensors)
    command = f"python data_samples/make_frames.py {Path(dataset_dir).name} {n_frames} {folder.name}"
    write_provenance(folder, command, SEED, ("numpy", "torch", "numba"))


if __name__ == "__main__":
    write_excerpt(sys.argv[1], int(sys.argv[2]), sys.argv[3])
