"""Keep a stage that remembers, a student's or our own, in step with the others: one frame in, one result out."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.memory import View
from semgrid_edu.occupancy import N_STATES, Belief
from semgrid_edu.pipeline.checks import StageCheck

TAKES_TURNS = "a generator that takes a frame, yields its {}, and only then takes the next"
"""What such a stage has to be, for messages; the gap takes what it yields."""

_END = object()
"""What `_next` returns when the stage has ended; a stage could yield None."""


class GeneratorAdapter:
    """Run a generator in step with the other stages: hand it one frame at a time, and take one result for each.

    The generator reads the frames itself. The methods raise `StageError`.

    Parameters
    ----------
    stage : str
        Name of the stage: "track" or "remember".
    function : callable
        `function(frames, spec)`, as `Stages` describes it.
    spec : GridSpec
        The grid of the results.
    yields : str
        What it yields for each frame, for messages: "belief" or "grid".
    """

    def __init__(self, stage: str, function: Callable, spec: GridSpec, yields: str) -> None:
        self._function, self._spec, self._yields = function, spec, yields
        self._results: Iterator | None = None
        self._waiting: object = None
        self._over = False
        self._check = StageCheck(stage, function, 0)

    def finish(self) -> None:
        """Tell the generator that there are no more frames; another result of it is refused."""
        self._over = True
        if self._results is not None and self._next() is not _END:
            raise self._check.error(f"one {self._yields} for each frame", "another one after the last frame")

    def take(self, handed: object, number: int) -> tuple[object, float]:
        """Let the generator take a frame, and return what it yields then and how long that took, seconds.

        Parameters
        ----------
        handed : object
            What the generator reads for this frame.
        number : int
            Number of the frame, for error messages.
        """
        check = self._check = replace(self._check, frame=number)
        self._waiting = handed
        start = time.perf_counter()
        yielded = self._next()
        seconds = time.perf_counter() - start
        if yielded is _END:
            expected = f"a {self._yields} for each frame"
            raise check.error(expected, "the end: does it stop, or return, before the last frame?")
        if self._waiting is not None:
            raise check.error(self._turns, f"a {self._yields} before it took the frame: does it yield twice?")
        return yielded, seconds

    @property
    def _turns(self) -> str:
        return TAKES_TURNS.format(self._yields)

    def _next(self) -> object:
        """Return what the generator yields next; `_END` when it has ended."""
        with self._check.blamed():
            if self._results is None:
                self._results = self._function(self._frames(), self._spec)
            if not isinstance(self._results, Iterator):
                raise self._check.error(self._turns, f"{type(self._results).__name__}: is the `yield` missing?")
            return next(self._results, _END)

    def _frames(self) -> Iterator:
        """Yield the frame that waits for the generator, until there are no more."""
        while not self._over:
            if self._waiting is None:
                cause = "is the `yield` missing?" if self._results is None else "does it make a list of them?"
                found = f"one that takes another frame before it yields this one's {self._yields}: {cause}"
                raise self._check.error(self._turns, found)
            frame, self._waiting = self._waiting, None
            yield frame


class TrackerAdapter(GeneratorAdapter):
    """Run a tracker in step with the other stages.

    Parameters
    ----------
    track : callable
        `track(frames, spec)`, l -> o, as `Stages` describes it.
    spec : GridSpec
        The grid of the beliefs.
    """

    def __init__(self, track: Callable, spec: GridSpec) -> None:
        super().__init__("track", track, spec, "belief")

    def belief(self, frame: Frame, number: int) -> tuple[Belief, float]:
        """Let the tracker take a frame, and return what it believes then.

        Parameters
        ----------
        frame : Frame
            The next frame of the drive.
        number : int
            Number of the frame, for error messages.

        Returns
        -------
        belief : Belief
            What the tracker yields, after it has been checked. The velocities are NaN when the tracker yields only
            probabilities.
        seconds : float
            How long the tracker took.
        """
        yielded, seconds = self.take(frame if self._check.own else replace(frame, points=frame.points.copy()), number)
        return self._checked(yielded), seconds

    def _checked(self, yielded: object) -> Belief:
        """Return a belief that the next stage can use."""
        grid = self._spec.shape
        belief = yielded if isinstance(yielded, Belief) else _without_velocity(yielded, grid)
        shapes = {"probability": (N_STATES, *grid), "velocity": (2, *grid), "velocity_covariance": (2, 2, *grid)}
        arrays = {name: self._check.array(getattr(belief, name), shape) for name, shape in shapes.items()}
        self._check.probabilities(arrays["probability"], "states")
        return replace(belief, **arrays)


def _without_velocity(probability: object, grid: tuple[int, int]) -> Belief:
    unknown = np.full((2, 2, *grid), np.nan, np.float32)
    return Belief(probability, unknown[0], unknown)


class MemoryAdapter(GeneratorAdapter):
    """Run a memory of classes in step with the other stages.

    Parameters
    ----------
    remember : callable
        `remember(views, spec)`, g -> g over frames, as `Stages` describes it.
    spec : GridSpec
        The grid of the results.
    """

    def __init__(self, remember: Callable, spec: GridSpec) -> None:
        super().__init__("remember", remember, spec, "grid")

    def grid(self, view: View, number: int) -> tuple[NDArray[np.float32], float]:
        """Let the memory take a frame, and return its semantic grid with memory, (C, H, W), and the seconds it took.

        Parameters
        ----------
        view : View
            What the earlier stages made of the next frame.
        number : int
            Number of the frame, for error messages.
        """
        handed = view if self._check.own else view._replace(grid=view.grid.copy())
        yielded, seconds = self.take(handed, number)
        remembered = self._check.array(yielded, view.grid.shape)
        self._check.probabilities(remembered)
        return remembered, seconds
