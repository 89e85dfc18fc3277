"""The whole network from its description and a camera (paper, section 3)."""

from collections.abc import Sequence
from dataclasses import replace

from torch import Tensor, nn

from semgrid_edu.camera import Camera
from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks.registry import build_segmenter
from semgrid_edu.networks.semantic_grid import Architecture, SemanticGridNet
from semgrid_edu.planes import PlaneSampler, plane_pixels


def build_net(
    architecture: Architecture, camera: Camera, seed: int = 0, sampler: type[nn.Module] = PlaneSampler
) -> SemanticGridNet:
    """Return the whole network for one camera, with fresh weights.

    Parameters
    ----------
    architecture : Architecture
        What to build.
    camera : Camera
        The camera at its original image size; the network sees images at `architecture.image_size`.
    seed : int
        Seed for the initial weights.
    sampler : type
        The class that samples the planes: `PlaneSampler`, or `fast.PlaneSampler`, which needs less time.

    Returns
    -------
    SemanticGridNet
        The network, in training mode, like any new PyTorch module.
    """
    if architecture.label_set not in LABEL_SETS:
        raise ArgumentError("label_set", f"one of {', '.join(LABEL_SETS)}", repr(architecture.label_set))
    n_classes = len(LABEL_SETS[architecture.label_set])
    members = [
        build_segmenter(architecture.segmenter, n_classes, architecture.preset, seed + k)
        for k in range(architecture.n_segmenters)
    ]
    segmenter = members[0] if len(members) == 1 else MeanSegmenter(members)
    planes = plane_sampler(architecture, camera, sampler)
    return SemanticGridNet(segmenter, planes, n_classes, seed, architecture=architecture)


def plane_sampler(architecture: Architecture, camera: Camera, sampler: type[nn.Module] = PlaneSampler) -> nn.Module:
    """Return the module that samples a network's scores on its planes. Parameters are those of `build_net`."""
    camera = camera.resized(architecture.image_size)
    pixels, visible = plane_pixels(architecture.grid, architecture.heights, camera)
    return sampler(pixels, visible, camera.size)


class MeanSegmenter(nn.Module):
    """An ensemble of image networks: s is the mean of their scores.

    Networks trained on the same few frames make different mistakes, so their mean makes fewer. The network of
    `segnet_real_weights` is such a mean of three.

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
        """Return s, (B, C, h, w), before any soft-max. Parameters are those of `Segmenter.forward`."""
        return sum(member(image) for member in self.members) / len(self.members)


def with_mean_scores(nets: Sequence[SemanticGridNet]) -> SemanticGridNet:
    """Return a network that samples the mean scores of several networks' image networks on its planes.

    Parameters
    ----------
    nets : sequence of SemanticGridNet
        At least one, all with the same architecture and camera. Their parts aren't copied.

    Returns
    -------
    SemanticGridNet
        It has the first one's fusion network, which must still be trained on mean scores. A single network is returned
        unchanged.
    """
    first = nets[0]
    if len(nets) == 1:
        return first
    members = [member for net in nets for member in getattr(net.segmenter, "members", [net.segmenter])]
    architecture = replace(first.need_architecture(), n_segmenters=len(members))
    segmenter = MeanSegmenter(members)
    return SemanticGridNet(segmenter, first.sampler, first.n_classes, architecture=architecture, fusion=first.fusion)
