"""What each of two processes does in test_distributed.py, started by torchrun: `distributed_worker.py TASK FOLDER`."""

import json
import sys
import warnings
from pathlib import Path

import torch
from tiny_streets import CAMERA, SMALL, tiny_streets
from torch import nn

from semgrid_edu.networks import build_net
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.training import loop as training
from semgrid_edu.training.devices import first_process_first, process_group, rank, shared_batch_norm, world_size

RUNS = {
    "end-to-end": TrainingParams(image_iterations=3, grid_iterations=5, batch_size=4),
    "two-stage": TrainingParams(image_iterations=3, grid_iterations=5, batch_size=4, end_to_end=False),
}
FRAMES = 5


def noisy_streets():
    """Streets where no two places look the same: else rounding alone decides which of them is a pool's maximum."""
    generator = torch.Generator().manual_seed(0)
    return [
        street._replace(
            image=torch.randint(60, 200, street.image.shape, generator=generator, dtype=torch.uint8),
            occupancy=torch.rand(street.occupancy.shape, generator=generator, dtype=torch.float64).softmax(0),
        )
        for street in tiny_streets(FRAMES)
    ]


def precise_net(seed=0):
    """In float32, a sum in another order turns a ReLU or a pool's choice here and there, and losses part at 1e-4."""
    return build_net(SMALL, CAMERA, seed).double()


class Broken(list):
    """Streets that can be read so many times."""

    def __init__(self, streets, reads):
        super().__init__(streets)
        self.reads = reads

    def __iter__(self):
        return (self[k] for k in range(len(self)))

    def __getitem__(self, k):
        self.reads -= 1
        if self.reads < 0:
            raise InterruptedError
        return super().__getitem__(k)


def exact_losses():
    """Have the log keep every digit: returns where `train` will put its losses."""
    losses, append_step = [], training.append_step

    def append_and_keep(path, step):
        losses.append(step.loss)
        append_step(path, step)

    training.append_step = append_and_keep
    return losses


def normalised(x, weight):
    """A batch's normalisation, its running statistics, and the gradient of a weighted sum of its cubes."""
    norm = nn.BatchNorm2d(3).requires_grad_(True)
    with torch.no_grad():
        norm.weight.copy_(torch.tensor([0.5, 1, 2]))
        norm.bias.copy_(torch.tensor([-1.0, 0, 1]))
    x = x.clone().requires_grad_(True)
    with shared_batch_norm(norm):
        y = norm(x)
    (weight * y**3).sum().backward()
    return {"y": y.detach(), "grad": x.grad, "mean": norm.running_mean, "var": norm.running_var}


def batch():
    generator = torch.Generator().manual_seed(0)
    x, weight = (torch.randn(4, 3, 5, 7, generator=generator) for _ in range(2))
    return 100 + 3 * x, weight


def learn(folder):
    """Train both ways; then once more, interrupted and resumed."""
    losses, training.CHECKPOINT_EVERY = exact_losses(), 2
    torch.set_default_dtype(torch.float64)
    for name, params in RUNS.items():
        train(precise_net(seed=rank()), noisy_streets(), folder / name, params)
    params, reads = RUNS["end-to-end"], 3 * FRAMES + 5 * 4
    try:
        train(precise_net(), Broken(noisy_streets(), reads), folder / "resumed", params)
    except InterruptedError:
        train(precise_net(seed=5), noisy_streets(), folder / "resumed", params, resume=True)
    if rank() == 0:
        (folder / "losses.json").write_text(json.dumps(losses))


def share(folder):
    """What the processes do together, in small."""
    mine = slice(2 * rank(), 2 * rank() + 2)
    torch.save(normalised(*(part[mine] for part in batch())), folder / f"normalised-{rank()}.pt")
    with first_process_first():
        (folder / f"order-{rank()}").write_text(str((folder / "order-0").exists()))


def refuse(folder):
    """Mistakes that all processes must see, though the second alone makes one of them."""
    streets = tiny_streets()
    bad = [street._replace(occupancy=street.occupancy * torch.nan) for street in streets]
    for name, data, params in (
        ("nan", bad if rank() == 1 else streets, TrainingParams(1, 2, batch_size=2)),
        ("odd", streets, TrainingParams(1, 2, batch_size=3)),
    ):
        try:
            train(build_net(SMALL, CAMERA), data, folder / name, params)
        except ValueError as error:
            (folder / f"{name}-{rank()}").write_text(str(error))


def fail(folder):
    """The second process alone meets an error, while the first waits for it."""
    torch.set_default_dtype(torch.float32)
    streets = tiny_streets()
    data = Broken(streets, 17) if rank() == 1 else streets
    train(build_net(SMALL, CAMERA), data, folder / "fails", TrainingParams(10, 10, 2))


if __name__ == "__main__":
    warnings.simplefilter("error")
    torch.set_num_threads(1)
    with process_group("cpu"):
        assert world_size() == 2
        for task in sys.argv[2:]:
            globals()[task](Path(sys.argv[1]))
