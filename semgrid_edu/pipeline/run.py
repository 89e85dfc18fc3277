"""A drive through every stage, from LIDAR scans and images to refined semantic grids (paper, Fig. 2)."""

from collections.abc import Iterable, Iterator

from semgrid_edu.crf import CrfParams
from semgrid_edu.frame import Frame
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import CmcdotParams
from semgrid_edu.pipeline.following import Follower
from semgrid_edu.pipeline.frame_work import FrameResult, FrameWork
from semgrid_edu.pipeline.stages import Stages


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
        In the order of time, each with an image of any size; read one at a time.
    stages : Stages or SemanticGridNet
        Five functions; the package's own stand in for those that are left out (`Stages.completed`). Or a network of
        `build_net` or `load_net`, for the camera of the drive and in evaluation mode: then all five are the package's.
    occupancy : CmcdotParams, optional
        What the package's filter assumes.
    crf : CrfParams, optional
        Of the package's refinement; `CrfParams.for_cells` when left out.
    seed : int
        Seed for the particles of the package's filter.

    Yields
    ------
    FrameResult
        One for each frame.

    Raises
    ------
    ArgumentError
        When a frame has no image.
    StageError
        When a stage raises an error, or returns what the next one can't use: which stage, where it is written, at
        which frame, and what is probably wrong.

    Examples
    --------
    >>> net = load_net("weights.safetensors", drive.camera)                             # doctest: +SKIP
    >>> [result.refined.argmax(axis=0) for result in run_pipeline(drive, net)]          # doctest: +SKIP
    >>> [result.grid for result in run_pipeline(drive, Stages(track=my_filter))]        # doctest: +SKIP
    """
    for (result,) in run_side_by_side(frames, stages, occupancy=occupancy, crf=crf, seed=seed):
        yield result


def run_side_by_side(
    frames: Iterable[Frame],
    *several: Stages | SemanticGridNet,
    occupancy: CmcdotParams | None = None,
    crf: CrfParams | None = None,
    seed: int = 0,
) -> Iterator[tuple[FrameResult, ...]]:
    """Send each frame through several sets of stages, to compare them.

    Where the same function would get the same arrays in two sets, it is called once: sets that differ in `refine` alone
    share everything before it.

    Parameters
    ----------
    frames, occupancy, crf, seed
        As for `run_pipeline`.
    *several : Stages or SemanticGridNet
        The sets of stages.

    Yields
    ------
    tuple of FrameResult
        One for each set of stages.

    Raises
    ------
    ArgumentError, StageError
        As for `run_pipeline`.
    """
    sets: list[Stages] = []
    followers: dict[tuple, Follower] = {}
    for number, frame in enumerate(frames):
        if not sets:
            sets = [_complete(stages, frame, occupancy, crf, seed) for stages in several]
            followers = {_filter_of(s): Follower(s.track, s.architecture.grid) for s in sets}
        work = FrameWork(number, frame)
        beliefs = {key: follower.belief(frame, number) for key, follower in followers.items()}
        yield tuple(work.result(stages, *beliefs[_filter_of(stages)]) for stages in sets)
    for follower in followers.values():
        follower.finish()


def _filter_of(stages: Stages) -> tuple:
    """Return by what a filter is told apart: sets that have it in common share its beliefs."""
    return id(stages.track), stages.architecture.grid


def _complete(
    stages: Stages | SemanticGridNet, frame: Frame, occupancy: CmcdotParams | None, crf: CrfParams | None, seed: int
) -> Stages:
    if isinstance(stages, Stages):
        return stages.completed(frame.camera, occupancy, crf, seed)
    return Stages.of(stages, occupancy, crf, seed)
