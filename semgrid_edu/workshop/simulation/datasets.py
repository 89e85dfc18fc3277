"""Simulated stand-ins for the data sets of section 4, and the sample drive: made in parallel, resumable."""

from collections.abc import Iterator
from concurrent.futures import as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from tqdm.auto import tqdm

from semgrid_edu.datasets.index import INDEX_FILE
from semgrid_edu.datasets.kitti_raw import drive_folder
from semgrid_edu.errors import ArgumentError, DataError, check_whole
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.storage.files import LOCK, sole_writer, table_beside, write_json
from semgrid_edu.storage.provenance import versions, write_provenance
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.simulation import writer
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.calibration_files import write_calibration
from semgrid_edu.workshop.simulation.sensors.rig import KITTI_AHEAD, SAMPLE_RIG, Rig
from semgrid_edu.workshop.simulation.street.plan import RANDOM_STREET, SAMPLE_STREET, Wishes
from semgrid_edu.workshop.workplace import check_workers, workplace

FORMAT = 2
"""Version of the simulator's output. Increase it when a seed gives a different drive, so that versions don't mix."""


@dataclass(frozen=True)
class Route:
    """One drive of a data set.

    Parameters
    ----------
    split : str
        Its split, such as "train".
    n_frames : int
        Number of frames, ten a second.
    every : int
        Label every n-th frame: 1 labels all, and `n_frames` only the last.
    wishes : Wishes
        The fixed properties of the street; the rest is random.
    """

    split: str
    n_frames: int
    every: int = 1
    wishes: Wishes = RANDOM_STREET

    @property
    def labelled(self) -> range:
        """Numbers of the labelled frames."""
        return range(self.every - 1, self.n_frames, self.every)


@dataclass(frozen=True)
class DatasetRecipe:
    """The recipe of a data set. Drives are numbered from 0001, in the order of `routes`.

    Parameters
    ----------
    name : str
        Name of the data set.
    label_set : str
        Name of its label set, a key of `LABEL_SETS`.
    routes : tuple of Route
        Its drives.
    dense : bool
        Whether points come from the thinned depth image instead of the LIDAR.
    rig : Rig
        The sensors; by default KITTI's scanner.
    edition : int
        The simulator's `FORMAT`, part of the seed of each drive.
    """

    name: str
    label_set: str
    routes: tuple[Route, ...]
    dense: bool = False
    rig: Rig = KITTI_AHEAD
    edition: int = FORMAT


def read_recipes(name: str) -> dict[str, DatasetRecipe]:
    """Read the recipes of data sets from a table, by name.

    Parameters
    ----------
    name : str
        File name of the table without its suffix, such as "recipes".
    """
    recipes = {}
    for data, row in table_beside(__file__, name).items():
        routes: list[Route] = []
        for times, route, *each in row["routes"]:
            routes += [Route(**route, wishes=Wishes(**wishes)) for wishes in each] * times
        rig = {"rig": Rig()} if row.get("coarse") else {}
        recipes[data] = DatasetRecipe(data, row["label_set"], tuple(routes), row.get("dense", False), **rig)
    return recipes


RECIPES = read_recipes("recipes")
RECIPES["sample"] = DatasetRecipe(
    "sample", "KITTI-14", (Route("drive", 20, 1, SAMPLE_STREET),), rig=SAMPLE_RIG, edition=1
)
"""Numbers of frames as in the paper: KITTI 142 + 110 labelled frames, INRIA-Chroma 146 + 130 in 3 + 2 routes.
"validation" has drives like minikitti's, half as many as in its training split. It serves to tune parameters after the
network is trained. The name of a data set is part of its seed, so "validation" never repeats a drive of minikitti."""

DATA_SETS = ("minikitti", "minichroma", "minisynthia")
"""The data sets that `semgrid-edu data make all` makes."""

PACKAGES = ("numpy", "numba", "embreex", "trimesh", "pillow")
"""Packages whose version can change the drive that a seed gives."""


