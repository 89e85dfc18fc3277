"""A drive through every stage, from LIDAR scan and image to the refined semantic grid (paper, Fig. 2)."""

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import tee

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_edu.crf import CrfParams, mean_field
from semgrid_edu.datasets.resizing import resize_image
from semgrid_edu.frame import Frame
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import Belief, CmcdotParams, track_drive

STAGES = ("occupancy", "segmentation", "planes", "fusion", "crf")
"""The stages in their order: l -> o, i -> s, s -> p, (p, o) -> g, g -> refined g."""


@dataclass(frozen=True, eq=False)
class FrameResult:
    """What every stage made of one frame.

    Parameters
    ----------
    frame : Frame
        What came in: l, the LIDAR points, and i, the image.
    belief : Belief
        o, the occupancy grid, and velocities.
    scores : (C, h, w) float32
        s, the image network's scores, no soft-max, at the size that the network sees.
    grid : (C, H, W) float32
        g, the semantic grid: probabilities of the classes, summing to 1 in each cell.
    refined : (C, H, W) float32
        The same after the CRF.
    seconds : dict of str to float
        How long each of `STAGES` took.
    """

    frame: Frame
    belief: Belief
    scores: NDArray[np.float32]
    grid: NDArray[np.float32]
    refined: NDArray[np.float32]
    seconds: dict[str, float]


def run_pipeline(
    frames: Iterable[Frame],
    net: SemanticGridNet,
    occupancy: CmcdotParams | None = None,
    crf: CrfParams | None = None,
    seed: int = 0,
) -> Iterator[FrameResult]:
    """Send the frames of a drive through every stage, one after the other.

    Parameters
    ----------
    frames : iterable of Frame
        In the order of time, each with an image of any size; read one at a time.
    net : SemanticGridNet
        Of `build_net` or `load_net`, for the camera of the drive; in evaluation mode.
    occupancy : CmcdotParams, optional
    crf : CrfParams, optional
    seed : int
        Of the occupancy filter's particles.

    Yields
    ------
    FrameResult
        One a frame.

    Raises
    ------
    ArgumentError
        When a frame has no image.

    Examples
    --------
    >>> net = load_net("weights.safetensors", drive.camera)                             # doctest: +SKIP
    >>> [result.refined.argmax(axis=0) for result in run_pipeline(drive, net)]          # doctest: +SKIP
    """
    frames, scans = tee(frames)
    beliefs = track_drive(scans, net.architecture.grid, occupancy, seed)
    for frame in frames:
        seconds: dict[str, float] = {}
        i = network_image(frame, net.architecture.image_size)[None]
        with _clock(seconds, "occupancy"):
            belief = next(beliefs)
        with torch.inference_mode():
            o = torch.from_numpy(belief.probability)[None]
            with _clock(seconds, "segmentation"):
                s = net.segmenter(i)
            with _clock(seconds, "planes"):
                p = net.sampler(s)
            with _clock(seconds, "fusion"):
                log_g = net.fusion(p, o)[0].log_softmax(dim=0).numpy()
        with _clock(seconds, "crf"):
            refined = mean_field(-log_g, belief.probability, crf or CrfParams.for_cells(net.architecture.grid.cell))
        yield FrameResult(frame, belief, s[0].numpy(), np.exp(log_g), refined, seconds)


def network_image(frame: Frame, size: tuple[int, int]) -> Tensor:
    """Scale a frame's image to what a network takes.

    Parameters
    ----------
    frame : Frame
        With an image.
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
    return torch.tensor(resize_image(frame.need_image(), size)).permute(2, 0, 1).float() / 255


@contextmanager
def _clock(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - start
