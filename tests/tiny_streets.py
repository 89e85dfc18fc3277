"""A small network and streets in blocks of three colours, one a class, that it learns in seconds."""

from collections.abc import Callable

import numpy as np
import torch

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import Architecture
from semgrid_edu.planes import plane_pixels

SMALL = Architecture(image_size=(24, 80), grid=GridSpec(2, 26, -6, 6, 1.0), heights=(0.0, 0.5, 1.0))
CAMERA = Camera(
    np.array([[721.5, 0, 609.6], [0, 721.5, 172.9], [0, 0, 1]]),
    np.array([[0, -1, 0, 0.06], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    (375, 1242),
)


def tiny_streets(n: int = 4) -> list[Sample]:
    return [_street(seed) for seed in range(n)]


class Watched:
    """Streets, and what happens as they are read: `event` gets how many reads are left."""

    def __init__(self, streets: list[Sample], reads: int, event: Callable[[int], None]):
        self.streets, self.reads, self.event = streets, reads, event

    def __len__(self) -> int:
        return len(self.streets)

    def __getitem__(self, k: int) -> Sample:
        if k >= len(self.streets):
            raise IndexError(k)
        self.event(self.reads)
        self.reads -= 1
        return self.streets[k]


def kill(reads: int) -> None:
    """The power fails."""
    if reads == 0:
        raise InterruptedError


def _street(seed: int) -> Sample:
    """A flat street, as the camera sees it and as it is."""
    rng = np.random.default_rng(seed)
    spec, camera = SMALL.grid, CAMERA.resized(SMALL.image_size)
    blocks = rng.integers(0, 3, (4, 2)).astype(np.uint8)
    truth = np.kron(blocks, np.ones((6, 6), dtype=np.uint8))
    fine = GridSpec(spec.x_min, spec.x_max, spec.y_min, spec.y_max, 0.05)
    pixels, visible = plane_pixels(fine, [0.0], camera)
    labels = np.full(camera.size, KITTI_14.index("sky"), dtype=np.uint8)
    rows, cols, _ = spec.cells(fine.centers()[visible[0]])
    u, v = np.rint(pixels[visible]).astype(int).T
    labels[v, u] = truth[rows, cols]
    seen = plane_pixels(spec, [0.0], camera)[1][0]
    truth[~seen] = KITTI_14.index("unknown-unobserved")
    occupancy = np.where(seen, 1.0, 0.0)
    planes = np.stack([occupancy, 0 * occupancy, 0 * occupancy, 1 - occupancy]).astype(np.float32)
    image = KITTI_14.colours(labels).transpose(2, 0, 1)
    return Sample(*map(torch.from_numpy, (image.copy(), labels, planes, truth)))
