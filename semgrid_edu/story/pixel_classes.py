"""What the pixels say that equation (1) finds for a cell: the image network's classes, and the true ones."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.readers.frames import resize_labels
from semgrid_edu.frame import FrameLabels
from semgrid_edu.labels import IGNORE
from semgrid_edu.pipeline import FrameResult


def classes_at(result: FrameResult, pixels: NDArray, visible: NDArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return what the image network calls the pixels nearest to some points, and what these pixels show.

    Parameters
    ----------
    result : FrameResult
        The frame's result.
    pixels, visible : (..., 2) float, (...) bool
        Where the points are seen in the frame's image (u, v), and whether they are, from `plane_pixels`.

    Returns
    -------
    called, shown : (...) int64
        The class with the highest score, and the true one; 255 where the camera doesn't see the point, and in `shown`
        where nobody labelled the pixel.
    """
    size, labels = np.array(result.scores.shape[1:]), result.frame.labels
    scale = size / np.array(result.frame.camera.size)
    nearest = np.rint((np.where(visible[..., None], pixels, 0) + 0.5) * scale[::-1] - 0.5).astype(np.int64)
    u, v = np.moveaxis(np.clip(nearest, 0, size[::-1] - 1), -1, 0)
    truth = np.full(size, IGNORE) if labels is None else pixel_truth(labels, tuple(size.tolist()))
    called, shown = (np.where(visible, of[v, u], IGNORE) for of in (result.scores.argmax(axis=0), truth))
    return called.astype(np.int64), shown.astype(np.int64)


def pixel_truth(labels: FrameLabels, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the true class of each pixel of an image of another size; 255 where it isn't labelled.

    Parameters
    ----------
    labels : FrameLabels
        What is true of the frame.
    size : (int, int)
        Height and width, pixels.
    """
    return resize_labels(labels.image, size, sparse=labels.undecided is not None)
