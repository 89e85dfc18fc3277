"""The stages of the system as functions that can be exchanged (paper, Fig. 2), and a sixth that the paper cut."""

import inspect
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_edu.camera import Camera
from semgrid_edu.crf import CrfParams, unary_from_log_probability
from semgrid_edu.datasets.samples import sample_weights
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import mean_field
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.memory import MemoryParams, View, remember_drive
from semgrid_edu.networks import Architecture, SemanticGridNet, load_net
from semgrid_edu.occupancy import Belief, CmcdotParams, track_drive

STAGES = {
    "track": ("frames", "spec"),
    "segment": ("image",),
    "sample": ("s",),
    "fuse": ("p", "o"),
    "refine": ("log_g", "o"),
}
"""The names of the paper's stages, in their order, and of the arguments that each of them takes."""

REMEMBER = {"remember": ("views", "spec")}
"""The stage that the paper leaves out: without it, classes are forgotten at every frame."""


@dataclass(frozen=True, eq=False)
class Stages:
    """The stages as functions on numpy arrays, one frame at a time.

    The package's own stages replace those of the paper's five that are left out. C is the number of classes, D the
    number of planes.

    Parameters
    ----------
    track : callable, optional
        l -> o: `track(frames, spec)` yields a `Belief`, or an array (4, H, W) float, for each frame: the probabilities
        of FREE, STATIC, DYNAMIC and UNKNOWN, which sum to 1 in each cell. It is a generator function, so it can
        remember what it saw: it takes a frame, yields its belief, and only then takes the next one, as `track_drive`
        does.
    segment : callable, optional
        i -> s: `segment(image (3, h, w))` returns scores (C, h, w) float without soft-max; the image is RGB, 0..1.
    sample : callable, optional
        s -> p: `sample(s (C, h, w))` returns the scores on the planes, (C, D, H, W) float.
    fuse : callable, optional
        (p, o) -> g: `fuse(p (C, D, H, W), o (4, H, W))` returns log g (C, H, W) float, natural logarithms of
        probabilities: exp(log g) sums to 1 in each cell.
    refine : callable, optional
        g -> g: `refine(log_g (C, H, W), o (4, H, W))` returns g (C, H, W) float, probabilities that sum to 1 in each
        cell.
    architecture : Architecture, optional
        The grid, the image size, the planes and the classes that all stages work with; those of the package's own
        stages when left out.
    remember : callable, optional
        g -> g over frames: `remember(views, spec)` yields an array (C, H, W) float for each `View` (frame, belief and
        g of that frame alone): probabilities that sum to 1 in each cell. A generator function, as `track` is. Without
        it nothing is remembered.

    Raises
    ------
    ArgumentError
        When a stage isn't a function of the right number of arguments.

    Examples
    --------
    >>> def forget(log_g, o):
    ...     return np.full_like(log_g, 1 / len(log_g))
    >>> Stages(refine=forget).given
    ('refine',)
    """

    track: Callable[[Iterable[Frame], GridSpec], Iterator[Belief | NDArray]] | None = None
    segment: Callable[[NDArray], NDArray] | None = None
    sample: Callable[[NDArray], NDArray] | None = None
    fuse: Callable[[NDArray, NDArray], NDArray] | None = None
    refine: Callable[[NDArray, NDArray], NDArray] | None = None
    architecture: Architecture | None = None
    remember: Callable[[Iterable[View], GridSpec], Iterator[NDArray]] | None = None

    def __post_init__(self) -> None:
        """Refuse what isn't a function of the stage's arguments."""
        for name in self.given:
            _check_function(name, getattr(self, name))

    @property
    def given(self) -> tuple[str, ...]:
        """The names of the stages that weren't left out, in their order."""
        return tuple(name for name in STAGES | REMEMBER if getattr(self, name) is not None)

    @classmethod
    def of(
        cls,
        net: SemanticGridNet,
        occupancy: CmcdotParams | None = None,
        crf: CrfParams | None = None,
        seed: int = 0,
        keep_steps: bool = False,
        memory: bool | MemoryParams = False,
    ) -> "Stages":
        """Return the package's own five stages.

        Parameters
        ----------
        net : SemanticGridNet
            A network from `build_net` or `load_net`, for the camera of the drive and in evaluation mode.
        occupancy : CmcdotParams, optional
            Parameters of the filter.
        crf : CrfParams, optional
            Parameters of the refinement; `CrfParams.for_cells` when left out.
        seed : int
            Seed for the particles of the filter.
        keep_steps : bool
            Whether each belief also tells how the filter came to it, as `cell_story` asks for (`Belief.steps`).
        memory : bool or MemoryParams
            Whether classes are remembered over frames, or the parameters with which they are.

        Returns
        -------
        Stages
            Five functions, six with memory, and the network's architecture.

        Raises
        ------
        ArgumentError
            When the network was put together by hand, so that its grid isn't known.

        Examples
        --------
        >>> own = Stages.of(load_net(sample_weights(), drive.camera))                   # doctest: +SKIP
        >>> dataclasses.replace(own, refine=my_refine)                                  # doctest: +SKIP
        """
        architecture = net.need_architecture()
        refine = _mean_field(crf, architecture.grid.cell)
        remember = _memory(memory, architecture.label_set)
        return cls(_filter(occupancy, seed, keep_steps), *_functions_of(net), refine, architecture, remember)

    def over(self, other: "Stages") -> "Stages":
        """Return these stages, and those of `other` where one was left out.

        Parameters
        ----------
        other : Stages
            The stages that fill the gaps, such as `Stages.of(net)`.

        Returns
        -------
        Stages
            The mixed set.

        Raises
        ------
        ArgumentError
            When both have an architecture and their layouts differ, so that they can't be mixed.
        """
        if self.architecture and self.architecture.layout != other.architecture.layout:
            raise ArgumentError("architecture", f"that of the other stages, {other.architecture}", self.architecture)
        return replace(other, **{name: getattr(self, name) for name in self.given})

    def completed(
        self,
        camera: Camera,
        occupancy: CmcdotParams | None = None,
        crf: CrfParams | None = None,
        seed: int = 0,
        memory: bool | MemoryParams = False,
    ) -> "Stages":
        """Return these stages, and the package's own where one was left out.

        The filter and the CRF need no network. Where `segment`, `sample` or `fuse` is left out, the shipped SegNet,
        fitted to the camera, provides it.

        Parameters
        ----------
        camera : Camera
            The camera as it took the images of the drive.
        occupancy, crf, seed, memory
            Parameters of the package's own filter and refinement, seed of the filter, and memory, as in `of`.

        Returns
        -------
        Stages
            Five functions, six with memory, and their architecture.

        Raises
        ------
        ArgumentError
            When the shipped network is needed and has another architecture.
        DataError
            When it is needed and there are no shipped samples.
        """
        if {"segment", "sample", "fuse"} <= set(self.given):
            architecture = self.architecture or Architecture()
            refine = _mean_field(crf, architecture.grid.cell)
            remember = _memory(memory, architecture.label_set)
            own = Stages(_filter(occupancy, seed), refine=refine, architecture=architecture, remember=remember)
        else:
            own = self.of(load_net(sample_weights(), camera), occupancy, crf, seed, memory=memory)
        return self.over(own)


