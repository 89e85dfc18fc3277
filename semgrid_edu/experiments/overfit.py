"""Four frames learnt by heart: whether the whole network, with each image network, can learn at all (section 4.1)."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
import torch

from semgrid_edu.datasets.samples import sample_drive, sample_frames
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.metrics import confusion_matrix, pixel_accuracy
from semgrid_edu.networks import SEGMENTERS, Architecture, SemanticGridNet, build_net, unit_image
from semgrid_edu.storage.provenance import versions
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.training.log import LOG, read_log

FRAMES = 4
PARAMS = TrainingParams(
    image_iterations=0,
    grid_iterations=400,
    batch_size=FRAMES,
    learning_rate=0.3,
    weight_limit=1.0,
    jitter=0.0,
    mirror=False,
)
"""Every step sees the same four frames as they are, from random weights on; every cell counts alike. A learning rate
six times the usual one does no harm where all steps pull the same way."""
LOSS_EVERY = 50
"""Iterations between the losses that the result keeps."""

Result = dict[str, object]


def overfit(seed: int = 0, params: TrainingParams | None = None) -> Result:
    """Train compact networks, image to grid, on four shipped frames, and score them on the same four.

    A network that can't learn four frames by heart is too small, or its gradients are wrong, or a step is too large.
    One that scores in training mode alone has running statistics that aren't those of its data.

    Parameters
    ----------
    seed : int
        Of the initial weights.
    params : TrainingParams, optional
        `PARAMS` by default.

    Returns
    -------
    dict
        "networks": for each image network what `learn_by_heart` returns. With all that made them: it can be written as
        JSON.
    """
    params, began = params or PARAMS, datetime.now(UTC)
    frames, camera = sample_frames()[:FRAMES], sample_drive().camera
    return {
        "networks": {
            name: learn_by_heart(build_net(Architecture(name), camera, seed), frames, params, seed)
            for name in SEGMENTERS
        },
        "frames": len(frames),
        "params": asdict(params),
        "command": f"semgrid-edu reproduce overfit --seed {seed}",
        "seed": seed,
        "date": f"{began:%Y-%m-%d}",
        "versions": versions("torch", "numpy"),
    }


def learn_by_heart(net: SemanticGridNet, frames: Sequence[Sample], params: TrainingParams, seed: int) -> Result:
    """Train a network on frames and score it on the same.

    Parameters
    ----------
    net : SemanticGridNet
        Of `build_net`; changed in place.
    frames : sequence of Sample
    params : TrainingParams
    seed : int
        Of the order of the frames.

    Returns
    -------
    dict
        "iterations"; "losses", every fiftieth and the last; "pixel accuracy" of labelled cells, 0..1, in
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
            mode: accuracy(net, frames, training=mode == "training") for mode in ("evaluation", "training")
        },
        "minutes": round((perf_counter() - began) / 60, 1),
    }


@torch.no_grad()
def accuracy(net: SemanticGridNet, frames: Sequence[Sample], training: bool) -> float:
    """Return the share of labelled cells that a network calls right, 0..1; the network stays as it is.

    Parameters
    ----------
    net : SemanticGridNet
    frames : sequence of Sample
    training : bool
        Whether batch normalisation takes its mean and variance from these frames, as in training.

    Returns
    -------
    float
    """
    image, occupancy = (torch.stack(parts) for parts in zip(*((f.image, f.occupancy) for f in frames), strict=True))
    logits = deepcopy(net).train(training)(unit_image(image), occupancy)
    truth = np.stack([frame.truth.numpy() for frame in frames])
    return pixel_accuracy(confusion_matrix(truth, logits.argmax(1).numpy(), net.n_classes))


def table(networks: dict[str, Result]) -> str:
    """Return the accuracies as a table to print, in per cent."""
    lines = [f"{'':8} {'evaluation':>12} {'training mode':>14} {'last loss':>10} {'minutes':>8}"]
    for name, result in networks.items():
        evaluation, training = (100 * result["pixel accuracy"][mode] for mode in ("evaluation", "training"))
        lines.append(
            f"{name:8} {evaluation:12.2f} {training:14.2f} {result['losses'][-1]:10.4f} {result['minutes']:8.1f}"
        )
    return "\n".join(lines)
