"""A drive through every stage, from LIDAR scans and images to refined semantic grids (paper, Fig. 2)."""

from collections.abc import Iterable, Iterator
from itertools import chain

from semgrid_edu.camera import Camera
from semgrid_edu.crf import CrfParams
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import CmcdotParams
from semgrid_edu.pipeline.following import Follower
from semgrid_edu.pipeline.frame_work import FrameResult, FrameWork
from semgrid_edu.pipeline.stages import STAGES, Stages


def run_pipeline(
    frames: Iterable[Frame],
    stages: Stages | SemanticGridNet,
    occupancy: CmcdotParams | None = None,
    crf: CrfParams | None = None,
    seed: int = 0,
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
    complete = _complete(stages, first.camera, occupancy, crf, seed)
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
        Complete sets of stages with the same architecture, such as `own = Stages.of(net)` and `mine.over(own)`.

    Yields
    ------
    tuple of FrameResult
        One result for each set of stages, in their order.

    Raises
    ------
    ArgumentError
        When a set isn't complete, two have different architectures, or a frame has no image.
    StageError
        As for `run_pipeline`.
    """
    architecture = several[0].architecture
    for stages in several:
        if stages.given != tuple(STAGES):
            raise ArgumentError("several", "complete sets of stages, see `Stages.over`", f"only {stages.given}")
        if stages.architecture is None or stages.architecture != architecture:
            raise ArgumentError("several", f"one architecture, such as {architecture}", stages.architecture)
    trackers = {id(stages.track): Follower(stages.track, architecture.grid) for stages in several}
    for number, frame in enumerate(frames):
        work = FrameWork(number, frame, architecture)
        beliefs = {key: tracker.belief(frame, number) for key, tracker in trackers.items()}
        yield tuple(work.result(stages, *beliefs[id(stages.track)]) for stages in several)
    for tracker in trackers.values():
        tracker.finish()


def _complete(
    stages: Stages | SemanticGridNet, camera: Camera, occupancy: CmcdotParams | None, crf: CrfParams | None, seed: int
) -> Stages:
    if isinstance(stages, Stages):
        return stages.completed(camera, occupancy, crf, seed)
    if isinstance(stages, SemanticGridNet):
        return Stages.of(stages, occupancy, crf, seed)
    raise ArgumentError("stages", "a network, or Stages(...) with functions in it", type(stages).__name__)
