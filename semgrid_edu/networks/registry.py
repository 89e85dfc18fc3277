"""Every image network by its name: a new one is added here (paper, section 3.1)."""

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.conv_deconv import SegNet
from semgrid_edu.networks.deeplab import DeepLab
from semgrid_edu.networks.efficientnet import EfficientNet
from semgrid_edu.networks.fcn import Fcn
from semgrid_edu.networks.segmenter import Segmenter
from semgrid_edu.networks.unet import UNet

SEGMENTERS: dict[str, type[Segmenter]] = {
    "segnet": SegNet,
    "fcn": Fcn,
    "deeplab": DeepLab,
    "unet": UNet,
    "efficientnet": EfficientNet,
}
"""Commands, experiments, benchmarks and tests all look here, so a new network needs its module and one line here."""


def build_segmenter(name: str, n_classes: int, preset: str = "compact", seed: int = 0) -> Segmenter:
    """Return an image network, i -> s, with fresh weights.

    Parameters
    ----------
    name : str
        A name in `SEGMENTERS`, such as "segnet".
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
