"""Time the compact networks on the shipped frames, learning and inferring: `python benchmarks/bench_networks.py`.

A training step is a whole turn of `train`'s loop: a batch of six frames drawn and jittered, forward, backward, weights
changed, loss logged. Inference is a frame from image and occupancy grid to logits.

Steps are made of multiplications, so beside them stands how fast the machine multiplies matrices in the same minute. On
a shared one that varies, and the steps with it.
"""

import io
import tempfile
import time
from contextlib import redirect_stderr

import numpy as np
import torch
from timing import best_times
from torch.utils.flop_counter import FlopCounterMode

from semgrid_edu.datasets.samples import sample_drive, sample_frames
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.fast import build_net
from semgrid_edu.fast.allocator import keep_freed_memory
from semgrid_edu.networks import SEGMENTERS, Architecture, SemanticGridNet, unit_image
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.training.batches import draw_batch, grid_logits, image_scores

STEPS, WARM_UP, ROUNDS = 30, 3, 30
"""Of each stage; those before the times count; calls of inference."""


class ReadingFrames(list[Sample]):
    """Frames that note when each is read. A step reads each of the six once, as the first thing it does."""

    def __init__(self, frames: list[Sample]) -> None:
        super().__init__(frames)
        self.read_at: list[float] = []

    def __getitem__(self, index: int) -> Sample:
        self.read_at.append(time.perf_counter())
        return super().__getitem__(index)


def step_times(net: SemanticGridNet) -> tuple[np.ndarray, np.ndarray]:
    """Return the milliseconds of the steps of both stages, image and grid."""
    frames = ReadingFrames(sample_frames())
    params = TrainingParams(image_iterations=STEPS, grid_iterations=STEPS, batch_size=len(frames))
    with tempfile.TemporaryDirectory() as folder, redirect_stderr(io.StringIO()):
        train(net, frames, folder, params)
    starts = np.array(frames.read_at)[-2 * STEPS * len(frames) :: len(frames)]  # before the loop, train looks at one
    steps = 1e3 * np.diff(starts)
    return steps[WARM_UP : STEPS - 1], steps[STEPS + WARM_UP :]


def step_arithmetic(net: SemanticGridNet) -> list[float]:
    """Return the 1e9 additions and multiplications in the products of a step of both stages, forward and backward."""
    frames = sample_frames()
    batch = draw_batch(frames, len(frames), jitter=0, iteration=0, seed=0)
    counts = []
    for scores in (image_scores, grid_logits):
        net.zero_grad()
        with FlopCounterMode(display=False) as counter:
            scores(net.train(), batch).sum().backward()
        counts.append(counter.get_total_flops() / 1e9)
    return counts


def matrix_product_rate(size: int = 2048) -> float:
    """Return the 1e9 additions and multiplications a second of a product of two square matrices, the median."""
    a = torch.randn(size, size, generator=torch.Generator().manual_seed(0))
    times = [best_times([lambda: a @ a], rounds=1)[0] for _ in range(ROUNDS)]
    return 2 * size**3 / 1e6 / float(np.median(times))


def inference_time(net: SemanticGridNet) -> float:
    """Return the milliseconds from image and occupancy grid to logits."""
    frame = sample_frames()[0]
    image = unit_image(frame.image[None])
    occupancy = frame.occupancy[None]
    with torch.inference_mode():
        return best_times([lambda: net(image, occupancy)], ROUNDS)[0]


def main() -> None:
    keep_freed_memory()
    camera = sample_drive().camera
    print("                                 step, ms: median (fastest), at GFLOP/s     matrix product  inference")
    print("network      image     fusion          image stage            grid stage           GFLOP/s  ms a frame")
    for name in SEGMENTERS:
        net = build_net(Architecture(name), camera)
        arithmetic = step_arithmetic(net)
        stages = step_times(net)
        product = matrix_product_rate()
        sizes = [sum(p.numel() for p in part.parameters()) for part in (net.segmenter, net.fusion)]
        steps = [
            f"{np.median(times):10.0f} ({times.min():3.0f}) {1e3 * flops / np.median(times):6.0f}"
            for times, flops in zip(stages, arithmetic, strict=True)
        ]
        print(f"{name:8} {sizes[0]:10,} {sizes[1]:10,} {' '.join(steps)} {product:17.0f} {inference_time(net):11.1f}")


if __name__ == "__main__":
    main()
