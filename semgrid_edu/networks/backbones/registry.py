"""Every image network by its name: the one place where a new one is entered (paper, section 3.1)."""

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.backbones.deeplab import DeepLab
from semgrid_edu.networks.backbones.fcn import Fcn
from semgrid_edu.networks.backbones.segmenter import Segmenter
from semgrid_edu.networks.backbones.segnet import SegNet
from semgrid_edu.networks.backbones.unet import UNet

SEGMENTERS: dict[str, type[Segmenter]] = {"segnet": SegNet, "fcn": Fcn, "deeplab": DeepLab, "unet": UNet}
"""Every image network by its name. `build_segmenter`, the command line, the ImageNet loader, the experiments, the
benchmarks and the tests all look here, so that a new network needs one line here and its own module."""


def build_segmenter(name: str, n_classes: int, preset: str = "compact", seed: int = 0) -> Segmenter:
    """Return an image network, i -> s, with fresh weights.

    Parameters
    ----------
    name : str
        A name in `SEGMENTERS`: "segnet", "fcn", "deeplab", "unet".
    n_classes : int
        C, the number of classes that are scored.
    preset : str
        "compact" for the CPU, "paper" for the published size.
    seed : int
        Seed for the initial weights.

    Returns
    -------
    Segmenter
        (B, 3, h, w) RGB in 0..1 -> (B, C, h, w) scores, without a soft-max.

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
