"""Images and their labels with fewer pixels, as a coarser sensor would have taken them (section 4.1)."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image


def resize_image(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Average an image over larger pixels; its calibration becomes `camera.resized(size)`.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB.
    size : (int, int)
        The new height and width, pixels.

    Returns
    -------
    (*size, 3) uint8
    """
    return np.asarray(Image.fromarray(image).resize(size[::-1], Image.Resampling.BOX))


def resize_labels(labels: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Give each larger pixel the class that covers most of it; between two equal shares the smaller number wins.

    Parameters
    ----------
    labels : (h, w) uint8
        The class of each pixel; 255 (unlabelled) counts as a class.
    size : (int, int)
        The new height and width, pixels.

    Returns
    -------
    (*size,) uint8
    """
    classes = np.unique(labels)
    masks = (Image.fromarray((labels == c).astype(np.float32)) for c in classes)
    shares = [np.asarray(mask.resize(size[::-1], Image.Resampling.BOX)) for mask in masks]
    return classes[np.argmax(shares, axis=0)]
