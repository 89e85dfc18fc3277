"""Checks around each stage, and around the two that are stepped frame by frame, `track` and `remember`."""

import copy
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks import Architecture
from semgrid_edu.occupancy import N_STATES, Belief
from semgrid_edu.stages.checks import (
    CheckedStage,
    anything,
    class_probabilities,
    distribution,
    finite,
    is_ours,
    log_distribution,
)


def checked(name: str, stage: Any, architecture: Architecture) -> CheckedStage:
    """Return a stage whose results are checked: it is called, or stepped, as before.

    Parameters
    ----------
    name : str
        Name of the stage, a key of `STAGES` or `REMEMBER`.
    stage : callable or Tracker
        The stage.
    architecture : Architecture
        What all stages work with: it decides the shape of the result.
    """
    spec = architecture.grid
    n_classes = len(LABEL_SETS[architecture.label_set])
    if name == "track":
        return CheckedTracker(name, stage, (N_STATES, *spec.shape), spec)
    if name == "remember":
        return CheckedMemory(name, stage, (n_classes, *spec.shape), spec)
    if name == "segment":
        return CheckedStage(name, stage, (n_classes, *architecture.image_size), finite)
    if name == "sample":
        shape = (n_classes, len(architecture.heights), *spec.shape)
        if architecture.uses_return_heights:
            return CheckedStage(name, stage, shape, class_probabilities)
        # Planes hold millions of numbers: ours aren't searched, because finite scores give finite planes.
        return CheckedStage(name, stage, shape, anything if is_ours(stage) else finite)
    check = log_distribution if name == "fuse" else distribution
    return CheckedStage(name, stage, (n_classes, *spec.shape), check)


class CheckedTracker(CheckedStage):
    """The stage `track`, stepped frame by frame and checked.

    Parameters
    ----------
    name, stage, shape
        Those of `CheckedStage`.
    spec : GridSpec
        The grid of the beliefs.
    """

    yields = "belief"

    def __init__(self, name: str, stage: Any, shape: tuple[int, ...], spec: object) -> None:
        super().__init__(name, stage, shape, distribution)
        self.stepped = stage if hasattr(stage, "step") else SteppedGenerator(self, stage, spec)

    def step(self, frame: Any) -> Any:
        """Return what is believed after this frame.

        Parameters
        ----------
        frame : Frame
            The next frame of the drive.

        Returns
        -------
        Belief
            With velocities that are NaN when the stage returns only probabilities.
        """
        self.frame += 1
        handed = frame if self.is_ours else copy.deepcopy(frame)
        with self.blamed():
            value = self.stepped.step(handed)
        return self.result(value)

    def result(self, value: object) -> Any:
        """Return a belief that the next stage can use.

        Parameters
        ----------
        value : object
            What the stage returned.
        """
        grid = self.shape[1:]
        if not isinstance(value, Belief):
            unknown = np.full((2, 2, *grid), np.nan, np.float32)
            value = Belief(value, unknown[0], unknown)
        shapes = {"probability": self.shape, "velocity": (2, *grid), "velocity_covariance": (2, 2, *grid)}
        arrays = {name: self.array(getattr(value, name), shape) for name, shape in shapes.items()}
        self.check(self, arrays["probability"], "states")
        return replace(value, **arrays)


class CheckedMemory(CheckedTracker):
    """The stage `remember`, stepped frame by frame and checked. Parameters are those of `CheckedTracker`."""

    yields = "grid"

    def result(self, value: object) -> NDArray[np.float32]:
        """Return a grid of class probabilities. Parameters are those of `CheckedTracker.result`."""
        remembered = self.array(value, self.shape)
        self.check(self, remembered)
        return remembered


class SteppedGenerator:
    """Step a generator function: hand it one frame, and take the one result that it yields for it.

    Parameters
    ----------
    check : CheckedTracker
        Makes the errors.
    function : callable
        `function(frames, spec)`, which yields a result for each frame before it takes the next.
    spec : GridSpec
        The grid of the results.
    """

    def __init__(self, check: CheckedTracker, function: Callable[[Iterable, Any], Iterator], spec: object) -> None:
        self._check = check
        self._start = partial(function, self._frames(), spec)
        self._results: Iterator | None = None
        self._waiting: list = []
        self._turns = f"a generator that takes a frame, yields its {check.yields}, and only then takes the next"

    def step(self, frame: object) -> object:
        """Let the generator take a frame, and return what it yields.

        Parameters
        ----------
        frame : Frame
            The next frame of the drive.
        """
        self._waiting.append(frame)
        if self._results is None:
            self._results = self._start()
        if not isinstance(self._results, Iterator):
            found = f"{type(self._results).__name__}: is the `yield` missing?"
            raise self._check.error(self._turns, found)
        try:
            value = next(self._results)
        except StopIteration:
            expected = f"a {self._check.yields} for each frame"
            found = "the end: does it stop, or return, before the last frame?"
            raise self._check.error(expected, found) from None
        if self._waiting:
            found = f"a {self._check.yields} before it took the frame: does it yield twice?"
            raise self._check.error(self._turns, found)
        return value

    def _frames(self) -> Iterator:
        """Yield the one frame that waits."""
        while True:
            if not self._waiting:
                cause = "is the `yield` missing?" if self._results is None else "does it make a list of them?"
                found = f"one that takes another frame before it yields this one's {self._check.yields}: {cause}"
                raise self._check.error(self._turns, found)
            yield self._waiting.pop()
