"""The five stages of the system as functions that can be exchanged, and a sixth that the paper leaves out (Fig. 2).

`Stages.of` assembles the book's parts, `Stages.fast` their compiled twins.
"""

import copy
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_edu.crf import CrfParams, mean_field
from semgrid_edu.errors import ArgumentError, MissingExtraError
from semgrid_edu.frame import Frame
from semgrid_edu.labels import KITTI_14
from semgrid_edu.memory import ClassMemory, MemoryParams
from semgrid_edu.networks import Architecture, SemanticGridNet
from semgrid_edu.occupancy import CmcdotParams, DriveTracker
from semgrid_edu.planes import cell_heights
from semgrid_edu.stages.hints import REMEMBER, STAGES, check_usage
from semgrid_edu.stages.stepping import checked


class Tracker(Protocol):
    """A stage with a memory: it is handed one frame after the other."""

    def step(self, frame: Any) -> Any:
        """Return the result for this frame, given all frames so far.

        Parameters
        ----------
        frame : Frame
            The next frame of the drive; a `View` for the stage `remember`.
        """


@dataclass(frozen=True, eq=False)
class Stages:
    """The stages as functions on numpy arrays, one frame at a time. Any of them may be your own.

    C is the number of classes, D the number of planes.

    Parameters
    ----------
    track : Tracker or callable, optional
        l -> o: an object whose `step(frame)` returns a `Belief`, or an array (4, H, W) float: the probabilities of
        FREE, STATIC, DYNAMIC and UNKNOWN, which sum to 1 in each cell. Or a generator function `track(frames, spec)`
        that takes a frame, yields its belief, and only then takes the next frame.
    segment : callable, optional
        i -> s: `segment(image (3, h, w))` returns scores (C, h, w) float without soft-max; the image is RGB, 0..1.
    sample : callable, optional
        s -> p: `sample(s (C, h, w))` returns the scores on the planes, (C, D, H, W) float. Of a network with
        `uses_return_heights` it returns class probabilities: the soft-max of s, sampled.
    fuse : callable, optional
        (p, o) -> g: `fuse(p (C, D, H, W), o (4, H, W))` returns log g (C, H, W) float, natural logarithms of
        probabilities: exp(log g) sums to 1 in each cell. In a set with `return_heights` it gets them as a third
        argument.
    refine : callable, optional
        g -> g: `refine(log_g (C, H, W), o (4, H, W))` returns g (C, H, W) float, probabilities that sum to 1 in each
        cell.
    architecture : Architecture, optional
        The grid, the image size, the planes and the classes that all stages work with; those of the shipped network
        when left out.
    remember : Tracker or callable, optional
        g -> g over frames: an object whose `step(view)` returns (C, H, W) float, probabilities that sum to 1 in each
        cell, for a `View` (frame, belief and g of that frame alone). Or a generator function `remember(views, spec)`.
        Without it nothing is remembered.
    return_heights : callable, optional
        `return_heights(frame)` returns what `fuse` is to know of the scan beside o: the lowest and the highest return
        of each cell, (2, H, W) metres, NaN without a return (`cell_heights`). The paper's network has no such input.

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

    track: Tracker | Callable | None = None
    segment: Callable[[NDArray], NDArray] | None = None
    sample: Callable[[NDArray], NDArray] | None = None
    fuse: Callable[..., NDArray] | None = None
    refine: Callable[[NDArray, NDArray], NDArray] | None = None
    architecture: Architecture | None = None
    remember: Tracker | Callable | None = None
    return_heights: Callable[[Frame], NDArray] | None = None

    def __post_init__(self) -> None:
        """Reject what can't be called as its stage is."""
        takes = STAGES | REMEMBER
        if self.return_heights is not None:
            takes["fuse"] += ("return_heights",)
        for name in self.given:
            check_usage(name, getattr(self, name), takes[name])

    @property
    def given(self) -> tuple[str, ...]:
        """The names of the stages that weren't left out, in their order."""
        return tuple(name for name in STAGES | REMEMBER if getattr(self, name) is not None)

    @property
    def image_size(self) -> tuple[int, int]:
        """Height and width of the image that `segment` takes, pixels."""
        return (self.architecture or Architecture()).image_size

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
        """Return the package's own stages, in the book's readable version.

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
            Whether each belief also holds what the filter had after each of its steps (`Belief.steps`).
        memory : bool or MemoryParams
            Whether class beliefs are carried over frames, or the parameters with which they are.

        Raises
        ------
        ArgumentError
            When the network was put together by hand, so that its grid isn't known, or its classes can't be remembered.

        Examples
        --------
        >>> own = Stages.of(load_net(sample_weights(), drive.camera))                   # doctest: +SKIP
        >>> dataclasses.replace(own, refine=my_refine)                                  # doctest: +SKIP
        """
        spec = net.need_architecture().grid
        crf = crf or CrfParams.for_cells(spec.cell)

        def refine(log_g: NDArray, o: NDArray) -> NDArray:
            return mean_field(-log_g, o, crf)

        track = DriveTracker(spec, occupancy, seed, keep_steps)
        return replace(network_stages(net, memory), track=track, refine=refine)

    @classmethod
    def fast(cls, net: SemanticGridNet, occupancy: CmcdotParams | None = None, **options: Any) -> "Stages":
        """Return the same stages by the compiled twins of `semgrid_edu.fast`; the book's where numba is missing.

        Parameters
        ----------
        net : SemanticGridNet
            A network for the camera of the drive and in evaluation mode.
        occupancy, **options
            Those of `Stages.of`.
        """
        from semgrid_edu import fast  # the book's only import of `fast`

        try:
            return fast.fast_stages(net, occupancy, **options)
        except MissingExtraError:
            hint = "numba is missing, so the slower readable stages run: pip install semgrid_edu[fast]"
            warnings.warn(hint, stacklevel=2)
            return cls.of(net, occupancy, **options)

    def over(self, other: "Stages") -> "Stages":
        """Return these stages, and those of `other` where one was left out; `return_heights` comes with `fuse`.

        Parameters
        ----------
        other : Stages
            The stages that fill the gaps, such as `Stages.of(net)`.

        Raises
        ------
        ArgumentError
            When both have an architecture and the two differ in what stages hand to each other.
        """
        theirs = other.architecture or Architecture()
        if self.architecture and self.architecture.layout != theirs.layout:
            raise ArgumentError("architecture", f"that of the other stages, {theirs}", self.architecture)
        filled = {name: getattr(self, name) for name in self.given}
        if self.fuse is not None:
            filled["return_heights"] = self.return_heights
        return replace(other, **filled)

    def need_ready(self) -> None:
        """Raise an `ArgumentError` unless `run_frame` can run these stages: all five, and no generator among them."""
        self._need_all()
        for name in ("track", "remember"):
            if name in self.given and not hasattr(getattr(self, name), "step"):
                found = type(getattr(self, name)).__name__
                raise ArgumentError(name, "an object with step(frame), see `Stages.started`", found)

    def _need_all(self) -> None:
        """Raise an `ArgumentError` if one of the paper's five stages was left out."""
        if missing := set(STAGES) - set(self.given):
            raise ArgumentError("stages", f"all of {', '.join(STAGES)}", f"no {', '.join(sorted(missing))}")

    def started(self) -> "Stages":
        """Return the stages for one drive: tracker and memory are copies, and all results are checked.

        The copies know what the originals know: start each drive from a set that has seen no frame.
        """
        self._need_all()
        architecture = self.architecture or Architecture()
        own = replace(self, track=copy.deepcopy(self.track), remember=copy.deepcopy(self.remember))
        parts = {name: checked(name, getattr(own, name), architecture) for name in own.given}
        return replace(self, architecture=architecture, **parts)


