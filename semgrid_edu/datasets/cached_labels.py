"""Labels made from image labels and LIDAR, kept beside the arrays whose truth they can replace (section 4)."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from semgrid_edu.datasets import label_policies
from semgrid_edu.datasets.label_policies import LidarTruth, drive_labels
from semgrid_edu.datasets.training_arrays import ArrayRecipe
from semgrid_edu.datasets.training_cache import LabelledDrives, in_each_drive
from semgrid_edu.errors import DataError
from semgrid_edu.storage.code_hash import code_hash
from semgrid_edu.storage.tensors import read_tensors, write_tensors

GRIDS_KEY = "truth"
"""Name of the tensor in the file of labels."""


def cached_labels(drives: LabelledDrives, recipe: ArrayRecipe, truth: LidarTruth, folder: Path) -> NDArray[np.uint8]:
    """Return the labels of the cells of a split's labelled frames, which are made on first use.

    Parameters
    ----------
    drives : sequence of (LabelledDrive, list of int)
        The drives of the split, and the numbers of their labelled frames.
    recipe : ArrayRecipe
        Grid and occupancy filter.
    truth : LidarTruth
        How to make the labels.
    folder : Path
        Where `cached_arrays` keeps the arrays of these drives and this recipe. Its name stands for data, recipe, reader
        and filter; the name of the file that is kept in it stands for `truth` and for the code that makes labels.

    Returns
    -------
    (N, H, W) uint8
        By drive.
    """
    key = f"{truth!r} {code_hash([Path(label_policies.__file__)])}"
    path = folder / f"labels-{hashlib.sha256(key.encode()).hexdigest()[:16]}.safetensors"
    if not path.exists():
        jobs = [(*drive, recipe, truth, number) for number, drive in enumerate(drives)]
        grids = in_each_drive(drive_labels, jobs, f"{folder.name}: labels from LIDAR")
        tensors = {GRIDS_KEY: torch.from_numpy(np.stack(grids))}
        write_tensors(path, tensors, {"truth": json.dumps(asdict(truth), sort_keys=True)})
    _, tensors = read_tensors(path)
    if GRIDS_KEY not in tensors:
        raise DataError(path, f"the tensor {GRIDS_KEY} (delete the file to make it anew)", ", ".join(tensors) or "none")
    return tensors[GRIDS_KEY].numpy()
