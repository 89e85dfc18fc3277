"""Equation (2) at the paper's scale: `PlaneSampler` against `F.grid_sample`, each followed by the 1x1 reduction.

Run: python benchmarks/bench_planes.py
"""

import time
from collections.abc import Callable

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from semgrid_edu.camera import Camera
from semgrid_edu.grid import GridSpec
from semgrid_edu.planes import PlaneSampler, plane_heights, plane_pixels

N_CLASSES, N_REDUCED = 14, 16
KITTI_SIZE = (375, 1242)


def kitti_camera() -> Camera:
    """Return a camera like KITTI's: image_02 of 2011_09_26, rounded."""
    K = np.array([[721.5, 0, 609.6], [0, 721.5, 172.9], [0, 0, 1]])
    T_camera_from_lidar = np.array([[0, -1, 0, 0.06], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]])
    return Camera(K, T_camera_from_lidar, KITTI_SIZE)


def grid_sample_planes(pixels: np.ndarray, visible: np.ndarray) -> Callable[[Tensor], Tensor]:
    """Return equation (2) the usual way: (B, C, h, w) -> (B, C, D, H, W)."""
    height, width = KITTI_SIZE
    normalised = 2 * pixels / (width - 1, height - 1) - 1
    normalised[~visible] = -2  # outside, so zero
    grid = torch.from_numpy(normalised.reshape(1, -1, visible.shape[-1], 2)).float()
    return lambda scores: F.grid_sample(scores, grid, align_corners=True).unflatten(2, visible.shape[:2])


def best_ms(function: Callable[[], object], repeats: int = 7) -> float:
    """Return the shortest of several runs, milliseconds."""
    times = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times[1:])


def main() -> None:
    torch.manual_seed(0)
    pixels, visible = plane_pixels(GridSpec.paper(), plane_heights(), kitti_camera())
    build = best_ms(lambda: PlaneSampler(pixels, visible, KITTI_SIZE), repeats=3)
    scores = torch.randn(1, N_CLASSES, *KITTI_SIZE, requires_grad=True)
    weight = torch.randn(N_REDUCED, N_CLASSES, len(visible), 1, 1, requires_grad=True)
    sampler = PlaneSampler(pixels, visible, KITTI_SIZE)
    grid_sample = grid_sample_planes(pixels, visible)
    sampling = {"grid_sample": grid_sample, "PlaneSampler": sampler}
    reducing = {
        "grid_sample": lambda: F.conv2d(grid_sample(scores).flatten(1, 2), weight[..., 0].flatten(1, 2)[..., None]),
        "PlaneSampler": lambda: F.conv3d(sampler(scores), weight)[:, :, 0],
    }
    print(f"{len(visible)} planes, {visible.mean():.0%} visible; building the sampler takes {build:.0f} ms")
    times, results = {}, {}
    for name, reduce in reducing.items():

        def learn(reduce=reduce) -> None:
            scores.grad = weight.grad = None
            reduce().sum().backward()

        with torch.no_grad():
            times[name] = [best_ms(lambda sample=sampling[name]: sample(scores)), best_ms(reduce)]
        times[name].append(best_ms(learn))
        results[name] = (reduce().detach(), scores.grad, weight.grad)
    for mine, theirs in zip(results["PlaneSampler"], results["grid_sample"], strict=True):
        torch.testing.assert_close(mine, theirs, rtol=1e-3, atol=1e-2)
    for column, what in enumerate(("sampling alone", "with the 1x1, forward", "with the 1x1, forward + backward")):
        ours, usual = times["PlaneSampler"][column], times["grid_sample"][column]
        print(f"{what:<34} grid_sample {usual:7.1f} ms   PlaneSampler {ours:7.1f} ms   ratio {usual / ours:.2f}")


if __name__ == "__main__":
    main()