def network_stages(net: SemanticGridNet, memory: bool | MemoryParams) -> Stages:
    """Return what `Stages.of` and `Stages.fast` share: the network's stages, and the memory; not `track` and `refine`.

    Parameters
    ----------
    net, memory
        Those of `Stages.of`.
    """
    architecture = net.need_architecture()

    def fuse(p: Tensor, o: Tensor, return_heights: Tensor | None = None) -> Tensor:
        return net.fuse(p, o, return_heights).log_softmax(dim=1)

    def return_heights(frame: Frame) -> NDArray[np.float64]:
        return cell_heights(frame.points_grid, architecture.grid)

    return Stages(
        segment=_on_arrays(net.segment),
        sample=_on_arrays(net.sample),
        fuse=_on_arrays(fuse),
        architecture=architecture,
        remember=class_memory(memory, architecture),
        return_heights=return_heights if architecture.uses_return_heights else None,
    )


def _on_arrays(function: Callable) -> Callable:
    """Return a function of batches as one of numpy arrays, for one frame at a time, without gradients."""

    @torch.inference_mode()
    def stage(*arrays: NDArray) -> NDArray:
        batches = [torch.from_numpy(np.asarray(array, dtype=np.float32))[None] for array in arrays]
        return function(*batches)[0].numpy()

    return stage


def class_memory(memory: bool | MemoryParams, architecture: Architecture) -> ClassMemory | None:
    """Return the package's stage `remember`, or None without memory.

    Parameters
    ----------
    memory : bool or MemoryParams
        Whether classes are remembered, or the parameters with which they are.
    architecture : Architecture
        The grid and the classes.

    Raises
    ------
    ArgumentError
        When `memory` is neither, or the label set has no unknown classes.
    """
    if memory is False:
        return None
    if not isinstance(memory, bool | MemoryParams):
        raise ArgumentError("memory", "True, False or MemoryParams", type(memory).__name__)
    if architecture.label_set != KITTI_14.name:
        found = f"{memory} with {architecture.label_set}"
        raise ArgumentError("memory", f"the classes of {KITTI_14.name}, which have unknown ones", found)
    return ClassMemory(architecture.grid, None if memory is True else memory)
