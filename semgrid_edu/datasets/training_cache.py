"""The arrays that a network learns from, made once per data set, kept beside it and mapped from disk (section 4.1).

Images and their labels with fewer pixels, as a coarser sensor would have taken them (section 4.1).
"""

import hashlib
import shutil
import tempfile
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from tqdm.auto import tqdm

import semgrid_edu
from semgrid_edu.datasets.doubts import check_label_sets
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.index import INDEX_FILE, DatasetIndex
from semgrid_edu.datasets.readers.kitti_raw import KittiRawDrive, drive_folder
from semgrid_edu.datasets.readers.project_lidar import seen_returns
from semgrid_edu.errors import DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import CmcdotParams, track_drive
from semgrid_edu.storage.compiled import cache_folder
from semgrid_edu.storage.files import sha256, write_json
from semgrid_edu.storage.reading import read_json
from semgrid_edu.storage.workplace import worker_pool


def resize_image(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Average an image over larger pixels; its calibration becomes `camera.resized(size)`.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB.
    size : (int, int)
        The new height and width, pixels.

    Returns
    -------
    (*size, 3) uint8
    """
    return np.asarray(Image.fromarray(image).resize(size[::-1], Image.Resampling.BOX))


def resize_labels(labels: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Give each larger pixel the class that covers most of it; between two equal shares the smaller number wins.

    Parameters
    ----------
    labels : (h, w) uint8
        The class of each pixel; 255 (unlabelled) counts as a class.
    size : (int, int)
        The new height and width, pixels.

    Returns
    -------
    (*size,) uint8
    """
    classes = np.unique(labels)
    masks = (Image.fromarray((labels == c).astype(np.float32)) for c in classes)
    shares = [np.asarray(mask.resize(size[::-1], Image.Resampling.BOX)) for mask in masks]
    return classes[np.argmax(shares, axis=0)]


SEED = 0
"""Seed for the particles of the occupancy filter, in each drive."""

CODE = (
    *("camera", "frame", "grid", "labels", "storage/reading"),
    *(f"datasets/{name}" for name in ("calibration", "kitti_labels", "kitti_raw", "oxts", "resizing")),
    *(f"datasets/{name}" for name in ("returns", "timestamps", "training_cache", "truth")),
)
"""The modules that decide the arrays, beside all of occupancy/."""

WORKERS = 2
"""Number of processes that make the arrays, each one drive at a time."""

RAGGED = ("return_pixels", "return_cells")
"""Arrays whose length differs from frame to frame: they lie end to end, and `return_ends` says where each ends."""


class ArrayRecipe(NamedTuple):
    """How the arrays are made.

    Parameters
    ----------
    spec : GridSpec
        The grid of occupancy and truth.
    image_size : (int, int)
        Height and width of the resized images, pixels.
    params : CmcdotParams
        Parameters of the occupancy filter.
    """

    spec: GridSpec
    image_size: tuple[int, int]
    params: CmcdotParams


def cached_arrays(index: DatasetIndex, split: str, recipe: ArrayRecipe) -> dict[str, NDArray]:
    """Return the arrays of a split's labelled frames, which are made on first use.

    They are kept in `cache_folder`, in a folder that is named by a hash of all that decides them: the recipe,
    the code that makes them, dataset.json, and the drives' files by name, size and time of their last change. (Hashing
    the contents of these files, about a gigabyte, at every start would take longer than reading the arrays.) When one
    of these changes, the arrays are made anew.

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
        When there is no such split.
    DataError
        When the data set, or what was kept, is damaged; or when nothing can be kept.
    """
    check_label_sets(index, split)
    folder = cache_folder(index.root) / _key(index, split, recipe) / split
    if not folder.exists():
        _make_room(folder.parent)
        _write_arrays(_pack(_process(index, split, recipe)), recipe, folder)
    return _map_arrays(folder)


def _key(index: DatasetIndex, split: str, recipe: ArrayRecipe) -> str:
    """Hash what decides the arrays: the recipe, the code, and names, sizes and times of all files of the drives."""
    package = Path(semgrid_edu.__file__).parent
    code = [package / f"{name}.py" for name in CODE] + sorted((package / "occupancy").glob("*.py"))
    drives = index.frames_by_drive(split)
    calibration = [path for date in {date for date, _ in drives} for path in (index.root / date).glob("*.txt")]
    parts = [repr(recipe), *map(sha256, [index.root / INDEX_FILE, *code, *sorted(calibration)])]
    for date, drive in drives:
        files = {
            file.relative_to(index.root): file.stat() for file in drive_folder(index.root, date, drive).rglob("*.*")
        }
        parts += sorted(f"{name} {found.st_size} {found.st_mtime_ns}" for name, found in files.items())
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def _make_room(folder: Path) -> None:
    """Make a folder for the arrays, before the work on them starts."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        expected = "a folder that can be written, for what is made of the data (`semgrid-edu --cache` takes another)"
        raise DataError(folder, expected, error.strerror) from error


def _process(index: DatasetIndex, split: str, recipe: ArrayRecipe) -> list[dict[str, NDArray]]:
    """Make the arrays of every labelled frame of a split."""
    jobs = [(index.root, *name, labelled, recipe) for name, labelled in index.frames_by_drive(split).items()]
    with worker_pool(WORKERS) as pool:
        drives = pool.map(_process_drive, *zip(*jobs, strict=True))
        progress = tqdm(drives, desc=f"{index.name}, {split}", total=len(jobs), unit="drive")
        return [frame for drive in progress for frame in drive]


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


def _process_drive(
    root: Path, date: str, drive: str, labelled: list[int], recipe: ArrayRecipe
) -> list[dict[str, NDArray]]:
    """Run the filter over a drive and make the arrays of its labelled frames, in the order of `labelled`."""
    scans = islice(KittiRawDrive(root, date, drive, images=False), max(labelled) + 1)
    beliefs = enumerate(track_drive(scans, recipe.spec, recipe.params, SEED))
    occupancy = {k: belief.probability for k, belief in beliefs if k in labelled}
    frames = KittiRawDrive(root, date, drive)
    if max(labelled) >= len(frames):
        raise DataError(frames.folder, f"the frame {max(labelled)} that {INDEX_FILE} lists", f"{len(frames)} frames")
    return [_process_frame(frames, k, occupancy[k], recipe) for k in labelled]


def _process_frame(drive: KittiRawDrive, k: int, occupancy: NDArray, recipe: ArrayRecipe) -> dict[str, NDArray]:
    """Make the arrays of one frame."""
    frame = drive[k]
    if frame.labels is None or frame.image is None:
        missing = "image" if frame.image is None else "labels"
        raise DataError(drive.folder, f"image and labels of the frame {k} that {INDEX_FILE} lists", f"no {missing}")
    pixels, cells = seen_returns(frame, recipe.spec, recipe.image_size)
    return {
        "image": resize_image(frame.image, recipe.image_size).transpose(2, 0, 1),
        "labels": resize_labels(frame.labels.image, recipe.image_size),
        "occupancy": occupancy.astype(np.float32),
        "truth": grid_truth(frame.labels, occupancy, recipe.spec),
        "return_pixels": pixels,
        "return_cells": cells,
    }


def _pack(frames: list[dict[str, NDArray]]) -> dict[str, NDArray]:
    """Stack the arrays of all frames, or put them end to end."""
    joins = {name: np.concatenate if name in RAGGED else np.stack for name in frames[0]}
    arrays = {name: join([frame[name] for frame in frames]) for name, join in joins.items()}
    arrays["return_ends"] = np.cumsum([0, *(len(frame["return_cells"]) for frame in frames)])
    return arrays


def _map_arrays(folder: Path) -> dict[str, NDArray]:
    """Map the arrays that the manifest lists, once they are what it says."""
    manifest = read_json(folder / "manifest.json").get("arrays")
    if not isinstance(manifest, dict) or not all(isinstance(one, list) and one for one in manifest.values()):
        expected = "type and shape of each array (delete the folder to make it anew)"
        raise DataError(folder / "manifest.json", expected, repr(manifest)[:200])
    arrays = {}
    for name, described in manifest.items():
        path = folder / f"{name}.npy"
        if not path.is_file():
            raise DataError(path, "an array (delete the folder to make it anew)", "no such file")
        try:
            arrays[name] = np.load(path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            raise DataError(path, "an array (delete the folder to make it anew)", error) from error
        found = [str(arrays[name].dtype), *arrays[name].shape]
        if found != described:
            raise DataError(path, f"{described} (delete the folder to make it anew)", found)
    return arrays
