"""Equation (2) and the 1x1 reduction at the paper's scale, time and memory: `python benchmarks/bench_planes.py`.

Twenty planes of 355 x 155 cells take the scores of 14 classes from an image of 375 x 1242 pixels, and a 1x1
convolution leaves 16 of these 280. `fast.PlaneSampler`, the book's `PlaneSampler` and other ways to sample take turns,
each followed by the same convolution, ours in the form that the package's network uses; the best of the rounds counts.
Peak memory is that of a separate process, above what it held before.
"""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from timing import best_times
from torch import Tensor
from torch.func import functional_call

from semgrid_edu import fast, planes
from semgrid_edu.camera import Camera
from semgrid_edu.fast.allocator import keep_freed_memory
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks.fusion import PlaneConvolution
from semgrid_edu.planes import plane_heights, plane_pixels

N_CLASSES, N_REDUCED, ROUNDS = 14, 16, 15
KITTI_SIZE = (375, 1242)
OURS = "fast"
CONVOLUTION = PlaneConvolution(N_CLASSES, N_REDUCED, (len(plane_heights()), 1, 1), bias=False)
"""What `FusionNet` reduces the planes with; the benchmark passes it another weight."""
Sampling = Callable[[Tensor], Tensor]
"""(1, C, h, w) -> (1, C, D, H, W)."""


def kitti_camera() -> Camera:
    """Return a camera like KITTI's: image_02 of 2011_09_26, rounded."""
    K = np.array([[721.5, 0, 609.6], [0, 721.5, 172.9], [0, 0, 1]])
    T_camera_from_lidar = np.array([[0, -1, 0, 0.06], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]])
    return Camera(K, T_camera_from_lidar, KITTI_SIZE)


def normalised(pixels: NDArray, visible: NDArray) -> Tensor:
    """Return where PyTorch looks for each point, (D, H, W, 2): -1..1 from the first centre of a pixel to the last."""
    height, width = KITTI_SIZE
    grid = 2 * pixels / (width - 1, height - 1) - 1
    grid[~visible] = -2  # outside, so zero
    return torch.from_numpy(grid).float()


def flat_sampling(pixels: NDArray, visible: NDArray) -> Sampling:
    """Stack the planes into one tall image, as `F.grid_sample` takes it."""
    grid = normalised(pixels, visible).flatten(0, 1)[None]
    return lambda scores: F.grid_sample(scores, grid, align_corners=True).unflatten(2, visible.shape[:2])


def voxel_sampling(pixels: NDArray, visible: NDArray) -> Sampling:
    """Take the image for a volume one voxel deep, as public bird's-eye-view code does (Simple-BEV, 2022)."""
    grid = F.pad(normalised(pixels, visible), (0, 1))[None]
    return lambda scores: F.grid_sample(scores[:, :, None], grid, align_corners=True)


SAMPLINGS: dict[str, Callable[[NDArray, NDArray], Sampling]] = {
    OURS: lambda pixels, visible: fast.PlaneSampler(pixels, visible, KITTI_SIZE),
    "F.grid_sample": flat_sampling,
    "voxels": voxel_sampling,
    "book": lambda pixels, visible: planes.PlaneSampler(pixels, visible, KITTI_SIZE),
}


def reduction(name: str, sampling: Sampling) -> Callable[[Tensor, Tensor], Tensor]:
    """Return sampling, then the 1x1 convolution in the form that suits how the planes lie in memory."""
    if name == OURS:
        return lambda scores, weight: functional_call(CONVOLUTION, {"weight": weight}, sampling(scores))[:, :, 0]
    return lambda scores, weight: F.conv2d(sampling(scores).flatten(1, 2), weight.flatten(1, 2))


def tasks(name: str, sampling: Sampling, scores: Tensor, weight: Tensor) -> dict[str, Callable[[], Tensor]]:
    """Return what is measured of a way to sample."""
    reduce = reduction(name, sampling)

    def forward(compute: Callable[[], Tensor]) -> Tensor:
        with torch.no_grad():
            return compute()

    def learn() -> Tensor:
        scores.grad = weight.grad = None
        (reduced := reduce(scores, weight)).sum().backward()
        return reduced.detach()

    return {
        "sampling alone": lambda: forward(lambda: sampling(scores)),
        "with the 1x1, forward": lambda: forward(lambda: reduce(scores, weight)),
        "with the 1x1, forward + backward": learn,
    }


