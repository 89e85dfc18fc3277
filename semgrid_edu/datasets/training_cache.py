"""What a network learns from, made once per data set and kept beside it: arrays, and labels from LIDAR (section 4).

`cached_arrays` keeps images, occupancy and the data set's own truth; `cached_labels` keeps truth to put in its place.
"""

import hashlib
import inspect
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.datasets import label_policies, training_arrays
from semgrid_edu.datasets.frames import LabelledDrive
from semgrid_edu.datasets.index import DatasetIndex
from semgrid_edu.datasets.label_policies import LidarTruth, drive_labels
from semgrid_edu.datasets.training_arrays import ArrayRecipe, drive_arrays
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.compiled import cache_folder
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import code_hash
from semgrid_edu.storage.reading import read_json
from semgrid_edu.storage.tensors import read_tensors, write_tensors
from semgrid_edu.storage.workplace import worker_pool

WORKERS = 2
"""Number of processes that work on the drives, each one drive at a time."""

RAGGED = ("return_pixels", "return_cells")
"""Arrays whose length differs from frame to frame: they lie end to end, and `return_ends` says where each ends."""

GRIDS_KEY = "truth"
"""Name of the tensor in a file of labels."""

LabelledDrives = Sequence[tuple[LabelledDrive, list[int]]]
"""The drives of a split, each with the numbers of its labelled frames, from `DatasetIndex.drives`."""


def cached_arrays(index: DatasetIndex, split: str, recipe: ArrayRecipe) -> dict[str, NDArray]:
    """Return the arrays of a split's labelled frames, which are made on first use.

    They are kept in `cache_folder`, in a folder that is named by a hash of all that decides them: the recipe, the
    code that makes them, the labelled frames, and the drives' files by name, size and time of their last change.
    (Hashing the contents of these files, about a gigabyte, at every start would take longer than reading the arrays.)
    When one of these changes, the arrays are made anew.

    Parameters
    ----------
    index : DatasetIndex
        The data set.
    split : str
        One of its splits, such as "train".
    recipe : ArrayRecipe
        Grid, image size and occupancy filter.

    Returns
    -------
    dict of str to arrays mapped from disk, read-only
        For N frames "image" (N, 3, h, w) uint8, "labels" (N, h, w) uint8, "occupancy" (N, 4, H, W) float32 and "truth"
        (N, H, W) uint8. From `seen_returns` "return_pixels" and "return_cells", whose entries from return_ends[k] to
        return_ends[k + 1] belong to frame k, and "return_ends" (N + 1,).

    Raises
    ------
    ArgumentError
        When there is no such split, or the reader isn't defined in a file.
    DataError
        When the data set, or what was kept, is damaged; or when nothing can be kept.
    """
    drives = index.drives(split)
    folder = cache_folder(index.folder or index.root) / _key(index, drives, recipe) / split
    if not folder.exists():
        _make_room(folder.parent)
        frames = in_each_drive(drive_arrays, [(*drive, recipe) for drive in drives], f"{index.name}, {split}")
        _write_arrays(_pack(frames), recipe, folder)
    return _map_arrays(folder)


