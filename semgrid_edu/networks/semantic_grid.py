"""The whole network, from image and occupancy grid to semantic grid, learnt end to end (paper, Fig. 2)."""

from typing import NamedTuple

from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.fusion import FusionNet
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.planes import PlaneSampler


class Stages(NamedTuple):
    """What the network computes on its way, each a symbol of Fig. 2.

    Parameters
    ----------
    scores : (B, C, h, w) float
        s, of the image.
    planes : (B, C, D, H, W) float
        p, the scores on the planes.
    logits : (B, C, H, W) float
        g before the soft-max.
    """

    scores: Tensor
    planes: Tensor
    logits: Tensor


class SemanticGridNet(nn.Module):
    """Segment the image, sample its scores on the planes, fuse them with the occupancy grid.

    Every step is differentiable, so that the loss on the grid teaches the image network as well.

    Parameters
    ----------
    segmenter : Module
        i -> s; its `n_classes`, where it has one, is the C of the scores, which is else that of the grid.
    sampler : PlaneSampler
        s -> p, for one calibration.
    n_classes : int
        C of the semantic grid.
    seed : int
        Of the initial weights of the fusion.
    """

    def __init__(self, segmenter: nn.Module, sampler: PlaneSampler, n_classes: int, seed: int = 0) -> None:
        super().__init__()
        self.segmenter = segmenter
        self.sampler = sampler
        self.n_classes = n_classes
        n_scores = getattr(segmenter, "n_classes", n_classes)
        self.fusion = FusionNet(n_scores, sampler.planes_shape[0], n_classes, seed=seed)

    def stages(self, image: Tensor, occupancy: Tensor) -> Stages:
        """Return the result and what led to it.

        Parameters
        ----------
        image : (B, 3, h, w) float
            RGB, 0..1.
        occupancy : (B, 4, H, W) float
            Probability of FREE, STATIC, DYNAMIC, UNKNOWN.

        Raises
        ------
        ArgumentError
            When a size isn't the one that the network was built for, one of the two isn't of floats, or there
            aren't as many of one as of the other.
        """
        _check("image", image, (3, *self.sampler.image_size))
        _check("occupancy", occupancy, (N_STATES, *self.sampler.planes_shape[1:]))
        if len(image) != len(occupancy):
            raise ArgumentError("occupancy", f"one for each of the {len(image)} images", len(occupancy))
        scores = self.segmenter(image)
        planes = self.sampler(scores)
        return Stages(scores, planes, self.fusion(planes, occupancy))

    def forward(self, image: Tensor, occupancy: Tensor) -> Tensor:
        """Return the logits of the semantic grid, (B, C, H, W); arguments as in `stages`."""
        return self.stages(image, occupancy).logits


def _check(name: str, batch: Tensor, shape: tuple[int, ...]) -> None:
    if batch.ndim != 4 or tuple(batch.shape[1:]) != shape:
        raise ArgumentError(name, f"shape (B, {', '.join(map(str, shape))})", tuple(batch.shape))
    if not batch.is_floating_point():
        raise ArgumentError(name, "floats in 0..1", batch.dtype)
