"""A drive through every stage, from LIDAR scans and images to refined semantic grids (paper, Fig. 2)."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_edu.camera import Camera
from semgrid_edu.crf import CrfParams
from semgrid_edu.datasets.training_arrays import resize_image
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.memory import MemoryParams, View
from semgrid_edu.networks import Architecture, SemanticGridNet, unit_image
from semgrid_edu.occupancy import Belief, CmcdotParams
from semgrid_edu.pipeline.checks import StageCheck, StageError
from semgrid_edu.pipeline.stages import STAGES, Stages
from semgrid_edu.pipeline.tracker_adapter import MemoryAdapter, TrackerAdapter


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
        How long each stage took, seconds, without the checks between them; by the names "track", "segment", "sample",
        "fuse" and "refine", and "remember" with memory.
    remembered : (C, H, W) float32, or None
        The semantic grid of this frame joined with what earlier frames said of its cells; None without memory. The CRF
        doesn't refine it.
    """

    frame: Frame
    belief: Belief
    scores: NDArray[np.float32]
    grid: NDArray[np.float32]
    refined: NDArray[np.float32]
    seconds: dict[str, float]
    remembered: NDArray[np.float32] | None = None


def run_pipeline(
    frames: Iterable[Frame],
    stages: Stages | SemanticGridNet,
    occupancy: CmcdotParams | None = None,
    crf: CrfParams | None = None,
    seed: int = 0,
    memory: bool | MemoryParams = False,
) -> Iterator[FrameResult]:
    """Send the frames of a drive through every stage, one after the other, and check what each stage hands on.

    Parameters
    ----------
    frames : iterable of Frame
        The frames in the order of time, each with an image of any size. They are read one at a time.
    stages : Stages or SemanticGridNet
        A set of stages, in which the package's own replace those that are left out (`Stages.completed`). Or a network
        from `build_net` or `load_net`, for the camera of the drive and in evaluation mode: then all five stages are the
        package's own.
    occupancy : CmcdotParams, optional
        Parameters of the package's filter.
    crf : CrfParams, optional
        Parameters of the package's refinement; `CrfParams.for_cells` when left out.
    seed : int
        Seed for the particles of the package's filter.
    memory : bool or MemoryParams
        Whether class beliefs are carried over frames, or the parameters with which they are: then the results carry
        `remembered`. A `remember` of your own stages takes the place of the package's.

    Yields
    ------
    FrameResult
        What every stage made of the frame; one result for each frame.

    Raises
    ------
    ArgumentError
        When `stages` is neither, or a frame has no image.
    StageError
        When a stage raises an error, or returns what the next one can't use. It says which stage, where it is written,
        at which frame, and what is probably wrong.

    Examples
    --------
    >>> net = load_net("weights.safetensors", drive.camera)                             # doctest: +SKIP
    >>> [result.refined.argmax(axis=0) for result in run_pipeline(drive, net)]          # doctest: +SKIP
    >>> [result.grid for result in run_pipeline(drive, Stages(track=my_filter))]        # doctest: +SKIP
    """
    frames = iter(frames)
    first = next(frames, None)
    if first is None:
        return
    if not isinstance(first, Frame):
        raise ArgumentError("frames", "the frames of a drive", repr(first)[:100])
    complete = _complete(stages, first.camera, occupancy, crf, seed, memory)
    for (result,) in run_side_by_side(chain([first], frames), complete):
        yield result


