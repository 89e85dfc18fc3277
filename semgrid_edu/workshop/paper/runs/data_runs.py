"""Runs that make data: a simulated data set, and the arrays of one of its splits (section 4).

Runs that count how wrong the labels are that networks learn from (section 4).
"""

from dataclasses import dataclass
from pathlib import Path
from semgrid_edu.workshop.paper.runs.counting import CountingRun, GridCounts
from semgrid_edu.workshop.scheduler.runs import Run
from dataclasses import dataclass
from pathlib import Path
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.simulation.datasets import RECIPES, DatasetRecipe, Route, make_from_recipe
from semgrid_edu.workshop.simulation.street.road_users import overturned_car
from semgrid_edu.workshop.simulation.street.plan import Wishes
from semgrid_edu.training.run import architecture, chosen_truth

def _short(split: str, layout: str, n_frames: int = 6) -> Route:
    """Return a route of a few frames, all labelled."""
    return Route(split, n_frames, True, Wishes(layout=layout, speed=10.0))


def _routes(number: int, n_frames: int) -> tuple[Route, ...]:
    """Return short routes to test on, through a junction and a bend in turn."""
    return tuple(_short("test", ("junction", "bend")[k % 2], n_frames) for k in range(number))


SMALL_RECIPES = {
    recipe.name: recipe
    for recipe in (
        DatasetRecipe("quickkitti", "KITTI-14", (Route("train", 5, False),) * 18 + (Route("test", 5, False),) * 8),
        DatasetRecipe(
            "quickchroma",
            "KITTI-14",
            (_short("train", "junction"), _short("train", "bend"), _short("test", "junction"), _short("test", "bend")),
        ),
        DatasetRecipe(
            "quicksynthia", "SYNTHIA-10", (_short("train", "junction", 8), _short("test", "junction", 8)), dense=True
        ),
        DatasetRecipe("chromaroutes", "KITTI-14", _routes(20, 10)),
        DatasetRecipe("synthiaroutes", "SYNTHIA-10", _routes(20, 10), dense=True),
        DatasetRecipe("overturned", "KITTI-14", (Route("test", 10, False, Wishes(cast=overturned_car)),) * 30),
        DatasetRecipe("quickoverturned", "KITTI-14", (Route("test", 4, False, Wishes(cast=overturned_car)),) * 4),
        DatasetRecipe("quickchromaroutes", "KITTI-14", _routes(3, 2)),
        DatasetRecipe("quicksynthiaroutes", "SYNTHIA-10", _routes(3, 2), dense=True),
    )
}
"""Data sets like minikitti, minichroma and minisynthia, small enough to be made in a minute. More routes to test on,
because two routes, or one, say little about how routes differ. And drives in each of which a car lies on its top."""

RECIPE_OF = RECIPES | SMALL_RECIPES
"""Every data set that a run can make, by name."""


@dataclass(frozen=True)
class DataRun(Run):
    """Simulate a data set.

    Parameters
    ----------
    data : str
        Its name, a key of `RECIPE_OF`.
    seed : int
        Seed for its drives.
    """

    data: str
    seed: int = 0

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"data-{self.data}" + (f"-seed{self.seed}" if self.seed else "")

    @property
    def steps(self) -> int:
        """Number of frames, of which each is simulated."""
        return sum(route.n_frames for route in RECIPE_OF[self.data].routes)

    @property
    def pace(self) -> str:
        """Frames of all data sets take about the same time."""
        return "simulate"

    def probe(self) -> float:
        """Return the seconds that a frame took on one core when this was written."""
        return 0.2

    def work(self, root: Path, device: str) -> None:
        """Make the data set. Parameters are those of `Run.work`."""
        make_from_recipe(RECIPE_OF[self.data], self.folder(root), self.seed, workers=1)

    def dataset_dir(self, root: str | Path) -> Path:
        """Return the folder of the data set itself.

        Parameters
        ----------
        root : path-like
            The folder of all runs.
        """
        return self.folder(root) / self.data


@dataclass(frozen=True)
class ArraysRun(Run):
    """Make the arrays of a split, which networks learn from and are scored on: images, occupancy grids, truth.

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
    """

    data: DataRun
    split: str
    truth: str = "true"
    preset: str = "compact"

    @property
    def name(self) -> str:
        """The name of its folder, which holds no arrays: they lie in the cache of the data set."""
        parts = ["arrays", self.data.name.removeprefix("data-"), self.split, self.truth]
        return "-".join(parts + [self.preset] * (self.preset != "compact"))

    @property
    def needs(self) -> tuple[Run, ...]:
        """The data set."""
        return (self.data,)

    @property
    def steps(self) -> int:
        """Number of frames of the split, over which the occupancy filter runs."""
        return sum(route.n_frames for route in RECIPE_OF[self.data.data].routes if route.split == self.split)

    @property
    def n_labelled(self) -> int:
        """Number of labelled frames, which `frames` returns."""
        return sum(len(route.labelled) for route in RECIPE_OF[self.data.data].routes if route.split == self.split)

    @property
    def pace(self) -> str:
        """It depends on the size of the grid."""
        return f"arrays {self.preset}"

    def probe(self) -> float:
        """Return the seconds that a frame took on one core when this was written."""
        return 0.1 if self.preset == "compact" else 0.5

    def work(self, root: Path, device: str) -> None:
        """Make the arrays. Parameters are those of `Run.work`."""
        self.frames(root)

    def frames(self, root: str | Path) -> TrainingSet:
        """Return the frames of the split.

        Parameters
        ----------
        root : path-like
            The folder of all runs.

        Returns
        -------
        TrainingSet

        Raises
        ------
        DataError
            When the data set is missing or damaged.
        """
        usual, truth = architecture("segnet", self.preset), chosen_truth(self.truth)
        return TrainingSet(self.data.dataset_dir(root), self.split, usual.grid, usual.image_size, truth=truth)


LABELS = "labels"
"""The method: the labels themselves, counted like the grids of a network."""


@dataclass(frozen=True)
class LabelsRun(CountingRun):
    """Count the labels of a split against the true ones, and against those that are made in the usual way.

    Parameters
    ----------
    labels : ArraysRun
        The labels to count.
    usual : ArraysRun
        The same frames with the usual labels, made with the LIDAR.
    """

    labels: ArraysRun
    usual: ArraysRun

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"labels-{self.labels.name.removeprefix('arrays-')}"

    @property
    def needs(self) -> tuple[Run, ...]:
        """Both kinds of labels."""
        return self.labels, self.usual

    @property
    def steps(self) -> int:
        """Number of labelled frames."""
        return self.labels.n_labelled

    @property
    def pace(self) -> str:
        """It depends on the size of the grid."""
        return f"labels {self.labels.preset}"

    def probe(self) -> float:
        """Return the seconds that a frame took on one core when this was written."""
        return 0.01 if self.labels.preset == "compact" else 0.1

    def work(self, root: Path, device: str) -> None:
        """Count them. Parameters are those of `Run.work`."""
        labels, usual = self.labels.frames(root), self.usual.frames(root)
        counted = GridCounts(usual)
        for k in range(len(usual)):
            counted.add(LABELS, k, labels.arrays["truth"][k])
        counted.write(self.folder(root))
