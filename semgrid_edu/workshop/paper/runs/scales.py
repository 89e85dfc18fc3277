"""The scales at which the paper's experiments can be done (section 4)."""

from dataclasses import dataclass

from semgrid_edu.datasets.label_policies import POLICIES
from semgrid_edu.errors import ArgumentError
from semgrid_edu.workshop.paper.runs.data_runs import RECIPE_OF, ArraysRun, DataRun
from semgrid_edu.workshop.paper.runs.score_runs import ScoreRun
from semgrid_edu.workshop.paper.runs.training_runs import GridStageRun, ImageStageRun
from semgrid_edu.workshop.paper.runs.variants import USUAL, Variant


@dataclass(frozen=True)
class Scale:
    """How large the experiments are.

    Parameters
    ----------
    name : str
        What `--scale` calls it.
    kitti, chroma, synthia : str
        The data sets in place of the paper's three, keys of `RECIPE_OF`.
    chroma_routes, synthia_routes : str
        More routes to test on, for the claims.
    overturned : str
        Drives with a car that lies on its top.
    preset : str
        "compact" or "paper": networks, images and grid, see `architecture`.
    image_iterations, grid_iterations : int
        Steps of the two stages of training.
    table1_seeds, seeds : int
        Number of seeds for Table 1, and for everything else.
    policies : tuple of str
        The ways to make labels, beside the usual one, that networks learn from: keys of `POLICIES`.
    """

    name: str
    kitti: str
    chroma: str
    synthia: str
    chroma_routes: str
    synthia_routes: str
    overturned: str
    preset: str
    image_iterations: int
    grid_iterations: int
    table1_seeds: int
    seeds: int
    policies: tuple[str, ...] = tuple(name for name in POLICIES if name != "lidar")

    @property
    def frames_to_train(self) -> int:
        """Number of labelled frames that Table 1's networks learn from."""
        return sum(len(route.labelled) for route in RECIPE_OF[self.kitti].routes if route.split == "train")

    def image_stage(self, data: str, segmenter: str, seed: int, n_frames: int | None = None) -> ImageStageRun:
        """Return the run that trains an image network.

        Parameters
        ----------
        data : str
            The data set, a key of `RECIPE_OF`.
        segmenter : str
            The image network, a key of `SEGMENTERS`.
        seed : int
            Seed of the run.
        n_frames : int, optional
            How many frames it learns from; all when left out.
        """
        arrays = self.arrays(data, "train", "true")
        return ImageStageRun(arrays, segmenter, seed, self.image_iterations, n_frames)

    def grid_stage(
        self,
        data: str,
        segmenter: str,
        seed: int,
        truth: str = "lidar",
        variant: Variant = USUAL,
        n_frames: int | None = None,
    ) -> GridStageRun:
        """Return the run that trains a whole network.

        Parameters
        ----------
        data : str
            The data set, a key of `RECIPE_OF`.
        segmenter : str
            The image network, a key of `SEGMENTERS`.
        seed : int
            Seed of the run.
        truth : str
            What it learns from, see `ArraysRun`.
        variant : Variant
            What differs from the paper's network.
        n_frames : int, optional
            How many frames it learns from; all when left out.
        """
        image_stage = self.image_stage(data, segmenter, seed, n_frames)
        return GridStageRun(image_stage, self.arrays(data, "train", truth), self.grid_iterations, variant)

    def scored(
        self,
        data: str,
        segmenter: str,
        seed: int,
        truth: str = "lidar",
        variant: Variant = USUAL,
        n_frames: int | None = None,
        crf: bool = True,
    ) -> ScoreRun:
        """Return the run that scores a network on the test frames of the data that it learned from.

        Parameters
        ----------
        data, segmenter, seed, truth, variant, n_frames
            The network, as `Scale.grid_stage` takes it.
        crf : bool
            Whether the CRF is scored as well.
        """
        network = self.grid_stage(data, segmenter, seed, truth, variant, n_frames)
        return ScoreRun(network, self.arrays(data, "test", truth), crf)

    def arrays(self, data: str, split: str, truth: str) -> ArraysRun:
        """Return the run that makes the arrays of a split. Parameters are those of `ArraysRun`."""
        return ArraysRun(DataRun(data), split, truth, self.preset)


SCALES = {
    scale.name: scale
    for scale in (
        Scale(
            "quick",
            "quickkitti",
            "quickchroma",
            "quicksynthia",
            "quickchromaroutes",
            "quicksynthiaroutes",
            "quickoverturned",
            "compact",
            12,
            10,
            table1_seeds=2,
            seeds=2,
            policies=("no-cleanup", "accumulated-carved"),
        ),
        Scale(
            "reduced",
            "minikitti",
            "minichroma",
            "minisynthia",
            "chromaroutes",
            "synthiaroutes",
            "overturned",
            "compact",
            500,
            500,
            table1_seeds=5,
            seeds=3,
        ),
        Scale(
            "paper",
            "minikitti",
            "minichroma",
            "minisynthia",
            "chromaroutes",
            "synthiaroutes",
            "overturned",
            "paper",
            2000,
            2000,
            table1_seeds=5,
            seeds=3,
        ),
    )
}
"""Every scale by name."""


def scale_named(name: str) -> Scale:
    """Return a scale.

    Parameters
    ----------
    name : str
        A key of `SCALES`.

    Raises
    ------
    ArgumentError
        When there is none of that name.
    """
    if name not in SCALES:
        raise ArgumentError("--scale", f"one of {', '.join(SCALES)}", repr(name))
    return SCALES[name]
