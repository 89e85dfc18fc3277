"""Runs that train: the image network on image labels, and from there the whole network on grids (sections 3.4, 4.1)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import Subset

from semgrid_edu.datasets.training_set import Sample, TrainingSet
from semgrid_edu.workshop.paper.runs.data_runs import RECIPE_OF, ArraysRun
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.scheduler.trials import seconds_per_step
from semgrid_edu.workshop.paper.runs.variants import USUAL, Variant
from semgrid_edu.networks import WEIGHTS, Architecture, SemanticGridNet, build_net
from semgrid_edu.storage.tensors import read_tensors
from semgrid_edu.training import CHECKPOINT, TrainingParams, train
from semgrid_edu.training.distributed import first_process_first, process_group
from semgrid_edu.training.run import architecture, training_params


class TrainingRun(Run):
    """A run that trains, and does nothing else: one step per iteration."""

    iterations: int

    @property
    def is_training(self) -> bool:
        """It is."""
        return True

    @property
    def steps(self) -> int:
        """Number of training steps."""
        return self.iterations


@dataclass(frozen=True)
class ImageStageRun(TrainingRun):
    """Train an image network on the labels of pixels; it takes the place of the paper's ImageNet weights.

    Parameters
    ----------
    arrays : ArraysRun
        The frames to learn from.
    segmenter : str
        The image network, a key of `SEGMENTERS`.
    seed : int
        Seed for the initial weights, the order of the frames and their jitter.
    iterations : int
        Number of steps.
    n_frames : int, optional
        How many frames to learn from, drawn by the seed; all when left out. Fewer are a part of more.
    """

    arrays: ArraysRun
    segmenter: str = "segnet"
    seed: int = 0
    iterations: int = 500
    n_frames: int | None = None

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"image-{self.label}-{self.iterations}-seed{self.seed}"

    @property
    def label(self) -> str:
        """What tells it and the runs after it from others: data set, network, number of frames."""
        parts = [self.arrays.data.name.removeprefix("data-"), self.segmenter]
        parts += [self.arrays.preset] * (self.arrays.preset != "compact")
        return "-".join(parts + [f"{self.n_frames}frames"] * (self.n_frames is not None))

    @property
    def needs(self) -> tuple[Run, ...]:
        """The arrays."""
        return (self.arrays,)

    @property
    def pace(self) -> str:
        """It depends on the network."""
        return f"image {self.segmenter} {self.arrays.preset}"

    @property
    def architecture(self) -> Architecture:
        """The whole network, of which the image network learns."""
        usual = architecture(self.segmenter, self.arrays.preset)
        return replace(usual, label_set=RECIPE_OF[self.arrays.data.data].label_set)

    @property
    def params(self) -> TrainingParams:
        """How it is trained."""
        usual = training_params(self.arrays.preset, self.iterations)
        return replace(usual, image_iterations=self.iterations, grid_iterations=0)

    def probe(self) -> float:
        """Return the seconds of a training step, from a short trial."""
        return seconds_per_step(self.architecture, self.params, "image")

    def work(self, root: Path, device: str) -> None:
        """Train it. Parameters are those of `Run.work`."""
        with process_group(device) as chosen:
            with first_process_first():
                frames = self.arrays.frames(root)
            net = build_net(self.architecture, frames.camera, self.seed)
            train_or_resume(net, self.chosen(frames), self.folder(root), self.params, self.seed, chosen)

    def chosen(self, frames: TrainingSet) -> Sequence[Sample]:
        """Return the frames to learn from.

        Parameters
        ----------
        frames : TrainingSet
            All that there are.
        """
        if self.n_frames is None:
            return frames
        order = np.random.default_rng((self.seed, len(frames))).permutation(len(frames))
        return Subset(frames, sorted(order[: self.n_frames].tolist()))


@dataclass(frozen=True)
class GridStageRun(TrainingRun):
    """Train the whole network on grids, from an image network that is trained already.

    Parameters
    ----------
    image_stage : ImageStageRun
        The image network, its frames and its seed.
    arrays : ArraysRun
        The same frames, with the truth to learn from.
    iterations : int
        Number of steps.
    variant : Variant
        What differs from the paper's network.
    """

    image_stage: ImageStageRun
    arrays: ArraysRun
    iterations: int = 500
    variant: Variant = USUAL

    @property
    def name(self) -> str:
        """The name of its folder."""
        first = self.image_stage
        label = f"{first.label}-{self.arrays.truth}{self.variant.name}"
        return f"grid-{label}-{first.iterations}+{self.iterations}-seed{first.seed}"

    @property
    def needs(self) -> tuple[Run, ...]:
        """The image network and the arrays."""
        return self.image_stage, self.arrays

    @property
    def pace(self) -> str:
        """It depends on the network and the variant."""
        return f"grid {self.image_stage.segmenter} {self.arrays.preset}{self.variant.name}"

    @property
    def architecture(self) -> Architecture:
        """The whole network."""
        return self.variant.applied_to(self.image_stage.architecture)

    @property
    def params(self) -> TrainingParams:
        """How it is trained."""
        usual = training_params(self.arrays.preset, self.iterations, self.variant.end_to_end)
        limit = usual.weight_limit if self.variant.balanced else 1.0
        return replace(usual, image_iterations=0, weight_limit=limit)

    def probe(self) -> float:
        """Return the seconds of a training step, from a short trial."""
        return seconds_per_step(self.architecture, self.params, "grid")

    def work(self, root: Path, device: str) -> None:
        """Train it. Parameters are those of `Run.work`."""
        with process_group(device) as chosen:
            with first_process_first():
                frames = self.arrays.frames(root)
            seed = self.image_stage.seed
            net = build_net(self.architecture, frames.camera, seed)
            net.segmenter.load_state_dict(image_network(self.image_stage.folder(root) / WEIGHTS))
            train_or_resume(net, self.image_stage.chosen(frames), self.folder(root), self.params, seed, chosen)


def image_network(weights: Path) -> dict[str, torch.Tensor]:
    """Return the weights of the image network alone, which is the same whatever comes after it.

    Parameters
    ----------
    weights : Path
        The file of a whole network.

    Returns
    -------
    dict of str to Tensor
        By their names inside the image network.

    Raises
    ------
    DataError
        When the file is missing or damaged.
    """
    _, tensors = read_tensors(weights)
    return {name.removeprefix("segmenter."): part for name, part in tensors.items() if name.startswith("segmenter.")}


def train_or_resume(
    net: SemanticGridNet,
    frames: Sequence[Sample],
    folder: Path,
    params: TrainingParams,
    seed: int,
    device: torch.device,
) -> None:
    """Train a network, going on from the folder's checkpoint if there is one; a trained one stays as it is.

    Parameters
    ----------
    net, frames, folder, params, seed, device
        As `train` takes them.

    Raises
    ------
    ArgumentError
        When several processes can't share a batch evenly, or as `train` raises it.
    DataError
        When the checkpoint is damaged, or of another run.
    """
    if not (folder / WEIGHTS).exists():
        train(net, frames, folder, params, seed, resume=(folder / CHECKPOINT).exists(), device=device)