def _check_function(name: str, function: object) -> None:
    takes = (STAGES | REMEMBER)[name]
    usage = f"a function {name}({', '.join(takes)})"
    if not callable(function):
        raise ArgumentError(name, usage, f"a {type(function).__name__}")
    if isinstance(function, type):
        raise ArgumentError(name, usage, f"the class {function.__name__} itself: write {name} = {function.__name__}()")
    try:
        signature = inspect.signature(function)
    except ValueError:  # some functions written in C don't say what they take
        return
    try:
        signature.bind(*takes)
    except TypeError as error:
        raise ArgumentError(name, usage, f"{name}{signature}") from error


def _filter(params: CmcdotParams | None, seed: int, keep_steps: bool = False) -> Callable:
    def track(frames: Iterable[Frame], spec: GridSpec) -> Iterator[Belief]:
        return track_drive(frames, spec, params, seed, keep_steps)

    return track


def _memory(memory: bool | MemoryParams, label_set: str) -> Callable | None:
    """Return the stage `remember`, or None without memory."""
    if memory is False:
        return None
    if not isinstance(memory, bool | MemoryParams):
        raise ArgumentError("memory", "True, False or MemoryParams", type(memory).__name__)
    if label_set != KITTI_14.name:
        raise ArgumentError("memory", f"False with {label_set}, which has no class for what was never seen", memory)
    params = None if memory is True else memory

    def remember(views: Iterable[View], spec: GridSpec) -> Iterator[NDArray[np.float32]]:
        return remember_drive(views, spec, params)

    return remember


def _functions_of(net: SemanticGridNet) -> tuple[Callable, Callable, Callable]:
    """Return the three stages of a network as functions on arrays."""

    @torch.inference_mode()
    def segment(image: NDArray) -> NDArray:
        return net.segmenter(_tensor(image)[None])[0].numpy()

    @torch.inference_mode()
    def sample(s: NDArray) -> NDArray:
        return net.sampler(_tensor(s)[None])[0].numpy()

    @torch.inference_mode()
    def fuse(p: NDArray, o: NDArray) -> NDArray:
        planes = _tensor(p)
        # PyTorch knows channels-last planes by the stride of the batch axis too, and would copy them without it.
        planes = planes.as_strided((1, *planes.shape), (planes.numel(), *planes.stride()))
        return net.fusion(planes, _tensor(o)[None])[0].log_softmax(dim=0).numpy()

    return segment, sample, fuse


def _tensor(array: NDArray) -> Tensor:
    """Return a tensor that shares the memory of a float32 array and has its layout."""
    return torch.from_numpy(np.asarray(array, dtype=np.float32))


def _mean_field(params: CrfParams | None, cell: float) -> Callable:
    params = params or CrfParams.for_cells(cell)

    def refine(log_g: NDArray, o: NDArray) -> NDArray:
        return mean_field(unary_from_log_probability(log_g), o, params)

    return refine