def make_dataset(name: str, folder: Path, seed: int = 0, workers: int = 2) -> Path:
    """Make one of the package's data sets, or resume an interrupted run, see `make_from_recipe`.

    Parameters not named here are those of `make_from_recipe`.

    Parameters
    ----------
    name : str
        One of `RECIPES`.

    Raises
    ------
    ArgumentError
        When there is no such data set.
    """
    if name not in RECIPES:
        raise ArgumentError("name", f"one of {', '.join(RECIPES)}", repr(name))
    return make_from_recipe(RECIPES[name], folder, seed, workers)


def make_from_recipe(recipe: DatasetRecipe, folder: Path, seed: int, workers: int) -> Path:
    """Make a custom data set, or resume an interrupted run.

    The same name and seed give the same bytes, however many workers or interruptions there are.

    Parameters
    ----------
    recipe : DatasetRecipe
        The recipe.
    folder : path-like
        Parent folder. The data set goes into a subfolder with the name of the recipe.
    seed : int
        Seed for all drives; not negative.
    workers : int
        Number of parallel processes, at least one.

    Returns
    -------
    Path
        The data set's folder.

    Raises
    ------
    ArgumentError
        When the seed is negative, or there are no workers or too many.
    DataError
        When the folder contains other files, data of another seed or version, or a drive with missing files; or when
        another process is writing to it.
    """
    check_whole(seed=seed)
    check_workers(workers)
    root = Path(folder).resolve() / recipe.name
    routes = {f"{k + 1:04d}": route for k, route in enumerate(recipe.routes)}
    with sole_writer(root):
        _claim(root, {"name": recipe.name, "seed": seed, "format": recipe.edition})
        write_calibration(root, recipe.rig, writer.DATE)
        writer.remove_unfinished(root / writer.DATE)
        missing = [drive for drive in routes if not drive_folder(root, writer.DATE, drive).exists()]
        missing.sort(key=lambda drive: -routes[drive].n_frames)
        made = _run(partial(_make_drive, recipe, root, seed), missing, workers)
        list(tqdm(made, recipe.name, len(routes), initial=len(routes) - len(missing), unit="drive"))
        for drive, route in routes.items():
            writer.check_complete(drive_folder(root, writer.DATE, drive), route.n_frames, route.labelled)
        index = _index(recipe, routes, seed)
        write_json(root / INDEX_FILE, index)
        write_provenance(root, index["command"], seed, PACKAGES)
    return root


def _claim(root: Path, marker: dict) -> None:
    """Claim the folder for this data set; raise an error if it contains anything else."""
    path = root / "simulation.json"
    if path.exists():
        found = read_json(path)
        if found != marker:
            raise DataError(path, f"data made with {marker}", f"{found}: choose another folder or remove this one")
    elif {path.name for path in root.iterdir()} - {LOCK}:
        raise DataError(root, "an empty folder, or one that an earlier run began", "other files")
    else:
        write_json(path, marker)


def _run(make: partial, drives: list[str], workers: int) -> Iterator[None]:
    """Make drives in parallel, or in this process when one is enough; yield after each."""
    if workers == 1 or len(drives) < 2:
        yield from map(make, drives)
        return
    with workplace(workers) as place:
        for future in as_completed([place.executor.submit(make, drive) for drive in drives]):
            yield future.result()


def _make_drive(recipe: DatasetRecipe, root: Path, seed: int, drive: str) -> None:
    """Simulate and write one drive. Its random numbers depend only on data set, seed and drive number."""
    index = int(drive) - 1
    route = recipe.routes[index]
    drive_seed = np.random.SeedSequence([seed, recipe.edition, *recipe.name.encode()], spawn_key=(index,))
    simulated = SimulatedDrive(drive_seed, route.n_frames, route.wishes, recipe.rig)
    writer.write_drive(root, drive, simulated, route.labelled, LABEL_SETS[recipe.label_set], recipe.dense)


def _index(recipe: DatasetRecipe, routes: dict[str, Route], seed: int) -> dict:
    """Return the content of dataset.json."""
    splits: dict[str, list] = {}
    for drive, route in routes.items():
        frames = [{"date": writer.DATE, "drive": drive, "frame": k} for k in route.labelled]
        splits.setdefault(route.split, []).extend(frames)
    return {
        "name": recipe.name,
        "label_set": recipe.label_set,
        "seed": seed,
        "command": f"semgrid-edu data make {recipe.name} DIR --seed {seed}",
        "versions": versions(*PACKAGES),
        "splits": splits,
    }
