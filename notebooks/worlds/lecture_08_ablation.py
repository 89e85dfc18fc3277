"""What the fusion network needs: one part switched off at a time, scored on streets that nothing has learned from.

In the folder notebooks, `python -m worlds.lecture_08_ablation ../docs/results/fusion_ablation.json` measures it: the
networks of lecture 08, trained by its loop on its six frames, and its table, on simulated streets.
"""

import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
import typer
from numpy.typing import NDArray
from torch import Tensor, nn
from tqdm.auto import tqdm

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.samples import sample_drive, sample_image_stage
from semgrid_edu.fast import load_net, track_drive
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.networks import FusionNet, SemanticGridNet
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.pipeline import network_image
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.training import median_frequency_weights
from semgrid_edu.workshop.simulation import simulate
from worlds.lecture_04_scenes import labelled_frame
from worlds.lecture_08_gains import N_SEMANTIC, scores, written
from worlds.lecture_08_street import SPEC, Streets, confusions, ground_labels, named, streets, training_streets

FIRST = 700
"""Seed of the first new street; the data sets' streets have other seeds."""

FRAMES_BEFORE = 4
"""Scans that the filter sees before the labelled frame of a street."""


class Variant(NamedTuple):
    """One way to build and train the network.

    Parameters
    ----------
    n_planes : int
        How many planes it sees, from the ground on.
    neighbours : bool
        Whether it may look at the cells around; if not, all its layers are 1x1.
    occupancy : bool
        Whether it sees the occupancy grid.
    balanced : bool
        Whether classes are weighted by median frequency, within the package's limit of 4.
    width : int
        Channels of the hidden layers of a network without neighbours; with 448 it has as many weights as one with.
    """

    n_planes: int = 20
    neighbours: bool = True
    occupancy: bool = True
    balanced: bool = False
    width: int = 64


VARIANTS = {
    "ground plane, one cell": Variant(n_planes=1, neighbours=False),
    "20 planes, one cell": Variant(neighbours=False),
    "20 planes, one cell, wide": Variant(neighbours=False, width=448),
    "ground plane, neighbours": Variant(n_planes=1),
    "20 planes, neighbours": Variant(),
    "20 planes, neighbours, no o": Variant(occupancy=False),
    "20 planes, neighbours, balanced": Variant(balanced=True),
}
"""What is compared, by name."""


class OneCell(nn.Module):
    """A fusion network without neighbours: the reduction and three more 1x1 convolutions.

    Parameters
    ----------
    n_planes : int
        Number of planes.
    n_classes : int
        Number of classes.
    width : int
        Channels of its two hidden layers.
    """

    def __init__(self, n_planes: int, n_classes: int, width: int) -> None:
        super().__init__()
        self.reduce = FusionNet(n_classes, n_planes, n_classes).reduce
        layers = []
        for n_in in (16 + N_STATES, width):
            layers += [nn.Conv2d(n_in, width, 1), nn.BatchNorm2d(width), nn.ReLU()]
        self.layers = nn.Sequential(*layers, nn.Conv2d(width, n_classes, 1))

    def forward(self, planes: Tensor, occupancy: Tensor) -> Tensor:
        """Return the logits. Parameters are those of `FusionNet.forward`."""
        return self.layers(torch.cat([self.reduce(planes)[:, :, 0], occupancy], dim=1))


def build(variant: Variant, seed: int) -> nn.Module:
    """Return the network of a variant with the weights of a seed.

    Parameters
    ----------
    variant : Variant
        The variant.
    seed : int
        Seed for the first weights.
    """
    torch.manual_seed(seed)
    if variant.neighbours:
        return FusionNet(14, variant.n_planes, 14, seed=seed, uses_occupancy=variant.occupancy)
    return OneCell(variant.n_planes, 14, variant.width)


def class_weights(truth: Tensor, balanced: bool) -> Tensor:
    """Return the weight of each class: all one, or balanced by median frequency within the limit of 4.

    Parameters
    ----------
    truth : (N, H, W) int64
        The frames to learn from.
    balanced : bool
        Which of the two.
    """
    weights = median_frequency_weights(truth.numpy(), 14, 4) if balanced else np.ones(14)
    return torch.from_numpy(weights).float()


def train(fusion: nn.Module, some: Streets, alpha: Tensor, steps: int, eta: float = 0.05, kappa: float = 0.9) -> None:
    """Train a network as the lecture's `learn` does, with one frame a step.

    Parameters
    ----------
    fusion : Module
        The network, which is changed.
    some : Streets
        The frames to learn from.
    alpha : (14,) float32
        The weights of the classes.
    steps : int
        Number of steps.
    eta, kappa : float
        Learning rate at the start, and momentum.
    """
    descent = torch.optim.SGD(fusion.parameters(), eta, momentum=kappa)
    fusion.train()
    for step in range(steps):
        for group in descent.param_groups:
            group["lr"] = eta * (1 + np.cos(np.pi * step / steps)) / 2
        k = [step % len(some.truth)]
        logits = fusion(some.planes[k], some.o[k])
        loss = F.cross_entropy(logits, some.truth[k], weight=alpha, ignore_index=IGNORE)
        descent.zero_grad()
        loss.backward()
        descent.step()