def cached_labels(drives: LabelledDrives, recipe: ArrayRecipe, truth: LidarTruth, folder: Path) -> NDArray[np.uint8]:
    """Return labels of cells that are made from image labels and LIDAR, for a split's labelled frames, on first use.

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
    with _to_delete(path):
        return read_tensors(path)[1][GRIDS_KEY].numpy()


def in_each_drive(make: Callable[..., list], jobs: Sequence[tuple], what: str) -> list:
    """Make something of every labelled frame, a drive at a time, in worker processes if there are several drives.

    Parameters
    ----------
    make : callable
        (drive, numbers of its labelled frames, ...) -> a list with an entry for each of these frames.
    jobs : sequence of tuple
        The arguments of `make` for each drive.
    what : str
        What is made, for the bar that shows the progress.

    Returns
    -------
    list
        What was made of all frames, by drive.
    """
    alone = WORKERS == 1 or len(jobs) == 1
    with nullcontext() if alone else worker_pool(WORKERS) as pool:
        results = (map if alone else pool.map)(make, *zip(*jobs, strict=True))
        return [frame for drive in tqdm(results, desc=what, total=len(jobs), unit="drive") for frame in drive]


def array_code(drives: LabelledDrives, recipe: ArrayRecipe) -> list[Path]:
    """Return the modules whose code, and what they import, decides the arrays.

    Parameters
    ----------
    drives : sequence of (LabelledDrive, list of int)
        The drives; their readers may stand outside of the package.
    recipe : ArrayRecipe
        How the arrays are made. Its sensor model may stand outside of the package too.
    """
    parts = {type(recipe.params.sensor), *(type(drive) for drive, _ in drives)}
    return [Path(training_arrays.__file__), *map(_file_of, parts)]


def _file_of(part: type) -> Path:
    """Return the file that defines a class."""
    try:
        return Path(inspect.getfile(part))
    except (TypeError, OSError):
        expected = "a class in a file, whose code can be hashed and which worker processes can import"
        raise ArgumentError(part.__name__, expected, f"one of {part.__module__}") from None


def _key(index: DatasetIndex, drives: LabelledDrives, recipe: ArrayRecipe) -> str:
    """Hash what decides the arrays."""
    parts = [repr(recipe), code_hash(array_code(drives, recipe))]
    for drive, labelled in drives:
        found = {os.path.relpath(path, index.root): path.stat() for path in drive.files()}
        parts += [drive.name, repr(labelled)]
        parts += sorted(f"{path} {stat.st_size} {stat.st_mtime_ns}" for path, stat in found.items())
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def _make_room(folder: Path) -> None:
    """Make a folder for the arrays, before the work on them starts."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        expected = "a folder that can be written, for what is made of the data (`semgrid-edu --cache` takes another)"
        raise DataError(folder, expected, error.strerror) from error


def _write_arrays(arrays: dict[str, NDArray], recipe: ArrayRecipe, folder: Path) -> None:
    """Write the arrays and their manifest to a folder that appears whole or not at all."""
    unfinished = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}-"))
    try:
        for name, array in arrays.items():
            np.save(unfinished / f"{name}.npy", array, allow_pickle=False)
        shapes = {name: [str(array.dtype), *array.shape] for name, array in arrays.items()}
        write_json(unfinished / "manifest.json", {"recipe": repr(recipe), "arrays": shapes})
        unfinished.chmod(0o755)
        unfinished.replace(folder)
    except OSError:
        if not folder.exists():  # else another process was quicker
            raise
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def _pack(frames: list[dict[str, NDArray]]) -> dict[str, NDArray]:
    """Stack the arrays of all frames, or put them end to end."""
    joins = {name: np.concatenate if name in RAGGED else np.stack for name in frames[0]}
    arrays = {name: join([frame[name] for frame in frames]) for name, join in joins.items()}
    arrays["return_ends"] = np.cumsum([0, *(len(frame["return_cells"]) for frame in frames)])
    return arrays


def _map_arrays(folder: Path) -> dict[str, NDArray]:
    """Map the arrays that the manifest lists, once they are what it says."""
    with _to_delete(folder / "manifest.json") as path:
        described = {name: list(one) for name, one in read_json(path)["arrays"].items()}
    arrays = {}
    for name, expected in described.items():
        with _to_delete(folder / f"{name}.npy") as path:
            arrays[name] = np.load(path, mmap_mode="r", allow_pickle=False)
            if (found := [str(arrays[name].dtype), *arrays[name].shape]) != expected:
                raise ValueError(f"{found} in place of {expected}")
    return arrays


@contextmanager
def _to_delete(path: Path) -> Iterator[Path]:
    """Say of a damaged file that it can be made anew."""
    try:
        yield path
    except (OSError, EOFError, LookupError, ValueError, TypeError, AttributeError) as error:
        raise DataError(path, "what was made of the data (delete its folder to make it anew)", error) from error
