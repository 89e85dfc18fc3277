"""Grids of a data set made from image labels and LIDAR, kept beside the arrays whose truth they can replace (4).

Ways to make ground truth that have names, so that a command or the folder of a run can ask for one (section 4).
"""

import hashlib
import json
from dataclasses import asdict, dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.datasets.ground_truth import Moment, TruthFlaws, TruthPolicy, drive_truth, flawed_drive
from semgrid_edu.datasets.index import DatasetIndex
from semgrid_edu.datasets.readers.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.training_cache import SEED, WORKERS, ArrayRecipe
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.occupancy import track_drive
from semgrid_edu.storage.files import sha256
from semgrid_edu.storage.tensors import read_tensors, write_tensors
from semgrid_edu.storage.workplace import worker_pool

ACCUMULATED = TruthPolicy(past=9, vote="majority")
"""The labelled scan and the nine before it, all labelled by the one labelled image, as in KITTI: the scan is the last
of 0.9 s, and most cells have many returns, whose majority decides."""

POLICIES = {
    "lidar": TruthPolicy(),
    "no-cleanup": TruthPolicy(cleanup="none"),
    "accumulated-carved": replace(ACCUMULATED, movers="carved"),
    "accumulated-smeared": ACCUMULATED,
    "accumulated-carried": replace(ACCUMULATED, movers="carried"),
    "camera-mask": TruthPolicy(visible_to="camera"),
    "de-skewed": TruthPolicy(deskew=True),
}
"""The policies that networks learn from, by name; "lidar" is the paper's, as far as it says. The others change one
thing each, but for the accumulated ones, which also take the majority's class."""


GRIDS_KEY = "truth"
"""Name of the tensor in the file of made grids."""


@dataclass(frozen=True)
class MadeTruth:
    """How the grids of a data set are made from its image labels and scans.

    Parameters
    ----------
    policy : TruthPolicy
        What `lidar_truth` does.
    flaws : TruthFlaws
        The errors that image labels, calibration and scans get first, since those of simulated data have none; those
        like real data's by default, `NO_FLAWS` for real data.
    seed : int
        Seed for these errors. The error of calibration is the same in the whole data set.

    Raises
    ------
    ArgumentError
        When the seed is negative.
    """

    policy: TruthPolicy = field(default_factory=TruthPolicy)
    flaws: TruthFlaws = field(default_factory=TruthFlaws)
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse a seed that numpy would refuse later."""
        if self.seed < 0:
            raise ArgumentError("seed", "a whole number from 0 up", self.seed)


def made_grids(
    index: DatasetIndex, split: str, recipe: ArrayRecipe, made: MadeTruth, folder: Path
) -> NDArray[np.uint8]:
    """Return the grids of a split's labelled frames, which are made on first use.

    Parameters
    ----------
    index : DatasetIndex
        The data set.
    split : str
        One of its splits, such as "train".
    recipe : ArrayRecipe
        Grid and occupancy filter.
    made : MadeTruth
        How to make the grids.
    folder : Path
        Where `cached_arrays` keeps the arrays of this split and recipe. Its name stands for data, recipe and filter;
        the name of the file that is kept in it stands for `made` and for the code that makes grids.

    Returns
    -------
    (N, H, W) uint8
        By drive in the order of the index.

    Raises
    ------
    ArgumentError
        When there is no such split.
    DataError
        When the data set, or what was kept, is damaged.
    """
    path = folder / f"made-{_fingerprint(made)}.safetensors"
    if not path.exists():
        grids = torch.from_numpy(_make_grids(index, split, recipe, made))
        write_tensors(path, {GRIDS_KEY: grids}, {"made": json.dumps(asdict(made), sort_keys=True)})
    _, tensors = read_tensors(path)
    if GRIDS_KEY not in tensors:
        raise DataError(path, f"the tensor {GRIDS_KEY} (delete the file to make it anew)", ", ".join(tensors) or "none")
    return tensors[GRIDS_KEY].numpy()


def _fingerprint(made: MadeTruth) -> str:
    """Hash what decides the grids beside data, recipe and filter: what is asked, and the code that makes them."""
    here = Path(__file__)
    code = [here, *sorted((here.parent / "ground_truth").glob("*.py"))]
    return hashlib.sha256("\n".join([repr(made), *map(sha256, code)]).encode()).hexdigest()[:16]


def _make_grids(index: DatasetIndex, split: str, recipe: ArrayRecipe, made: MadeTruth) -> NDArray[np.uint8]:
    """Make the grids of every labelled frame of a split, (N, H, W)."""
    drives = index.frames_by_drive(split).items()
    jobs = [(index.root, *name, labelled, recipe, made, k) for k, (name, labelled) in enumerate(drives)]
    with worker_pool(WORKERS) as pool:
        made_drives = pool.map(_make_drive, *zip(*jobs, strict=True))
        progress = tqdm(made_drives, desc=f"{index.name}, {split}: made truth", total=len(jobs), unit="drive")
        return np.stack([grid for drive in progress for grid in drive])


def _make_drive(
    root: Path, date: str, drive: str, labelled: list[int], recipe: ArrayRecipe, made: MadeTruth, number: int
) -> list[NDArray[np.uint8]]:
    """Make the grids of a drive's labelled frames; `number` tells it from the other drives of the split."""
    frames = list(islice(KittiRawDrive(root, date, drive, images=False), max(labelled) + made.policy.future + 1))
    beliefs = list(track_drive(frames, recipe.spec, recipe.params, SEED))
    flawed = flawed_drive(frames, made.flaws, made.seed, number)
    moments = [Moment(frame, belief) for frame, belief in zip(flawed, beliefs, strict=True)]
    return [drive_truth(moments, k, recipe.spec, made.policy) for k in labelled]
