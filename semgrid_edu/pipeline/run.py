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
        When a frame has no image.
    StageError
        When a stage raises an error, or returns what the next one can't use. It says which stage, where it is written,
        at which frame, and what is probably wrong.

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

    A function that would get the same arrays in two sets is called only once. So sets that differ only in `refine`
    share everything before it.

    Parameters
    ----------
    frames, occupancy, crf, seed
        As for `run_pipeline`.
    *several : Stages or SemanticGridNet
        The sets of stages, each as in `run_pipeline`.

    Yields
    ------
    tuple of FrameResult
        One result for each set of stages, in their order.

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
    """Return a key for the filter of a set of stages and for its grid: sets with the same key share its beliefs."""
    return id(stages.track), stages.architecture.grid


def _complete(
    stages: Stages | SemanticGridNet, frame: Frame, occupancy: CmcdotParams | None, crf: CrfParams | None, seed: int
) -> Stages:
    if isinstance(stages, Stages):
        return stages.completed(frame.camera, occupancy, crf, seed)
    return Stages.of(stages, occupancy, crf, seed)
