"""What the stages do with one frame, from its belief to the refined grid (paper, Fig. 2)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_edu.datasets.resizing import resize_image
from semgrid_edu.frame import Frame
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks import Architecture, unit_image
from semgrid_edu.occupancy import N_STATES, Belief
from semgrid_edu.pipeline.seams import Seam, StageError
from semgrid_edu.pipeline.stages import Stages

STAGES = ("occupancy", "segmentation", "planes", "fusion", "crf")
"""What the five stages do, in their order: l -> o, i -> s, s -> p, (p, o) -> g, g -> refined g."""


@dataclass(frozen=True, eq=False)
class FrameResult:
    """What every stage made of one frame.

    Parameters
    ----------
    frame : Frame
        The frame, with l, the LIDAR points, and i, the image.
    belief : Belief
        o, the occupancy grid, with velocities.
    scores : (C, h, w) float32
        s, the image network's scores before the soft-max, at the size that the network sees.
    grid : (C, H, W) float32
        g, the semantic grid: probabilities of the classes, which sum to 1 in each cell.
    refined : (C, H, W) float32
        The semantic grid after refinement.
    seconds : dict of str to float
        How long each of `STAGES` took, seconds, without the checks between them.
    """

    frame: Frame
    belief: Belief
    scores: NDArray[np.float32]
    grid: NDArray[np.float32]
    refined: NDArray[np.float32]
    seconds: dict[str, float]


class FrameWork:
    """Run one or several sets of stages on a frame; a call that several sets have in common is made only once.

    Parameters
    ----------
    number : int
        Number of the frame, for error messages.
    frame : Frame
        The frame; it has to have an image.
    """

    def __init__(self, number: int, frame: Frame) -> None:
        self._number, self._frame = number, frame
        self._images: dict[tuple[int, int], NDArray[np.float32]] = {}
        self._done: dict[tuple[int, ...], tuple[NDArray[np.float32], float]] = {}

    def image(self, size: tuple[int, int]) -> NDArray[np.float32]:
        """Return the image of the frame as a network takes it, see `network_image`.

        Parameters
        ----------
        size : (int, int)
            Height h and width w, pixels.

        Returns
        -------
        (3, h, w) float32
            RGB, 0..1.
        """
        if size not in self._images:
            self._images[size] = network_image(self._frame, size).numpy()
        return self._images[size]

    def result(self, stages: Stages, belief: Belief, seconds: float) -> FrameResult:
        """Send the frame through the stages that follow the filter.

        Parameters
        ----------
        stages : Stages
            A complete set: five functions and their architecture.
        belief : Belief
            What `stages.track` yields for the frame.
        seconds : float
            How long that took.

        Returns
        -------
        FrameResult
            What every stage made of the frame.

        Raises
        ------
        StageError
            When a stage raises an error, or returns what the next one can't use.
        """
        shapes, o = result_shapes(stages.architecture), belief.probability
        s, t_segment = self._call("segment", stages.segment, shapes, self.image(stages.architecture.image_size))
        p, t_sample = self._call("sample", stages.sample, shapes, s)
        try:
            log_g, t_fuse = self._call("fuse", stages.fuse, shapes, p, o)
        except StageError:
            # The planes hold millions of numbers, so they are searched for NaN after an error, not at each frame.
            Seam("sample", stages.sample, self._number).finite(p)
            raise
        refined, t_refine = self._call("refine", stages.refine, shapes, log_g, o)
        times = dict(zip(STAGES, (seconds, t_segment, t_sample, t_fuse, t_refine), strict=True))
        return FrameResult(self._frame, belief, s, np.exp(log_g), refined, times)

    def _call(
        self, stage: str, function: Callable, shapes: dict[str, tuple[int, ...]], *inputs: NDArray
    ) -> tuple[NDArray[np.float32], float]:
        """Return a stage's result and its time; the same function isn't called again on the same arrays."""
        key = (id(function), *map(id, inputs))
        if key not in self._done:
            self._done[key] = Seam(stage, function, self._number).call(shapes[stage], *inputs)
        return self._done[key]


def result_shapes(architecture: Architecture) -> dict[str, tuple[int, ...]]:
    """Return the shape of what each stage returns, by the name of the stage.

    Parameters
    ----------
    architecture : Architecture
        The grid, the image size, the planes and the classes.

    Returns
    -------
    dict of str to tuple of int
        By the names "track", "segment", "sample", "fuse" and "refine".

    Examples
    --------
    >>> result_shapes(Architecture())["sample"]
    (14, 20, 142, 62)
    """
    n_classes, grid = len(LABEL_SETS[architecture.label_set]), architecture.grid.shape
    return {
        "track": (N_STATES, *grid),
        "segment": (n_classes, *architecture.image_size),
        "sample": (n_classes, len(architecture.heights), *grid),
        "fuse": (n_classes, *grid),
        "refine": (n_classes, *grid),
    }


def network_image(frame: Frame, size: tuple[int, int]) -> Tensor:
    """Turn a frame's image into what a network takes.

    Parameters
    ----------
    frame : Frame
        The frame; it has to have an image.
    size : (int, int)
        Height and width, pixels; `frame.camera.resized(size)` is the camera of the result.

    Returns
    -------
    (3, h, w) float32
        RGB, 0..1.

    Raises
    ------
    ArgumentError
        When the frame has no image.
    """
    return unit_image(torch.tensor(resize_image(frame.need_image(), size)).permute(2, 0, 1))