def inputs() -> tuple[Tensor, Tensor]:
    """Make up scores and the weights of the 1x1 convolution."""
    generator = torch.Generator().manual_seed(0)
    scores = torch.randn(1, N_CLASSES, *KITTI_SIZE, generator=generator)
    weight = torch.randn(N_REDUCED, N_CLASSES, len(plane_heights()), 1, 1, generator=generator)
    return scores.requires_grad_(), weight.requires_grad_()


def peak_memory(name: str, task: str) -> float:
    """Return the megabytes that a task needs above what was there before, in a separate process (Linux)."""
    # Freed buffers go back to the system at once, so that the peak counts only what is in use.
    environment = {**os.environ, "MALLOC_MMAP_THRESHOLD_": "65536"}
    command = [sys.executable, __file__, name, task]
    return float(subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True).stdout)


def print_peak(name: str, task: str) -> None:
    """Do a task once and print what `peak_memory` returns."""
    sampling = SAMPLINGS[name](*plane_pixels(GridSpec.paper(), plane_heights(), kitti_camera()))
    run = tasks(name, sampling, *inputs())[task]
    Path("/proc/self/clear_refs").write_text("5")  # the peak is counted from here on
    before = resident_peak()
    run()
    print(resident_peak() - before)


def resident_peak() -> float:
    """Return the most memory that this process has held, megabytes. (`getrusage` would count its parent's, too.)"""
    status = dict(line.split(":") for line in Path("/proc/self/status").read_text().splitlines())
    return int(status["VmHWM"].split()[0]) * 1024 / 1e6


def print_row(label: str, values: list[float], unit: str) -> None:
    """Print each way's number, and the others' as multiples of ours."""
    ratios = "".join(f"{value / values[0]:7.2f}" for value in values[1:])
    print(f"{label:<38}" + "".join(f"{value:11.1f} {unit}" for value in values) + ratios)


def main() -> None:
    keep_freed_memory()
    calibration = GridSpec.paper(), plane_heights(), kitti_camera()
    build = best_times([lambda: fast.PlaneSampler(*plane_pixels(*calibration), KITTI_SIZE)], 5)[0]
    pixels, visible = plane_pixels(*calibration)
    operator = fast.PlaneSampler(pixels, visible, KITTI_SIZE).operator.nbytes / 1e6
    grid = normalised(pixels, visible).nbytes / 1e6
    print(f"{len(visible)} planes, {visible.mean():.0%} visible")
    print(f"built from the calibration in {build:.0f} ms; {operator:.0f} MB (the grid of F.grid_sample: {grid:.0f} MB)")
    scores, weight = inputs()
    ways = {name: tasks(name, way(pixels, visible), scores, weight) for name, way in SAMPLINGS.items()}
    check_agreement(ways, scores, weight)
    print(f"\n{'':<38}" + "".join(f"{name:>14}" for name in ways) + "   others / ours")
    for task in ways[OURS]:
        print_row(task, best_times([way[task] for way in ways.values()], ROUNDS), "ms")
    if sys.platform == "linux":
        for task in ways[OURS]:
            print_row(f"{task}, peak", [peak_memory(name, task) for name in ways], "MB")


def check_agreement(ways: dict[str, dict[str, Callable[[], Tensor]]], scores: Tensor, weight: Tensor) -> None:
    """Check that all ways compute the same."""
    expected = None
    for way in ways.values():
        found = [run() for run in way.values()] + [scores.grad, weight.grad]
        expected = expected or found
        for ours, theirs in zip(expected, found, strict=True):
            torch.testing.assert_close(ours, theirs, rtol=1e-3, atol=1e-2)


if __name__ == "__main__":
    print_peak(*sys.argv[1:]) if len(sys.argv) > 1 else main()