def by_table(six: Streets, new: Streets, camera: Camera) -> dict[str, NDArray[np.intp]]:
    """Return what the lecture's tables call the cells of new streets, by what the table knows.

    Parameters
    ----------
    six : Streets
        The frames that the table is counted on.
    new : Streets
        The frames to name.
    camera : Camera
        The drive's camera.
    """
    counts = np.zeros((256, 4, 14))
    np.add.at(counts, (ground_labels(six.scores, camera), six.o.argmax(dim=1).numpy(), six.truth.numpy()), 1)
    counts = counts[..., :N_SEMANTIC]
    label = ground_labels(new.scores, camera)
    state = new.o.argmax(dim=1).numpy()
    return {
        "always road": np.full(label.shape, KITTI_14.index("road")),
        "table of o": counts.sum(axis=0).argmax(axis=1)[state],
        "table of the label": counts.sum(axis=1).argmax(axis=1)[label],
        "table of both": counts.argmax(axis=2)[label, state],
    }


def simulated_streets(net: SemanticGridNet, camera: Camera, first: int, n_streets: int) -> Streets:
    """Return one frame of each of some simulated streets, after half a second of filtering.

    Parameters
    ----------
    net, camera
        As in `streets`.
    first : int
        Seed of the first street.
    n_streets : int
        Number of streets.
    """
    image = []
    belief = []
    truth = []
    for number in tqdm(range(first, first + n_streets), desc="streets", unit="street"):
        drive = simulate(number, FRAMES_BEFORE + 1)
        frames = [labelled_frame(drive, k, birdseye=k == FRAMES_BEFORE) for k in range(FRAMES_BEFORE + 1)]
        *_, last = track_drive(frames, SPEC)
        image.append(network_image(frames[-1], net.architecture.image_size))
        belief.append(last.probability)
        truth.append(grid_truth(frames[-1].labels, last.probability, SPEC))
    return streets(net, camera, *(torch.from_numpy(np.stack(part)) for part in (image, belief, truth)))


def ablation(seeds: int = 3, steps: int = 300, n_streets: int = 20) -> dict:
    """Train every variant and score it, with the tables, on new streets.

    Parameters
    ----------
    seeds : int
        Number of networks of each variant.
    steps : int
        Number of steps of each.
    n_streets : int
        Number of streets to score.

    Returns
    -------
    dict
        "counts": by method and seed the confusion matrices of the streets, "variants", "minutes" and provenance.
    """
    began = time.perf_counter()
    camera = sample_drive().camera
    net = load_net(sample_image_stage(), camera).requires_grad_(False)
    new = simulated_streets(net, camera, FIRST, n_streets)
    six = training_streets(net, camera)
    tables = by_table(six, new, camera)
    counts = {name: [confusions(called, new.truth)] for name, called in tables.items()}
    for name, variant in VARIANTS.items():
        some, unseen = (one._replace(planes=one.planes[:, :, : variant.n_planes]) for one in (six, new))
        counts[name] = []
        for seed in range(seeds):
            fusion = build(variant, seed)
            train(fusion, some, class_weights(some.truth, variant.balanced), steps)
            counts[name].append(confusions(named(fusion, unseen), new.truth))
        print(name, scores(counts[name]).mean(axis=0), f"{(time.perf_counter() - began) / 60:.1f} minutes", flush=True)
    command = "python -m worlds.lecture_08_ablation OUT" + (f" --steps {steps}" if steps != 300 else "")
    return {
        "seeds": list(range(seeds)),
        "steps": steps,
        "streets": [FIRST, FIRST + n_streets],
        "variants": {name: variant._asdict() for name, variant in VARIANTS.items()},
        "counts": {name: [written(one) for one in each] for name, each in counts.items()},
        "minutes": round((time.perf_counter() - began) / 60, 1),
        **made_by(command, "numpy", "torch", "numba", "embreex", "trimesh"),
    }


def main(out: Path, steps: int = 300) -> None:
    """Measure, and write the result.

    Parameters
    ----------
    out : Path
        A JSON file.
    steps : int
        Number of steps of each network.
    """
    torch.set_num_threads(1)
    result = ablation(steps=steps)
    write_json(out, result)


if __name__ == "__main__":
    typer.run(main)
