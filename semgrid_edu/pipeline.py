"""One frame through the whole system, from LIDAR scan and image to the refined semantic grid (paper, Fig. 2).

Read `run_frame` first: it calls the five stages by name, from top to bottom. `Stages` holds them, and any of them can
be exchanged for one of your own. `run_pipeline` sends the frames of a drive through them, and checks what each stage
hands to the next.

`Stages.of(net)` is the book's own code, which can be read. `Stages.fast(net)` does the same with the compiled twins of
`semgrid_edu.fast`.
"""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import Camera
from semgrid_edu.crf import CrfParams
from semgrid_edu.datasets.samples import sample_weights
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame, resize_image
from semgrid_edu.memory import MemoryParams, View
from semgrid_edu.networks import Architecture, SemanticGridNet, load_net
from semgrid_edu.occupancy import Belief, CmcdotParams
from semgrid_edu.stages import REMEMBER, STAGES, StageError, Stages, class_memory

__all__ = [
    "REMEMBER",
    "STAGES",
    "FrameResult",
    "StageError",
    "Stages",
    "network_image",
    "run_frame",
    "run_pipeline",
]


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
        g, the semantic grid: class probabilities, which sum to 1 in each cell.
    refined : (C, H, W) float32
        The semantic grid after refinement by the CRF.
    seconds : dict of str to float
        How long each stage took, seconds, by the name of the stage.
    remembered : (C, H, W) float32, or None
        The semantic grid of this frame combined with what earlier frames said of its cells; None without memory. The
        CRF doesn't refine it.
    """

    frame: Frame
    belief: Belief
    scores: NDArray[np.float32]
    grid: NDArray[np.float32]
    refined: NDArray[np.float32]
    seconds: dict[str, float]
    remembered: NDArray[np.float32] | None = None


def run_frame(frame: Frame, stages: Stages) -> FrameResult:
    """Send one frame through the five stages, and through the memory if there is one.

    Parameters
    ----------
    frame : Frame
        The next frame of a drive, with a scan and an image.
    stages : Stages
        A complete set of stages: `Stages.of(net)`, or one of your own after `Stages.started`, which checks what each
        stage returns. Its tracker and its memory remember this frame.

    Returns
    -------
    FrameResult
        The result of every stage.

    Raises
    ------
    ArgumentError
        When a stage was left out or is a generator, or the frame has no image.
    """
    stages.need_ready()
    image = network_image(frame, stages.image_size)
    clock = Stopwatch()

    # l -> o: a Bayes filter turns the LIDAR scans so far into an occupancy grid (section 3.2).
    belief = stages.track.step(frame)
    occupancy = belief.probability
    clock.lap("track")

    # i -> s: an image network scores every class at every pixel (section 3.1).
    scores = stages.segment(image)
    clock.lap("segment")

    # s -> p: the scores are sampled on horizontal planes above the ground (section 3.3, equations (1) and (2)).
    planes = stages.sample(scores)
    clock.lap("sample")

    # (p, o) -> g: a small network fuses planes and occupancy into the semantic grid (section 3.4).
    if stages.return_heights is None:
        log_grid = stages.fuse(planes, occupancy)
    else:  # the network for real streets also gets the heights of the returns; the paper's doesn't
        log_grid = stages.fuse(planes, occupancy, stages.return_heights(frame))
    clock.lap("fuse")

    # g -> g: a fully connected CRF refines the grid (section 3.5, equations (3) and (4)).
    refined = stages.refine(log_grid, occupancy)
    clock.lap("refine")

    # g -> g over frames: the paper forgets; this optional stage keeps the classes of earlier frames.
    grid = np.exp(log_grid)
    remembered = None
    if stages.remember is not None:
        remembered = stages.remember.step(View(frame, belief, grid))
        clock.lap("remember")
    return FrameResult(frame, belief, scores, grid, refined, clock.seconds, remembered)


def run_pipeline(
    frames: Iterable[Frame],
    stages: Stages | SemanticGridNet,
    occupancy: CmcdotParams | None = None,
    crf: CrfParams | None = None,
    seed: int = 0,
    memory: bool | MemoryParams = False,
) -> Iterator[FrameResult]:
    """Send the frames of a drive through every stage, and check what each stage hands to the next.

    Parameters
    ----------
    frames : iterable of Frame
        The frames in the order of time, each with an image of any size. They are read one at a time.
    stages : Stages or SemanticGridNet
        A set of stages, or a network from `build_net` or `load_net` for the camera of the drive, in evaluation mode.
        A network is run by `Stages.fast`, which also fills what a set leaves out: a set without `segment`, `sample` or
        `fuse` gets the shipped SegNet. The drive is run by copies of tracker and memory, so the same set can be used
        for the next one.
    occupancy, crf, seed, memory
        Parameters of the stages that the package adds, see `Stages.of`.

    Returns
    -------
    iterator of FrameResult
        What every stage made of each frame.

    Raises
    ------
    ArgumentError
        When `stages` is neither, a frame has no image, or a parameter is given for a stage that the set already has.
    StageError
        When a stage of your own raises an error, or a stage returns what the next one can't use. The message says
        which stage, where it is written, at which frame, and what is probably wrong.

    Examples
    --------
    >>> net = load_net("weights.safetensors", drive.camera)                             # doctest: +SKIP
    >>> [result.refined.argmax(axis=0) for result in run_pipeline(drive, net)]          # doctest: +SKIP
    >>> [result.grid for result in run_pipeline(drive, Stages(refine=my_refine))]       # doctest: +SKIP
    """
    if not isinstance(stages, Stages | SemanticGridNet):
        raise ArgumentError("stages", "a network, or Stages(...) with functions in it", type(stages).__name__)
    if isinstance(stages, Stages):
        options = {"occupancy": ("track", occupancy), "seed": ("track", seed or None)}
        options |= {"crf": ("refine", crf), "memory": ("remember", memory or None)}
        for name, (stage, value) in options.items():
            if value is not None and stage in stages.given:
                raise ArgumentError(name, f"nothing, because the set has a stage `{stage}` already", value)
    return _results(frames, partial(_completed, stages, occupancy, crf, seed, memory))


def _results(frames: Iterable[Frame], stages_for: Callable[[Camera], Stages]) -> Iterator[FrameResult]:
    """Yield what every stage makes of each frame, by the stages for the camera of the first frame."""
    running = None
    for frame in frames:
        if not isinstance(frame, Frame):
            raise ArgumentError("frames", "the frames of a drive", repr(frame)[:100])
        if running is None:
            running = stages_for(frame.camera).started()
        yield run_frame(frame, running)


def _completed(
    stages: Stages | SemanticGridNet,
    occupancy: CmcdotParams | None,
    crf: CrfParams | None,
    seed: int,
    memory: bool | MemoryParams,
    camera: Camera,
) -> Stages:
    """Fill what a set leaves out by the package's fast stages. Parameters are those of `run_pipeline`."""
    if isinstance(stages, SemanticGridNet):
        return Stages.fast(stages, occupancy, crf=crf, seed=seed, memory=memory)
    if not set(STAGES) <= set(stages.given):
        stages = stages.over(Stages.fast(load_net(sample_weights(), camera), occupancy, crf=crf, seed=seed))
    if memory is not False:
        stages = replace(stages, remember=class_memory(memory, stages.architecture or Architecture()))
    return stages


def network_image(frame: Frame, size: tuple[int, int]) -> NDArray[np.float32]:
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
    return resize_image(frame.need_image(), size).transpose(2, 0, 1) / np.float32(255)


class Stopwatch:
    """Measures how long the stages take, one after the other.

    Attributes
    ----------
    seconds : dict of str to float
        The seconds of each stage, by name.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        """Note the time since the last lap.

        Parameters
        ----------
        name : str
            The stage that has just ended.
        """
        now = time.perf_counter()
        self.seconds[name] = now - self._last
        self._last = now
