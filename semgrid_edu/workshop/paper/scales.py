"""The scales at which the paper's experiments can be done, and the runs of Tables 1 to 3 (section 4)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from semgrid_edu.datasets.label_policies import POLICIES
from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import SEGMENTERS
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.paper.data_runs import ArraysRun, DataRun
from semgrid_edu.workshop.paper.published import NETWORKS
from semgrid_edu.workshop.paper.score_runs import BaselineRun, ScoreRun
from semgrid_edu.workshop.paper.training_runs import GridStageRun, ImageStageRun
from semgrid_edu.workshop.paper.variants import USUAL, Variant


@dataclass(frozen=True, kw_only=True)
class Scale:
    """How large the experiments are. What is left out is as in the scale "reduced".

    Parameters
    ----------
    name : str
        What `--scale` calls it.
    kitti, chroma, synthia : str
        The data sets in place of the paper's three, keys of `RECIPE_OF`.
    chroma_routes : str
        More routes to test on, for the claims.
    synthia_routes : str
        More routes to learn from and to test on, for the claims.
    overturned : str
        Drives with an overturned car.
    preset : str
        "compact" or "paper": networks, images and grid, see `architecture`.
    fine_cells : bool
        Whether cells have the paper's 0.2 m in any preset.
    image_iterations, grid_iterations : int
        Steps of the two stages of training.
    table1_seeds, seeds : int
        Number of seeds for Table 1, and for everything else.
    policies : tuple of str
        The ways to make labels, beside the usual one, that networks learn from: keys of `POLICIES`.
    networks : tuple of str
        The image networks of Table 1, keys of `SEGMENTERS`.
    """

    name: str
    kitti: str = "minikitti"
    chroma: str = "minichroma"
    synthia: str = "minisynthia"
    chroma_routes: str = "chromaroutes"
    synthia_routes: str = "synthiaroutes"
    overturned: str = "overturned"
    preset: str = "compact"
    fine_cells: bool = False
    image_iterations: int = 500
    grid_iterations: int = 500
    table1_seeds: int = 5
    seeds: int = 3
    policies: tuple[str, ...] = tuple(name for name in POLICIES if name != "lidar")
    networks: tuple[str, ...] = tuple(NETWORKS)

    @property
    def fine(self) -> "Scale":
        """The same with cells of 0.2 m."""
        return replace(self, fine_cells=self.preset != "paper")  # the preset "paper" has them already

    def grid_stage(
        self,
        data: str,
        segmenter: str,
        seed: int,
        truth: str = "lidar",
        *,
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
        images = self.arrays(data, "train", "true")
        image_stage = ImageStageRun(images, segmenter, seed, self.image_iterations, n_frames)
        return GridStageRun(image_stage, self.arrays(data, "train", truth), self.grid_iterations, variant)

    def scored(
        self, data: str, segmenter: str, seeds: int, truth: str = "lidar", *, crf: bool = True, **network: object
    ) -> list[ScoreRun]:
        """Return the runs that score networks on the test frames of the data that they learned from, one per seed.

        Parameters
        ----------
        data, segmenter, truth
            The network, as `Scale.grid_stage` takes it.
        seeds : int
            Number of seeds.
        crf : bool
            Whether the CRF is scored as well.
        **network
            In what else the network differs: `variant` and `n_frames` of `Scale.grid_stage`.
        """
        trained = (self.grid_stage(data, segmenter, seed, truth, **network) for seed in range(seeds))
        return [ScoreRun(one, self.arrays(data, "test", truth), crf) for one in trained]

    def arrays(self, data: str, split: str, truth: str) -> ArraysRun:
        """Return the run that makes the arrays of a split. Parameters are those of `ArraysRun`."""
        return ArraysRun(DataRun(data), split, truth, self.preset, self.fine_cells)


SCALES = {name: Scale(name=name, **row) for name, row in table_beside(__file__).items()}
"""Every scale by name, from `scales.toml`."""


def scale_named(name: str) -> Scale:
    """Return a scale.

    Parameters
    ----------
    name : str
        A key of `SCALES`. "quick+unet" is the scale "quick" whose Table 1 compares U-Net too, and so on for any image
        network that is registered in `SEGMENTERS`.

    Raises
    ------
    ArgumentError
        When there is no such scale or image network.
    """
    known, *others = name.split("+")
    if known not in SCALES:
        raise ArgumentError("--scale", f"one of {', '.join(SCALES)}", repr(known))
    for other in others:
        if other not in SEGMENTERS:
            raise ArgumentError("--scale", f"after a plus one of {', '.join(SEGMENTERS)}", repr(other))
    scale = SCALES[known]
    return replace(scale, name=name, networks=tuple(dict.fromkeys((*scale.networks, *others))))


def table1_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of Table 1: by image network one per seed.

    Parameters
    ----------
    scale : Scale
        How large they are, and which image networks are compared.
    seeds : int
        Number of seeds.
    """
    return {name: scale.scored(scale.kitti, name, seeds) for name in scale.networks}


def baselines_of(runs: Sequence[ScoreRun]) -> list[BaselineRun]:
    """Return the runs of the baselines that networks are compared with: fitted to what these learn from.

    Parameters
    ----------
    runs : sequence of ScoreRun
        The networks, one per seed.
    """
    return [BaselineRun(run.network, run.frames) for run in runs]


def table2_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of Table 2: SegNet on routes that were never driven in training.

    Parameters and result are those of `table1_runs`.
    """
    return {"segnet": scale.scored(scale.chroma, "segnet", seeds)}


def table3_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of Table 3: SegNet on data without any error.

    Parameters and result are those of `table1_runs`.
    """
    return {"segnet": scale.scored(scale.synthia, "segnet", seeds, "true", crf=False)}
