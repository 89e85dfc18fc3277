"""The whole network with the fast plane sampler; everything else is the book's."""

from pathlib import Path

from semgrid_edu import networks as book
from semgrid_edu.camera import Camera
from semgrid_edu.fast.planes import PlaneSampler
from semgrid_edu.networks import Architecture, SemanticGridNet


def build_net(architecture: Architecture, camera: Camera, seed: int = 0) -> SemanticGridNet:
    """Return the whole network for one camera, with fresh weights. Parameters and result are those of `build_net`."""
    return book.build_net(architecture, camera, seed, PlaneSampler)


def with_fast_sampler(net: SemanticGridNet) -> SemanticGridNet:
    """Return a network with the same layers and the fast sampler.

    Parameters
    ----------
    net : SemanticGridNet
        The network.
    """
    book = net.sampler
    if isinstance(book, PlaneSampler):
        return net
    sampler = PlaneSampler(book.pixels, book.visible, book.image_size)
    fast = SemanticGridNet(net.segmenter, sampler, net.n_classes, architecture=net.architecture, fusion=net.fusion)
    return fast.train(net.training)


def load_net(path: str | Path, camera: Camera) -> SemanticGridNet:
    """Read a trained network and place its planes. Parameters, result and errors are those of `load_net`."""
    return book.load_net(path, camera, PlaneSampler)
