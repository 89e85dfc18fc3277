"""From the bytes of an image to the numbers that an image network takes (paper, section 3.1)."""

import torch
from torch import Tensor

from semgrid_edu.errors import ArgumentError


def unit_image(image: Tensor) -> Tensor:
    """Scale the bytes of an image to 0..1.

    Parameters
    ----------
    image : (..., 3, h, w) uint8
        RGB, 0..255.

    Returns
    -------
    (..., 3, h, w) float32
        RGB, 0..1. Of PyTorch's default type, which is float32 unless a program sets another.

    Raises
    ------
    ArgumentError
        When the image isn't of bytes: it may have been scaled before.

    Examples
    --------
    >>> unit_image(torch.tensor([0, 51, 255], dtype=torch.uint8))
    tensor([0.0000, 0.2000, 1.0000])
    """
    if image.dtype != torch.uint8:
        raise ArgumentError("image", "bytes, 0..255, torch.uint8", image.dtype)
    return image / 255
