"""Overfitting on purpose: a test of whether the network, with each image network, memorises four frames (section 4.1).

In the folder notebooks, `python -m worlds.lecture_08_overfit ../docs/results/overfit.json` trains and scores them.
"""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
import torch
import typer

from semgrid_edu.datasets.samples import sample_drive, sample_frames
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.fast import build_net
from semgrid_edu.metrics import confusion_matrix, pixel_accuracy
from semgrid_edu.networks import SEGMENTERS, Architecture, SemanticGridNet, unit_image
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.training.log import LOG, read_log
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table

PARAMS = TrainingParams(
    image_iterations=0,
    grid_iterations=400,
    batch_size=4,
    learning_rate=0.3,
    weight_limit=1.0,
    jitter=0.0,
    mirror=False,
)
"""Every step sees the same four frames without augmentation, and every class has the same weight. The learning rate is
six times the usual one, because all steps follow the gradient of the same frames."""
LOSS_EVERY = 50
"""Number of iterations between two losses that the result keeps."""

OverfitResult = dict[str, object]


def overfit(seed: int = 0) -> OverfitResult:
    """Train compact networks, image to grid, on four shipped frames, and score them on the same four.

    If a network can't memorise four frames (overfit), it is too small, its gradients are wrong, or its steps are too
    large. If it scores well only in training mode, its running statistics don't match its data.

    Parameters
    ----------
    seed : int
        Seed for the initial weights.

    Returns
    -------
    dict
        "networks": for each image network what `learn_by_heart` returns; and all that made them. JSON can hold it.
    """
    frames, camera = sample_frames()[: PARAMS.batch_size], sample_drive().camera
    nets = {name: build_net(Architecture(name), camera, seed) for name in SEGMENTERS}
    return {
        "networks": {name: learn_by_heart(net, frames, PARAMS, seed) for name, net in nets.items()},
        "frames": len(frames),
        "params": asdict(PARAMS),
        "seed": seed,
        **made_by(f"python -m worlds.lecture_08_overfit OUT --seed {seed}", "torch", "numpy"),
    }


def learn_by_heart(net: SemanticGridNet, frames: Sequence[Sample], params: TrainingParams, seed: int) -> OverfitResult:
    """Train a network on frames, and score it on the same frames.

    Parameters
    ----------
    net : SemanticGridNet
        From `build_net`; its weights are changed in place.
    frames : sequence of Sample
        The frames.
    params : TrainingParams
        How to train.
    seed : int
        Seed for the order of the frames.

    Returns
    -------
    dict
        "iterations"; "losses", every fiftieth and the last one; "pixel accuracy" over labelled cells, 0..1, in
        "evaluation" mode, in which the network is used, and in "training" mode; "minutes".
    """
    began = perf_counter()
    with TemporaryDirectory() as folder:
        train(net, frames, folder, params, seed)
        loss = read_log(Path(folder) / LOG).loss
    return {
        "iterations": len(loss),
        "losses": [*loss[:-1:LOSS_EVERY].tolist(), float(loss[-1])],
        "pixel accuracy": {
            mode: network_accuracy(net, frames, training=mode == "training") for mode in ("evaluation", "training")
        },
        "minutes": round((perf_counter() - began) / 60, 1),
    }


@torch.no_grad()
def network_accuracy(net: SemanticGridNet, frames: Sequence[Sample], training: bool) -> float:
    """Return the pixel accuracy of a network's grids, without changing the network.

    Parameters
    ----------
    net : SemanticGridNet
        The network.
    frames : sequence of Sample
        The frames to score it on.
    training : bool
        Whether batch normalisation takes its mean and variance from these frames, as in training, instead of using its
        running statistics.

    Returns
    -------
    float
        Share of labelled cells that are predicted correctly, 0..1.
    """
    image, occupancy = (torch.stack(parts) for parts in zip(*((f.image, f.occupancy) for f in frames), strict=True))
    logits = deepcopy(net).train(training)(unit_image(image), occupancy)
    truth = np.stack([frame.truth.numpy() for frame in frames])
    return pixel_accuracy(confusion_matrix(truth, logits.argmax(1).numpy(), net.n_classes))


def overfit_table(networks: dict[str, OverfitResult]) -> str:
    """Return the accuracies, per cent, as a Markdown table.

    Parameters
    ----------
    networks : dict of str to dict
        The "networks" of a result of `overfit`.
    """
    rows = [["", "evaluation", "training mode", "last loss", "minutes"]]
    for name, result in networks.items():
        shares = (f"{100 * result['pixel accuracy'][mode]:.2f}" for mode in ("evaluation", "training"))
        rows.append([name, *shares, f"{result['losses'][-1]:.4f}", f"{result['minutes']:.1f}"])
    return markdown_table(rows)


def main(out: Path, seed: int = 0) -> None:
    """Overfit each image network, write the result and print its table.

    Parameters
    ----------
    out : Path
        A JSON file.
    seed : int
        Seed for the initial weights.
    """
    result = overfit(seed)
    write_json(out, result)
    print(overfit_table(result["networks"]))


if __name__ == "__main__":
    typer.run(main)
