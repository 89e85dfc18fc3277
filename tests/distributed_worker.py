"""What each of two processes does in test_distributed.py, by torchrun: `distributed_worker.py FOLDER TASK...`."""

import sys
import time
import warnings
from pathlib import Path

import torch
from lightning_fabric import Fabric
from tiny_streets import CAMERA, SMALL, Watched, kill, tiny_streets
from torch import nn

from semgrid_edu.networks import build_net
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.training import loop as training
from semgrid_edu.training.checkpoint import check_folder
from semgrid_edu.training.devices import open_fabric
from semgrid_edu.training.loop import learn

QUICK = TrainingParams(image_iterations=3, grid_iterations=5, batch_size=4)
FRAMES = 5


class Fit(nn.Module):
    """The weighted squared errors of a linear map, as two sums like those of `Objective`."""

    def __init__(self):
        super().__init__()
        self.w = nn.Parameter(torch.tensor([1.0, -2.0, 0.5], dtype=torch.float64))

    def forward(self, batch):
        x, y, weights = batch
        return (weights * (x @ self.w - y) ** 2).sum(), weights.sum()


def fitted(fabric: Fabric, batch):
    """Losses and weights of a few steps."""
    fit = Fit()
    objective, optimiser = fabric.setup_module(fit), torch.optim.SGD(fit.parameters(), lr=0.1, momentum=0.9)
    losses = [learn(fabric, objective, optimiser, batch) for _ in range(4)]
    return torch.tensor([*losses, *fit.w.tolist()], dtype=torch.float64)


def fit_batch():
    """Eight examples, whose weights are unevenly distributed over the two halves."""
    generator = torch.Generator().manual_seed(0)
    x, y = (torch.randn(shape, generator=generator, dtype=torch.float64) for shape in ((8, 3), (8,)))
    return x, y, torch.tensor([5.0, 3, 4, 1, 0, 0.5, 0, 0.1], dtype=torch.float64)


def share(folder, fabric):
    """A few steps, each process with half of the batch; and what only one process does first."""
    half = slice(4 * fabric.global_rank, 4 * fabric.global_rank + 4)
    torch.save(fitted(fabric, tuple(part[half] for part in fit_batch())), folder / f"fitted-{fabric.global_rank}.pt")


def learn_streets(folder, fabric):
    """Train, the second process half a second late; then once more, interrupted and resumed."""
    training.CHECKPOINT_EVERY = 2
    streets = tiny_streets(FRAMES)
    if fabric.global_rank == 1:
        training.check_folder = late(training.check_folder)
    train(build_net(SMALL, CAMERA), streets, folder / "whole", QUICK, fabric=fabric)
    training.check_folder = check_folder
    train(
        build_net(SMALL, CAMERA),
        streets,
        folder / "two-stage",
        TrainingParams(1, 2, 4, end_to_end=False),
        fabric=fabric,
    )
    try:
        train(
            build_net(SMALL, CAMERA),
            Watched(streets, 3 * FRAMES + 5 * 4, kill),
            folder / "resumed",
            QUICK,
            fabric=fabric,
        )
    except InterruptedError:
        train(build_net(SMALL, CAMERA, seed=5), streets, folder / "resumed", QUICK, resume=True, fabric=fabric)


def late(function):
    """The same function, half a second later."""

    def delayed(*arguments):
        time.sleep(0.5)
        return function(*arguments)

    return delayed


def refuse(folder, fabric):
    """Mistakes that all processes must see, though the second alone makes one of them."""
    streets = tiny_streets()
    bad = [street._replace(occupancy=street.occupancy * torch.nan) for street in streets]
    for name, data, params in (
        ("nan", bad if fabric.global_rank == 1 else streets, TrainingParams(1, 2, batch_size=2)),
        ("odd", streets, TrainingParams(1, 2, batch_size=3)),
    ):
        try:
            train(build_net(SMALL, CAMERA), data, folder / name, params, fabric=fabric)
        except ValueError as error:
            (folder / f"{name}-{fabric.global_rank}").write_text(str(error))


def fail(folder, fabric):
    """The second process alone meets an error, while the first waits for it."""
    streets = tiny_streets()
    data = Watched(streets, 17, kill) if fabric.global_rank == 1 else streets
    train(build_net(SMALL, CAMERA), data, folder / "fails", TrainingParams(10, 10, 2), fabric=fabric)


if __name__ == "__main__":
    warnings.simplefilter("error")
    torch.set_num_threads(1)
    fabric = open_fabric("cpu")
    assert fabric.world_size == 2
    for task in sys.argv[2:]:
        globals()[task](Path(sys.argv[1]), fabric)
