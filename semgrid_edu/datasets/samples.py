"""The shipped samples: a short simulated drive, a few labelled frames and trained compact weights (section 4)."""

from pathlib import Path

import torch

from semgrid_edu.datasets.index import INDEX_FILE
from semgrid_edu.datasets.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.training_cache import SEED
from semgrid_edu.datasets.training_set import Sample, TrainingSet
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.networks import IMAGE_STAGE, SEGMENTERS, WEIGHTS
from semgrid_edu.storage.provenance import FILE_NAME, provenance_problems, write_provenance
from semgrid_edu.storage.shipped import shipped_folder
from semgrid_edu.storage.tensors import read_tensors, write_tensors

FRAMES = "frames.safetensors"
"""Name of the file that holds an excerpt."""


def samples_dir() -> Path:
    """Return the folder of the samples. A wheel holds the drive and SegNet alone, a clone all of them."""
    return shipped_folder("data_samples")


def sample_drive() -> KittiRawDrive:
    """Return the shipped drive: 20 labelled frames of a simulated street."""
    return KittiRawDrive(samples_dir() / "sample", "2026_01_01", "0001")


def trained_segmenters() -> list[str]:
    """Return the names of the image networks in `SEGMENTERS` whose trained compact networks are shipped."""
    return [name for name in SEGMENTERS if _trained_folder(name).is_dir()]


def sample_weights(segmenter: str = "segnet") -> Path:
    """Return the file of a trained compact network, from image and occupancy grid to semantic grid.

    Parameters
    ----------
    segmenter : str
        Name of its image network, one of `trained_segmenters`.

    Returns
    -------
    Path

    Raises
    ------
    ArgumentError
        When no such network is shipped.
    """
    return _trained(segmenter) / WEIGHTS


def sample_image_stage(segmenter: str = "segnet") -> Path:
    """Return the file of the same network after its first stage, which learns from labelled images but not from grids.

    Parameters
    ----------
    segmenter : str
        Name of its image network, one of `trained_segmenters`.

    Returns
    -------
    Path

    Raises
    ------
    ArgumentError
        When no such network is shipped.
    """
    return _trained(segmenter) / IMAGE_STAGE


def _trained(segmenter: str) -> Path:
    """Return the folder of a trained compact network, or refuse a name that has none."""
    if segmenter not in (trained := trained_segmenters()):
        raise ArgumentError("segmenter", f"one of {', '.join(trained)}", repr(segmenter))
    return _trained_folder(segmenter)


def _trained_folder(segmenter: str) -> Path:
    """Return where the trained compact network with this image network is or would be shipped."""
    return samples_dir() / f"{segmenter}_compact"


def sample_frames() -> list[Sample]:
    """Return the shipped labelled frames of minikitti's training split, for experiments that take a minute."""
    return read_excerpt(samples_dir() / "frames")


def write_excerpt(dataset_dir: str | Path, n_frames: int, folder: str | Path) -> None:
    """Keep a few labelled frames of a data set's split "train", evenly spread over it.

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
        When the folder lies in the data set, holds it, or has the provenance of something else, which would be lost.
    """
    _check_place(Path(folder), Path(dataset_dir))
    training, folder = TrainingSet(dataset_dir, "train"), Path(folder)
    if not 1 <= n_frames <= len(training):
        raise ArgumentError("n_frames", f"1 to {len(training)} frames", n_frames)
    chosen = [training[k * len(training) // n_frames] for k in range(n_frames)]
    tensors = dict(zip(Sample._fields, map(torch.stack, zip(*chosen, strict=True)), strict=True))
    write_tensors(folder / FRAMES, tensors)
    command = f"semgrid-edu data excerpt --data {Path(dataset_dir).name} --frames {n_frames} {folder.name}"
    write_provenance(folder, command, SEED, ("numpy", "torch", "numba"))


def _check_place(folder: Path, dataset_dir: Path) -> None:
    """Refuse to write an excerpt where provenance of something else is or would be mixed with its own."""
    here, there = folder.resolve(), dataset_dir.resolve()
    if here.is_relative_to(there) or there.is_relative_to(here) or (folder / INDEX_FILE).exists():
        raise DataError(folder, f"a folder apart from the data set {dataset_dir}", "one that holds it or is part of it")
    if (folder / FILE_NAME).exists() and not (folder / FRAMES).exists():
        raise DataError(folder, "an empty folder, or an earlier excerpt", f"the {FILE_NAME} of something else")


def read_excerpt(folder: str | Path) -> list[Sample]:
    """Read the frames that `write_excerpt` kept.

    Parameters
    ----------
    folder : path-like
        The folder that it wrote to.

    Returns
    -------
    list of Sample

    Raises
    ------
    DataError
        When the file is missing or damaged.
    """
    path = Path(folder) / FRAMES
    _, tensors = read_tensors(path)
    try:
        return [Sample(*frame) for frame in zip(*(tensors[name] for name in Sample._fields), strict=True)]
    except (KeyError, ValueError) as error:
        raise DataError(path, f"labelled frames: {', '.join(Sample._fields)}", error) from error


def samples_problems(folder: Path | None = None) -> list[str]:
    """Check every sample against its provenance file.

    Parameters
    ----------
    folder : Path, optional
        A folder of samples, each a folder with a `provenance.json`; the shipped ones by default.

    Returns
    -------
    list of str
        One line for each file that is missing, changed or not recorded.

    Raises
    ------
    DataError
        When there is no such folder, or it holds no samples, or one has no provenance file.
    """
    folder = samples_dir() if folder is None else folder
    folders = (path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else ()
    samples = sorted(path for path in folders if not path.name.startswith("."))
    if not samples:
        raise DataError(folder, f"folders of samples, each with a {FILE_NAME}", "none")
    return [problem for sample in samples for problem in provenance_problems(sample)]
