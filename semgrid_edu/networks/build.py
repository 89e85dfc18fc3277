"""The whole network from its description and a camera; the operators of the last calibrations are kept (section 3)."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from torch import Tensor, nn

from semgrid_edu.camera import Camera
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks.backbones.registry import build_segmenter
from semgrid_edu.networks.semantic_grid import Architecture, SemanticGridNet
from semgrid_edu.planes import PlaneOperator, PlaneSampler, plane_pixels
from semgrid_edu.planes.pixels import check_heights


def build_net(architecture: Architecture, camera: Camera, seed: int = 0) -> SemanticGridNet:
    """Return the whole network for one camera, with fresh weights.

    Networks of the same calibration share one `PlaneOperator`, which is worked out when the first of them is built.

    Parameters
    ----------
    architecture : Architecture
        What to build.
    camera : Camera
        The camera as it took its images; the network sees them at `architecture.image_size`.
    seed : int
        Seed for the initial weights.

    Returns
    -------
    SemanticGridNet
        The network, in training mode, as PyTorch's modules are when they are new.
    """
    if architecture.label_set not in LABEL_SETS:
        raise ArgumentError("label_set", f"one of {', '.join(LABEL_SETS)}", repr(architecture.label_set))
    n_classes = len(LABEL_SETS[architecture.label_set])
    first, *others = (
        build_segmenter(architecture.segmenter, n_classes, architecture.preset, seed + k)
        for k in range(architecture.n_segmenters)
    )
    segmenter = MeanSegmenter([first, *others]) if others else first
    return SemanticGridNet(segmenter, plane_sampler(architecture, camera), n_classes, seed, architecture=architecture)


class MeanSegmenter(nn.Module):
    """Several image networks that score an image together: s is the mean of their scores.

    Where networks that learned from the same few frames err in different pixels, their mean errs less often;
    docs/results/real_streets.json compares it with one of them. The soft-max of mean scores is the networks' geometric mean
    of probabilities, normalised.

    Parameters
    ----------
    members : sequence of Segmenter
        Image networks with the same C classes.
    """

    def __init__(self, members: Sequence[nn.Module]) -> None:
        super().__init__()
        self.members = nn.ModuleList(members)
        self.n_classes = members[0].n_classes

    def forward(self, image: Tensor) -> Tensor:
        """Return s. Parameters are those of `Segmenter.forward`.

        Returns
        -------
        (B, C, h, w) float
            The mean of the networks' scores, before any soft-max.
        """
        return sum(member(image) for member in self.members) / len(self.members)


def with_mean_scores(nets: Sequence[SemanticGridNet]) -> SemanticGridNet:
    """Return a network with the image networks of several, whose mean scores lie on the planes.

    Parameters
    ----------
    nets : sequence of SemanticGridNet
        At least one; of the same architecture and for one camera. Their parts aren't copied.

    Returns
    -------
    SemanticGridNet
        It fuses as the first of them does, which hasn't learned from mean scores: train its fusion network on them.
        One network is returned as it is.
    """
    first = nets[0]
    if len(nets) == 1:
        return first
    members = [member for net in nets for member in getattr(net.segmenter, "members", [net.segmenter])]
    architecture = replace(first.need_architecture(), n_segmenters=len(members))
    joined = SemanticGridNet(MeanSegmenter(members), first.sampler, first.n_classes, architecture=architecture)
    joined.fusion = first.fusion
    return joined


def plane_sampler(architecture: Architecture, camera: Camera) -> PlaneSampler:
    """Return what samples a network's scores on its planes, for one camera. Parameters are those of `build_net`."""
    operator = plane_operator(architecture.grid, architecture.heights, camera.resized(architecture.image_size))
    return PlaneSampler.from_operator(operator)


def plane_operator(grid: GridSpec, heights: ArrayLike, camera: Camera) -> PlaneOperator:
    """Return the operator of a grid, its planes and a camera, equations (1) and (2); the last four are remembered.

    Parameters
    ----------
    grid : GridSpec
        The cells, (H, W) of them.
    heights : (D,) float
        delta_i, the heights of the planes above the ground, metres.
    camera : Camera
        The camera at the size of the image that the network sees, see `Camera.resized`.

    Returns
    -------
    PlaneOperator
        The operator for one image; it is shared by all that ask for the same calibration.
    """
    K, T = (np.asarray(matrix, np.float64).tobytes() for matrix in (camera.K, camera.T_camera_from_lidar))
    return _remembered(grid, tuple(check_heights(heights).tolist()), K, T, tuple(camera.size), camera.lidar_height)


# Bytes stand for the matrices, because a cache needs keys that it can compare. Four calibrations: an operator at the
# paper's scale holds 67 MB.
@lru_cache(maxsize=4)
def _remembered(
    grid: GridSpec, heights: tuple[float, ...], K: bytes, T: bytes, size: tuple[int, int], lidar_height: float
) -> PlaneOperator:
    """Build the operator of a calibration that isn't known yet."""
    camera = Camera(np.frombuffer(K).reshape(3, 3), np.frombuffer(T).reshape(4, 4), size, lidar_height)
    return PlaneOperator.build(*plane_pixels(grid, heights, camera), size)
