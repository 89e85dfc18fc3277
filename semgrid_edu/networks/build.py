"""Networks by name, and the whole network from a description that a weights file can hold (sections 3.1, 3.4)."""

from dataclasses import dataclass, field

from semgrid_edu.camera import Camera
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks.deeplab import DeepLab
from semgrid_edu.networks.fcn import Fcn
from semgrid_edu.networks.segmenter import Segmenter
from semgrid_edu.networks.segnet import SegNet
from semgrid_edu.networks.semantic_grid import SemanticGridNet
from semgrid_edu.networks.unet import UNet
from semgrid_edu.planes import PlaneSampler, plane_heights

SEGMENTERS = {"segnet": SegNet, "fcn": Fcn, "deeplab": DeepLab, "unet": UNet}
"""Every image network by its name."""


def build_segmenter(name: str, n_classes: int, preset: str = "compact", seed: int = 0) -> Segmenter:
    """Return an image network, i -> s.

    Parameters
    ----------
    name : str
        "segnet", "fcn", "deeplab" or "unet".
    n_classes : int
        C.
    preset : str
        "compact" for the CPU, "paper" for the published size.
    seed : int
        Of the initial weights.

    Returns
    -------
    Segmenter
        (B, 3, h, w) RGB in 0..1 -> (B, C, h, w) scores, no soft-max.

    Raises
    ------
    ArgumentError
        When there is no such network or preset.

    Examples
    --------
    >>> sum(p.numel() for p in build_segmenter("segnet", n_classes=14).parameters())
    174206
    """
    if name not in SEGMENTERS:
        raise ArgumentError("name", f"one of {', '.join(SEGMENTERS)}", repr(name))
    if n_classes < 1:
        raise ArgumentError("n_classes", "at least one class", n_classes)
    return SEGMENTERS[name](n_classes, preset=preset, seed=seed)


@dataclass(frozen=True)
class Architecture:
    """Everything that decides the shapes of a network's weights and where its planes lie.

    Parameters
    ----------
    segmenter, preset : str
        As `build_segmenter` takes them.
    label_set : str
        The classes of scores and grid.
    image_size : (int, int)
        h, w that the image is scaled to, pixels. (96, 320) keeps KITTI's aspect at a fifteenth of its pixels.
    grid : GridSpec
        The cells.
    heights : (D,) float
        delta_i of the planes, metres.
    """

    segmenter: str = "segnet"
    preset: str = "compact"
    label_set: str = "KITTI-14"
    image_size: tuple[int, int] = (96, 320)
    grid: GridSpec = field(default_factory=GridSpec.compact)
    heights: tuple[float, ...] = tuple(plane_heights().tolist())


def build_net(architecture: Architecture, camera: Camera, seed: int = 0) -> SemanticGridNet:
    """Return the whole network for one camera, with fresh weights.

    Parameters
    ----------
    architecture : Architecture
    camera : Camera
        As it took its images; the network sees them at `architecture.image_size`.
    seed : int
        Of the initial weights.

    Returns
    -------
    SemanticGridNet
        Its `architecture` says how it was built.

    Raises
    ------
    ArgumentError
        When there is no such label set, image network or preset.
    """
    if architecture.label_set not in LABEL_SETS:
        raise ArgumentError("label_set", f"one of {', '.join(LABEL_SETS)}", repr(architecture.label_set))
    n_classes = len(LABEL_SETS[architecture.label_set])
    resized = camera.resized(architecture.image_size)
    sampler = PlaneSampler.for_camera(architecture.grid, architecture.heights, resized)
    segmenter = build_segmenter(architecture.segmenter, n_classes, architecture.preset, seed)
    net = SemanticGridNet(segmenter, sampler, n_classes, seed)
    net.architecture = architecture
    return net
