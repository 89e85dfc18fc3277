"""Runs that make data: a simulated data set, and the arrays of one of its splits (section 4)."""

from dataclasses import dataclass
from pathlib import Path

from semgrid_edu.datasets.index import INDEX_FILE
from semgrid_edu.fast import TrainingSet
from semgrid_edu.grid import GridSpec
from semgrid_edu.workshop.paper.run import Run
from semgrid_edu.workshop.simulation.datasets import RECIPES, make_from_recipe, read_recipes
from semgrid_edu.workshop.training_run import architecture, chosen_truth

RECIPE_OF = RECIPES | read_recipes("small_recipes")
"""Every data set that a run can make, by name."""


@dataclass(frozen=True)
class DataRun(Run):
    """Simulate a data set.

    Parameters
    ----------
    data : str
        Its name, a key of `RECIPE_OF`.
    """

    data: str
    kind, pace, trial_seconds = "data", "simulate", 0.2
    tag = property(lambda self: self.data)
    recipe = property(lambda self: RECIPE_OF[self.data])
    steps = property(lambda self: sum(route.n_frames for route in self.recipe.routes))

    def work(self, root: Path, device: str) -> None:
        """Make the data set. Parameters are those of `Run.work`."""
        make_from_recipe(self.recipe, self.folder(root), seed=0, workers=1)

    def has_ended(self, root: str | Path) -> bool:
        """Return whether the data are there. Parameters are those of `Run.folder`."""
        return super().has_ended(root) and (self.dataset_dir(root) / INDEX_FILE).exists()

    def dataset_dir(self, root: str | Path) -> Path:
        """Return the folder of the data set itself. Parameters are those of `Run.folder`."""
        return self.folder(root) / self.data


@dataclass(frozen=True)
class ArraysRun(Run):
    """Make the arrays of a split, which networks learn from and are scored on: images, occupancy grids, truth.

    The occupancy filter runs over all frames of the split; `n_labelled` of them have a truth. The arrays themselves are
    in the cache of the data set.

    Parameters
    ----------
    data : DataRun
        The data set.
    split : str
        One of its splits, such as "train".
    truth : str
        "true" for the simulator's labels, "lidar" for labels made with the LIDAR as the paper makes them, or another
        key of `POLICIES`.
    preset : str
        "compact" or "paper": decides the grid and the size of the images, see `architecture`.
    fine : bool
        Whether the cells have the paper's 0.2 m in any preset.
    """

    data: DataRun
    split: str
    truth: str = "true"
    preset: str = "compact"
    fine: bool = False
    kind = "arrays"
    # The part of the name that says so.
    size = property(lambda self: f"-{self.preset}" * (self.preset != "compact") + "-fine" * self.fine)
    tag = property(lambda self: f"{self.data.tag}-{self.split}-{self.truth}{self.size}")
    built = property(lambda self: self.preset + "-fine" * self.fine)  # what the time of a step depends on
    pace = property(lambda self: f"arrays {self.built}")
    trial_seconds = property(lambda self: 0.5 if self.size else 0.1)
    grid = property(lambda self: GridSpec.paper() if self.fine else architecture("segnet", self.preset).grid)
    routes = property(lambda self: [route for route in self.data.recipe.routes if route.split == self.split])
    steps = property(lambda self: sum(route.n_frames for route in self.routes))
    n_labelled = property(lambda self: sum(len(route.labelled) for route in self.routes))

    def work(self, root: Path, device: str) -> None:
        """Make the arrays. Parameters are those of `Run.work`."""
        self.frames(root)

    def has_ended(self, root: str | Path) -> bool:
        """Return whether the arrays are there, which go with the data. Parameters are those of `Run.folder`."""
        return super().has_ended(root) and self.data.has_ended(root)

    def frames(self, root: str | Path) -> TrainingSet:
        """Return the frames of the split. Parameters are those of `Run.folder`.

        Raises
        ------
        DataError
            When the data set is missing or damaged.
        """
        usual = architecture("segnet", self.preset)
        truth = chosen_truth(self.truth)
        return TrainingSet(self.data.dataset_dir(root), self.split, self.grid, usual.image_size, truth=truth)


def frame_counts(data: str) -> dict[str, tuple[int, int]]:
    """Return by split the numbers of labelled frames and of drives of a data set.

    Parameters
    ----------
    data : str
        A key of `RECIPE_OF`.
    """
    labelled: dict[str, list[int]] = {}
    for route in RECIPE_OF[data].routes:
        labelled.setdefault(route.split, []).append(len(route.labelled))
    return {split: (sum(frames), len(frames)) for split, frames in labelled.items()}
