"""The training data, computed once per data set and cached: arrays, and labels from LIDAR (section 4)."""

import hashlib
import inspect
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.datasets import label_policies, training_arrays
from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.index import DatasetIndex, relative_path
from semgrid_edu.datasets.label_policies import LidarTruth, drive_labels
from semgrid_edu.datasets.training_arrays import ArrayRecipe, drive_arrays
from semgrid_edu.errors import ArgumentError, DataError, needed
from semgrid_edu.storage.files import atomic_path, cache_folder, check_writable
from semgrid_edu.storage.provenance import code_hash
from semgrid_edu.storage.tensors import read_arrays

WORKERS = 2
"""Number of worker processes, each of which works on one drive at a time."""

SECONDS_PER_FRAME = 0.6
"""How long the arrays of a frame take one processor: 0.6 s for PandaSet (19 scans vote), less for others."""

RAGGED = ("return_pixels", "return_cells")
"""Arrays whose length differs from frame to frame: they are concatenated, and `return_ends` says where each ends."""


def cached_arrays(
    index: DatasetIndex, split: str, recipe: ArrayRecipe, truth: LidarTruth | None = None
) -> dict[str, NDArray]:
    """Return the arrays of a split's labelled frames, which are computed on first use.

    They are cached in `cache_folder`, in files named by a hash of everything that determines them: the recipe, the
    code, the labelled frames, and the drives' files by name, size and time of the last change. (Hashing the contents of
    these files, about a gigabyte, at every start would take longer than reading the arrays.)

    Parameters
    ----------
    index : DatasetIndex
        The data set.
    split : str
        One of its splits, such as "train".
    recipe : ArrayRecipe
        Grid, image size and occupancy filter.
    truth : LidarTruth, optional
        How to make the truth from image labels and LIDAR; the data set's own truth when left out.

    Returns
    -------
    dict of str to array
        For N frames "image" (N, 3, h, w) uint8, "labels" (N, h, w) uint8, "occupancy" (N, 4, H, W) float32, "truth" and
        "true" (N, H, W) uint8: the result of `truth`, and the data set's own truth. "return_heights" (N, 2, H, W)
        float32 are from `cell_heights`. From `seen_returns` come "return_pixels" and "return_cells", whose entries from
        return_ends[k] to return_ends[k + 1] belong to frame k, and "return_ends" (N + 1,).

    Raises
    ------
    ArgumentError
        When there is no such split, or the reader isn't defined in a file.
    DataError
        When the data set or a file of the cache is damaged, or the cache can't be written.
    """
    drives = index.drives(split)
    folder = cache_folder(index.folder or index.root)
    filter_module = recipe.track.__module__
    decided_by = [repr(recipe._replace(track=filter_module)), *_code_and_files(index, drives, recipe)]

    def make_arrays() -> dict[str, NDArray]:
        n_frames = sum(max(frames) + 1 for _, frames in drives)
        minutes = n_frames * SECONDS_PER_FRAME / min(WORKERS, len(drives)) / 60
        tqdm.write(f"{index.name}, {split}: {n_frames} frames to prepare, once, about {max(minutes, 0.1):.1f} minutes")
        jobs = [(drive, frames, recipe) for drive, frames in drives]
        return _pack(in_each_drive(drive_arrays, jobs, f"{index.name}, {split}"))

    arrays = _cached(folder, split, decided_by, make_arrays)
    arrays["true"] = arrays["truth"]
    if truth is None:
        return arrays

    def make_labels() -> dict[str, NDArray]:
        jobs = [(drive, frames, recipe, truth, number) for number, (drive, frames) in enumerate(drives)]
        return {"truth": np.stack(in_each_drive(drive_labels, jobs, f"{index.name}, {split}: labels from LIDAR"))}

    label_code = [Path(label_policies.__file__), *([_file_of(type(truth.flaws))] if truth.flaws else [])]
    decided_by += [repr(truth), code_hash(label_code)]
    return arrays | _cached(folder, f"{split}-labels", decided_by, make_labels)


def _cached(
    folder: Path, name: str, decided_by: Sequence[str], make: Callable[[], dict[str, NDArray]]
) -> dict[str, NDArray]:
    """Read the arrays cached under a name and the hash of what determines them, or make and cache them."""
    key = hashlib.sha256("\n".join(decided_by).encode()).hexdigest()[:16]
    path = folder / f"{name}-{key}.npz"
    if not path.exists():
        try:
            check_writable(path)  # before the work, which takes minutes
        except (OSError, DataError) as error:
            expected = "a folder that can be written, for what is computed from the data (`semgrid-edu --cache`)"
            found = error.strerror if isinstance(error, OSError) else error.args[2]
            raise DataError(folder, expected, found) from error
        arrays = make()
        with atomic_path(path) as temporary:
            np.savez(temporary, allow_pickle=False, **arrays)
    try:
        return read_arrays(path)
    except DataError as error:
        raise DataError(path, "arrays computed from the data (delete the file to compute them again)", error) from error


def in_each_drive(make: Callable[..., list], jobs: Sequence[tuple], what: str) -> list:
    """Call a function for every drive, in worker processes, and concatenate its results.

    Parameters
    ----------
    make : callable
        (drive, numbers of its labelled frames, ...) -> a list with an entry for each of these frames.
    jobs : sequence of tuple
        The arguments of `make` for each drive.
    what : str
        What is made, for the progress bar.

    Returns
    -------
    list
        The entries of all frames, drive by drive.
    """
    joblib = needed("joblib")
    workers = min(WORKERS, len(jobs))
    results = joblib.Parallel(n_jobs=workers, return_as="generator")(joblib.delayed(make)(*job) for job in jobs)
    return [frame for frames in tqdm(results, desc=what, total=len(jobs), unit="drive") for frame in frames]


def _code_and_files(
    index: DatasetIndex, drives: Sequence[tuple[FrameSequence, list[int]]], recipe: ArrayRecipe
) -> list[str]:
    """Describe the code that makes the arrays, and the drives' files by name, size and time of the last change."""
    readers = {type(drive) for drive, _ in drives}  # these, and the sensor model, may be outside the package
    parts_of_others = {*readers, type(recipe.params.sensor), recipe.track}
    modules = [Path(training_arrays.__file__), *map(_file_of, parts_of_others)]
    parts = [code_hash(modules)]
    for drive, labelled in drives:
        found = {relative_path(path, index.root): path.stat() for path in drive.files()}
        parts += [drive.name, repr(labelled)]
        parts += sorted(f"{path} {stat.st_size} {stat.st_mtime_ns}" for path, stat in found.items())
    return parts


def _file_of(part: type | Callable) -> Path:
    """Return the file that defines a class or a function."""
    try:
        return Path(inspect.getfile(part))
    except (TypeError, OSError):
        expected = "a class in a file, whose code can be hashed and which worker processes can import"
        raise ArgumentError(part.__name__, expected, f"one of {part.__module__}") from None


def _pack(frames: list[dict[str, NDArray]]) -> dict[str, NDArray]:
    """Stack the arrays of all frames; concatenate the ragged ones."""
    joins = {name: np.concatenate if name in RAGGED else np.stack for name in frames[0]}
    arrays = {name: join([frame[name] for frame in frames]) for name, join in joins.items()}
    arrays["return_ends"] = np.cumsum([0, *(len(frame["return_cells"]) for frame in frames)])
    return arrays
