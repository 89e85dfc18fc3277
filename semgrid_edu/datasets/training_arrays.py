"""The arrays that a network is trained on: resized images, occupancy, and the truth of each cell (section 4.1).

Changing this module, or anything it imports, invalidates the arrays that `cached_arrays` keeps. So it contains only the
code that makes arrays.
"""

from collections.abc import Callable, Sequence
from itertools import tee
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.grid_truth import truth_to_learn
from semgrid_edu.datasets.project_lidar import seen_returns
from semgrid_edu.errors import DataError
from semgrid_edu.frame import Frame, resize_image
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import CmcdotParams, track_drive
from semgrid_edu.planes import cell_heights

SEED = 0
"""Seed for the occupancy filter's particles, the same for each drive."""


class ArrayRecipe(NamedTuple):
    """How to make the arrays.

    Parameters
    ----------
    spec : GridSpec
        The grid of occupancy and truth.
    image_size : (int, int)
        Height and width of the resized images, pixels.
    params : CmcdotParams
        Parameters of the occupancy filter.
    track : callable
        Runs the filter over a drive: `track_drive`, or its fast twin.
    """

    spec: GridSpec
    image_size: tuple[int, int]
    params: CmcdotParams
    track: Callable = track_drive


def drive_arrays(drive: FrameSequence, labelled: Sequence[int], recipe: ArrayRecipe) -> list[dict[str, NDArray]]:
    """Run the occupancy filter over a drive, and make the arrays of its labelled frames.

    Parameters
    ----------
    drive : FrameSequence
        The drive.
    labelled : sequence of int
        Numbers of its labelled frames.
    recipe : ArrayRecipe
        Grid, image size and occupancy filter.

    Returns
    -------
    list of dict of str to array
        For each labelled frame "image" (3, h, w) uint8, "labels" (h, w) uint8, "occupancy" (4, H, W) float32, "truth"
        (H, W) uint8, "return_heights" (2, H, W) float32 from `cell_heights`, and "return_pixels" and "return_cells"
        from `seen_returns`.
    """
    read = getattr(drive, "without_labels", drive.__getitem__)  # `image_labels` and `truth` make the labels
    numbers = tqdm(range(max(labelled) + 1), desc=drive.name, unit="frame", leave=False)
    frames, scans = tee(read(k) for k in numbers)
    beliefs = recipe.track(scans, recipe.spec, recipe.params, SEED)
    arrays = {
        k: _frame_arrays(drive, k, frame, belief.probability, recipe)
        for k, (frame, belief) in enumerate(zip(frames, beliefs, strict=True))
        if k in labelled
    }
    return [arrays[k] for k in labelled]


def _frame_arrays(
    drive: FrameSequence, k: int, frame: Frame, occupancy: NDArray, recipe: ArrayRecipe
) -> dict[str, NDArray]:
    """Make the arrays of one frame."""
    if frame.image is None:
        raise DataError(drive.name, f"an image of the frame {k}, which is listed as labelled", "none")
    pixels, cells = seen_returns(frame, recipe.spec, recipe.image_size)
    return {
        "image": resize_image(frame.image, recipe.image_size).transpose(2, 0, 1),
        "labels": drive.image_labels(k, recipe.image_size),
        "occupancy": occupancy.astype(np.float32),
        "truth": truth_to_learn(drive, k, occupancy, recipe.spec),
        "return_heights": cell_heights(frame.points_grid, recipe.spec).astype(np.float32),
        "return_pixels": pixels,
        "return_cells": cells,
    }
