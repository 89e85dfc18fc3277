"""Keep a tracker, a student's or the package's own, in step with the other stages: one frame in, one belief out."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import N_STATES, Belief
from semgrid_edu.pipeline.checks import StageCheck

TAKES_TURNS = "a generator that takes a frame, yields its belief, and only then takes the next"
"""What a tracker has to be, for messages."""

_END = object()
"""What `_next` returns when the tracker has ended; a tracker could yield None."""


class TrackerAdapter:
    """Run a tracker in step with the other stages: hand it one frame at a time, and take one belief for each.

    A tracker is a generator that reads the frames itself. Its methods raise `StageError`.

    Parameters
    ----------
    track : callable
        `track(frames, spec)`, l -> o, as `Stages` describes it.
    spec : GridSpec
        The grid of the beliefs.
    """

    def __init__(self, track: Callable, spec: GridSpec) -> None:
        self._track, self._spec = track, spec
        self._beliefs: Iterator | None = None
        self._waiting: Frame | None = None
        self._over = False
        self._check = StageCheck("track", track, 0)

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
        check = self._check = replace(self._check, frame=number)
        self._waiting = frame if check.own else replace(frame, points=frame.points.copy())
        start = time.perf_counter()
        yielded = self._next()
        seconds = time.perf_counter() - start
        if yielded is _END:
            raise check.error("a belief for each frame", "the end: does it stop, or return, before the last frame?")
        if self._waiting is not None:
            raise check.error(TAKES_TURNS, "a belief before it took the frame: does it yield twice?")
        return self._checked(yielded), seconds

    def finish(self) -> None:
        """Tell the tracker that there are no more frames; another belief of it is refused."""
        self._over = True
        if self._beliefs is not None and self._next() is not _END:
            raise self._check.error("one belief for each frame", "another one after the last frame")

    def _next(self) -> object:
        """Return what the tracker yields next; `_END` when it has ended."""
        with self._check.blamed():
            if self._beliefs is None:
                self._beliefs = self._track(self._frames(), self._spec)
            if not isinstance(self._beliefs, Iterator):
                raise self._check.error(TAKES_TURNS, f"{type(self._beliefs).__name__}: is the `yield` missing?")
            return next(self._beliefs, _END)

    def _frames(self) -> Iterator[Frame]:
        """Yield the frame that waits for the tracker, until there are no more."""
        while not self._over:
            if self._waiting is None:
                cause = "is the `yield` missing?" if self._beliefs is None else "does it make a list of them?"
                raise self._check.error(
                    TAKES_TURNS, f"one that takes another frame before it yields this one's belief: {cause}"
                )
            frame, self._waiting = self._waiting, None
            yield frame

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
