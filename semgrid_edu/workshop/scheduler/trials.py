"""How long a training step takes on this machine, from a short trial: for the estimate of a plan (section 4.1)."""

import time

import torch

from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks import Architecture, build_net
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.training import Objective, TrainingParams
from semgrid_edu.training.batches import Batch
from semgrid_edu.training.loop import learn
from semgrid_edu.workshop.scheduler.torchrun import few_threads
from semgrid_edu.workshop.simulation.sensors.rig import Rig

TIMED_STEPS = 2
"""Number of steps that are timed, after one that isn't."""


def seconds_per_step(described: Architecture, params: TrainingParams, stage: str) -> float:
    """Return how long a training step takes on this machine's CPU, tried on grey frames.

    Parameters
    ----------
    described : Architecture
        The network.
    params : TrainingParams
        How it is trained.
    stage : str
        "image" or "grid".

    Returns
    -------
    float
        Seconds.
    """
    net = build_net(described, Rig().camera).train()
    size, shape, n = described.image_size, described.grid.shape, params.batch_size
    n_classes = len(LABEL_SETS[described.label_set])
    image, occupancy = torch.full((n, 3, *size), 0.5), torch.full((n, N_STATES, *shape), 1 / N_STATES)
    labels, truth = (torch.zeros((n, *part), dtype=torch.uint8) for part in (size, shape))
    batch = Batch(Sample(image, labels, occupancy, truth), mirrored=False)
    optimiser = torch.optim.SGD(net.parameters(), lr=1e-6, momentum=params.momentum)
    objective = Objective(net, stage, torch.ones(n_classes))
    with few_threads():
        learn(objective, optimiser, batch, torch.device("cpu"))
        began = time.perf_counter()
        for _ in range(TIMED_STEPS):
            learn(objective, optimiser, batch, torch.device("cpu"))
    return (time.perf_counter() - began) / TIMED_STEPS
