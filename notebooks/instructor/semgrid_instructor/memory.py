"""Hidden tests of exercise 14, memory for classes: other frames, other cells, and the simulated drive, which moves."""

import copy
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.samples import sample_drive, sample_weights
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE
from semgrid_edu.networks import load_net
from semgrid_edu.occupancy import State
from semgrid_edu.pipeline import run_pipeline
from semgrid_edu.workshop.course.answers import answer_array
from semgrid_edu.workshop.course.street import frames_since_seen
from semgrid_instructor import close, generator, hidden, keeping

DRIVEN = slice(5, 15)
"""The frames of the sample drive that the last task is scored on."""

LEAST_GAIN = 30
"""Per cent that have to be gained there in cells seen before; a map that isn't moved gains some 20."""


@hidden
@keeping
def check_combine(combine: Callable) -> None:
    """Other numbers of frames and classes, exponents from 0 to 1, probabilities of 0, and many frames."""
    for seed, (frames, classes) in enumerate(((1, 3), (4, 10), (7, 2), (4000, 5))):
        rng = generator(1400 + seed)
        p, w = rng.dirichlet(np.full(classes, 0.4), frames), rng.uniform(0, 1, frames)
        p[0] = np.eye(classes)[0]
        w[-1] = 0.0 if frames > 1 else 0.7
        score = w @ np.log(np.maximum(p, 1e-4))
        wanted = np.exp(score - score.max())
        got = answer_array(combine(p, w))
        assert np.isfinite(got).all(), "not a number, for many frames: add logarithms"
        assert close(got, wanted / wanted.sum(), atol=1e-4), "another belief, for other numbers of frames and classes"


@hidden
@keeping
def check_errors_last(errors_last: Callable) -> None:
    """Errors that last long and short, with few and many places, and some that alternate."""
    for seed, (places, frames, stay) in enumerate(((30, 5, 0.9), (200, 12, 0.5), (50, 2, 0.8), (80, 9, 0.1))):
        rng = generator(1410 + seed)
        wrong = rng.random((places, frames)) < 0.3
        for t in range(1, frames):
            wrong[:, t] = np.where(rng.random(places) < stay, wrong[:, t - 1], wrong[:, t])
        wrong = wrong.astype(int)
        x, y = wrong[:, :-1].ravel() - wrong[:, :-1].mean(), wrong[:, 1:].ravel() - wrong[:, 1:].mean()
        r = (x * y).mean() / np.sqrt((x**2).mean() * (y**2).mean())
        got = answer_array(errors_last(wrong))
        assert got.shape == (2,), "not two numbers"
        assert close(got[:1], [r], atol=1e-3), "another r, for other numbers of places and frames"
        assert close(got[1:], [1 + (frames - 1) * (1 - r) / (1 + r)], rtol=1e-3, atol=1e-3), (
            "r is right, its worth isn't"
        )


@hidden
@keeping
def check_listen(listen: Callable) -> None:
    """Other classes and cells; some are surely free, in some nothing is left."""
    for seed, standing in enumerate(([2], [0, 3, 4], [1, 2, 3, 4])):
        rng = generator(1430 + seed)
        p = np.moveaxis(rng.dirichlet(np.full(5, 0.6), (4, 7)), -1, 0)
        o = np.moveaxis(rng.dirichlet(np.full(4, 0.6), (4, 7)), -1, 0)
        p[:, 0, 0], o[:, 0, 0] = np.eye(5)[standing[-1]], np.eye(4)[State.FREE]
        o[:, 1, :3] = np.eye(4)[State.FREE][:, None]
        heard = p.copy()
        heard[standing] *= 1 - o[State.FREE]
        total = heard.sum(axis=0)
        wanted = np.where(total > 0, heard / np.where(total > 0, total, 1), 0.2)
        assert close(answer_array(listen(p, o, standing)), wanted, atol=1e-4), (
            "another map, with other classes that stand"
        )


@cache
def _driven() -> tuple[list[Frame], list[NDArray], GridSpec]:
    """Return bare frames, what is given and what is true of a stretch of the sample drive, and the grid."""
    drive = sample_drive()
    net = load_net(sample_weights(), drive.camera)
    spec, results = net.architecture.grid, list(run_pipeline(drive[DRIVEN], net))
    frames = [one.frame for one in results]
    arrays = [np.stack([one.belief.probability for one in results]), np.stack([one.grid for one in results])]
    arrays += [np.stack([frame.labels.birdseye_on(spec) for frame in frames]), frames_since_seen(frames, spec)]
    return [replace(frame, image=None, labels=None, points=frame.points[:0]) for frame in frames], arrays, spec


@hidden
def check_remember(maps: Callable) -> None:
    """Ten frames of the simulated drive, against one frame: nothing lost in view, much gained in cells seen before."""
    frames, (occupancy, grids, truth, since), spec = copy.deepcopy(_driven())  # an answer may change what it gets
    got = answer_array(maps(frames, occupancy, grids, spec))
    assert got.shape == truth.shape, "maps of another shape, or for another number of frames"
    one = grids.argmax(axis=1)
    for name, cells, least in (("in view", since == 0, -0.5), ("seen before", since > 0, LEAST_GAIN)):
        counted = cells & (truth != IGNORE)
        gain = 100 * ((got == truth)[counted].mean() - (one == truth)[counted].mean())
        assert gain > least, name + ": too few points against one frame, on a drive that moves"
