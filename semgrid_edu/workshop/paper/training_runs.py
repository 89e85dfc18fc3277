"""Runs that train: the image network on image labels, and from there the whole network on grids (sections 3.4, 4.1)."""

import time
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import Subset

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.training_set import Sample, TrainingSet
from semgrid_edu.fast import build_net, load_net
from semgrid_edu.fast.allocator import keep_freed_memory
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks import WEIGHTS, Architecture, SemanticGridNet
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.storage.tensors import read_tensors
from semgrid_edu.training import Objective, TrainingParams, train
from semgrid_edu.training.batches import Batch
from semgrid_edu.training.devices import open_fabric
from semgrid_edu.training.loop import learn
from semgrid_edu.workshop.paper.data_runs import ArraysRun
from semgrid_edu.workshop.paper.run import Run, few_threads
from semgrid_edu.workshop.paper.variants import USUAL, Variant
from semgrid_edu.workshop.simulation.sensors.rig import Rig
from semgrid_edu.workshop.training_run import architecture, training_params

TIMED_STEPS = 2
"""Number of steps that a trial times, after one that it doesn't."""


class TrainingRun(Run):
    """A run that trains a network on `arrays`, one step per iteration, described by `architecture` and `params`."""

    is_training = True
    steps = property(lambda self: self.iterations)
    trial_seconds = property(lambda self: seconds_per_step(self.architecture, self.params, self.kind))

    @abstractmethod
    def net(self, root: Path, camera: Camera) -> SemanticGridNet:
        """Return the network before its first step.

        Parameters
        ----------
        root : Path
            The folder of all runs.
        camera : Camera
            The camera of the frames.
        """

    def work(self, root: Path, device: str) -> None:
        """Train, from a checkpoint if there is one. Parameters are those of `Run.work`."""
        keep_freed_memory()
        folder = self.folder(root)
        frames = self.arrays.frames(root)
        if not (folder / WEIGHTS).exists():
            net = self.net(root, frames.camera)
            train(net, self.chosen(frames), folder, self.params, self.seed, True, open_fabric(device))

    def has_ended(self, root: str | Path) -> bool:
        """Return whether the network is there. Parameters are those of `Run.folder`."""
        return super().has_ended(root) and (self.folder(root) / WEIGHTS).exists()

    def trained(self, root: Path, camera: Camera) -> SemanticGridNet:
        """Return the network after its last step. Parameters are those of `TrainingRun.net`."""
        return load_net(self.folder(root) / WEIGHTS, camera)


def seconds_per_step(described: Architecture, params: TrainingParams, stage: str) -> float:
    """Return how long a training step takes on this machine's CPU, tried on grey frames, seconds.

    Parameters
    ----------
    described : Architecture
        The network.
    params : TrainingParams
        How it is trained.
    stage : str
        "image" or "grid".
    """
    net = build_net(described, Rig().camera).train()
    size = described.image_size
    shape = described.grid.shape
    n = params.batch_size
    image = torch.full((n, 3, *size), 0.5)
    occupancy = torch.full((n, N_STATES, *shape), 1 / N_STATES)
    labels, truth = (torch.zeros((n, *part), dtype=torch.uint8) for part in (size, shape))
    batch = Batch(Sample(image, labels, occupancy, truth), mirrored=False)
    optimiser = torch.optim.SGD(net.parameters(), lr=1e-6, momentum=params.momentum)
    fabric = open_fabric("cpu")
    objective = fabric.setup_module(Objective(net, stage, torch.ones(len(LABEL_SETS[described.label_set]))))
    with few_threads():
        learn(fabric, objective, optimiser, batch)
        began = time.perf_counter()
        for _ in range(TIMED_STEPS):
            learn(fabric, objective, optimiser, batch)
    return (time.perf_counter() - began) / TIMED_STEPS


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
    kind = "image"
    tag = property(lambda self: f"{self.label}-{self.iterations}-seed{self.seed}")
    pace = property(lambda self: f"image {self.segmenter} {self.arrays.built}")

    @property
    def label(self) -> str:
        """Its part in the names of later runs: data set, network, number of frames."""
        fewer = "" if self.n_frames is None else f"-{self.n_frames}frames"
        return f"{self.arrays.data.tag}-{self.segmenter}{self.arrays.size}{fewer}"

    @property
    def architecture(self) -> Architecture:
        """The whole network; this run trains its image network."""
        usual = architecture(self.segmenter, self.arrays.preset)
        return replace(usual, label_set=self.arrays.data.recipe.label_set, grid=self.arrays.grid)

    @property
    def params(self) -> TrainingParams:
        """How it is trained."""
        usual = training_params(self.arrays.preset, self.iterations)
        return replace(usual, image_iterations=self.iterations, grid_iterations=0)

    def net(self, root: Path, camera: Camera) -> SemanticGridNet:
        """Return a network with random weights. Parameters are those of `TrainingRun.net`."""
        return build_net(self.architecture, camera, self.seed)

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
    kind = "grid"
    pace = property(lambda self: f"grid {self.image_stage.segmenter} {self.arrays.built}{self.variant.name}")
    seed = property(lambda self: self.image_stage.seed)
    chosen = property(lambda self: self.image_stage.chosen)  # the frames that its image network learned from

    @property
    def tag(self) -> str:
        """Data, labels, variant, steps and seed."""
        first = self.image_stage
        label = f"{first.label}-{self.arrays.truth}{self.variant.name}"
        return f"{label}-{first.iterations}+{self.iterations}-seed{self.seed}"

    @property
    def architecture(self) -> Architecture:
        """The whole network."""
        return self.variant.applied_to(self.image_stage.architecture)

    @property
    def params(self) -> TrainingParams:
        """How it is trained."""
        usual = training_params(self.arrays.preset, self.iterations)
        limit = usual.weight_limit if self.variant.balanced else 1.0
        return replace(usual, image_iterations=0, weight_limit=limit, end_to_end=self.variant.end_to_end)

    def net(self, root: Path, camera: Camera) -> SemanticGridNet:
        """Return a network whose image network is trained already. Parameters are those of `TrainingRun.net`."""
        net = build_net(self.architecture, camera, self.seed)
        # The file is that of the usual network; of its weights, those of the image network fit every variant.
        _, tensors = read_tensors(self.image_stage.folder(root) / WEIGHTS)
        own = "segmenter."
        learnt = {name.removeprefix(own): part for name, part in tensors.items() if name.startswith(own)}
        net.segmenter.load_state_dict(learnt)
        return net


@dataclass(frozen=True)
class NetworkRun(Run):
    """A run that looks at a trained network on the frames of a split.

    Parameters
    ----------
    network : GridStageRun
        The run that trains the network.
    frames : ArraysRun
        The frames; with labels made with the LIDAR, these and the true ones are what grids are compared with.
    """

    network: GridStageRun
    frames: ArraysRun

    tag = property(lambda self: f"{self.network.tag}-on-{self.frames.tag}")
    steps = property(lambda self: self.frames.n_labelled)
    pace = property(lambda self: f"{self.kind} {self.frames.built}")
    segmenter = property(lambda self: self.network.image_stage.segmenter)