def run_side_by_side(frames: Iterable[Frame], *several: Stages) -> Iterator[tuple[FrameResult, ...]]:
    """Send each frame through several sets of stages, to compare them.

    A function that would get the same arrays in two sets is called only once. So sets that differ only in `refine`
    share everything before it.

    Parameters
    ----------
    frames : iterable of Frame
        What `run_pipeline` takes.
    *several : Stages
        Complete sets of stages with one `Architecture.layout`, such as `own = Stages.of(net)` and `mine.over(own)`.

    Yields
    ------
    tuple of FrameResult
        One result for each set of stages, in their order.

    Raises
    ------
    ArgumentError
        When a set isn't complete, two have different layouts, or a frame has no image.
    StageError
        As for `run_pipeline`.
    """
    architecture = several[0].architecture
    for stages in several:
        if not set(STAGES) <= set(stages.given):
            raise ArgumentError("several", "complete sets of stages, see `Stages.over`", f"only {stages.given}")
        if stages.architecture is None or stages.architecture.layout != architecture.layout:
            raise ArgumentError("several", f"one architecture, such as {architecture}", stages.architecture)
    trackers = {id(stages.track): TrackerAdapter(stages.track, architecture.grid) for stages in several}
    memories = [MemoryAdapter(stages.remember, architecture.grid) if stages.remember else None for stages in several]
    for number, frame in enumerate(frames):
        work = FrameRunner(number, frame, architecture)
        beliefs = {key: tracker.belief(frame, number) for key, tracker in trackers.items()}
        results = [work.result(stages, *beliefs[id(stages.track)]) for stages in several]
        yield tuple(_remembering(result, memory, number) for result, memory in zip(results, memories, strict=True))
    for adapter in (*trackers.values(), *filter(None, memories)):
        adapter.finish()


def _remembering(result: FrameResult, memory: MemoryAdapter | None, number: int) -> FrameResult:
    """Return a frame's result with what the memory makes of it."""
    if memory is None:
        return result
    remembered, seconds = memory.grid(View(result.frame, result.belief, result.grid), number)
    return replace(result, remembered=remembered, seconds=result.seconds | {"remember": seconds})


def _complete(
    stages: Stages | SemanticGridNet,
    camera: Camera,
    occupancy: CmcdotParams | None,
    crf: CrfParams | None,
    seed: int,
    memory: bool | MemoryParams,
) -> Stages:
    if isinstance(stages, Stages):
        return stages.completed(camera, occupancy, crf, seed, memory)
    if isinstance(stages, SemanticGridNet):
        return Stages.of(stages, occupancy, crf, seed, memory=memory)
    raise ArgumentError("stages", "a network, or Stages(...) with functions in it", type(stages).__name__)


class FrameRunner:
    """Run one or several sets of stages on one frame, and make a call that several sets share only once.

    Parameters
    ----------
    number : int
        Number of the frame, for error messages.
    frame : Frame
        The frame; it has to have an image.
    architecture : Architecture
        What all sets work with: the grid, the image size, the planes and the classes.
    """

    def __init__(self, number: int, frame: Frame, architecture: Architecture) -> None:
        self._number, self._frame = number, frame
        self._image = network_image(frame, architecture.image_size).numpy()
        self._shapes = _result_shapes(architecture)
        self._done: dict[tuple[int, ...], tuple[NDArray[np.float32], float]] = {}

    def result(self, stages: Stages, belief: Belief, seconds: float) -> FrameResult:
        """Send the frame through the stages that follow the filter.

        Parameters
        ----------
        stages : Stages
            A complete set: five functions.
        belief : Belief
            What `stages.track` yields for the frame.
        seconds : float
            How long that took.
        """
        o = belief.probability
        s, t_segment = self._call("segment", stages.segment, self._image)
        p, t_sample = self._call("sample", stages.sample, s)
        try:
            log_g, t_fuse = self._call("fuse", stages.fuse, p, o)
        except StageError:
            # The planes hold millions of numbers, so they are searched for NaN after an error, not at each frame.
            StageCheck("sample", stages.sample, self._number).finite(p)
            raise
        refined, t_refine = self._call("refine", stages.refine, log_g, o)
        times = dict(zip(STAGES, (seconds, t_segment, t_sample, t_fuse, t_refine), strict=True))
        return FrameResult(self._frame, belief, s, np.exp(log_g), refined, times)

    def _call(self, stage: str, function: Callable, *inputs: NDArray) -> tuple[NDArray[np.float32], float]:
        """Return a stage's result and its time; the same function isn't called again on the same arrays."""
        key = (id(function), *map(id, inputs))
        if key not in self._done:
            self._done[key] = StageCheck(stage, function, self._number).call(self._shapes[stage], *inputs)
        return self._done[key]


def _result_shapes(architecture: Architecture) -> dict[str, tuple[int, ...]]:
    """Return the shape of what each stage after the filter returns, by the name of the stage."""
    n_classes, grid = len(LABEL_SETS[architecture.label_set]), architecture.grid.shape
    return {
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
