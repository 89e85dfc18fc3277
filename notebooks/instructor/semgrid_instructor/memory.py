"""Hidden tests of exercise 14, memory for classes: other frames, other cells, and the simulated drive, which moves."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import PlanarMotion, State
from semgrid_edu.workshop.course.answers import answer_array
from semgrid_edu.workshop.course.street import frames_since_seen
from semgrid_instructor import close, generator, hidden, keeping

DRIVEN, PATCH = slice(5, 15), 1.5
"""The frames of the sample drive that give the last task its poses, and the size of what is there, metres."""

LEAST_GAIN = 30
"""Per cent that have to be gained there in cells seen before; a map that isn't moved gains fewer than 20."""


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
        p[:, 0, 1], o[:, 0, 1] = np.isin(np.arange(5), standing) / len(standing), [0.999, 0, 0, 0.001]  # little is left
        heard = p.copy()
        heard[standing] *= 1 - o[State.FREE]
        total = heard.sum(axis=0)
        wanted = np.where(total > 0, heard / np.where(total > 0, total, 1), 0.2)
        assert close(answer_array(listen(p, o, standing)), wanted, atol=1e-4), (
            "another map, with other classes that stand"
        )


@cache
def _poses(spec: GridSpec) -> tuple[list[Frame], NDArray, NDArray]:
    """Return bare frames of a drive, how many frames ago each cell was seen, and the patch of the world it lies in."""
    frames, places = sample_drive()[DRIVEN], []
    for frame in frames:
        motion = PlanarMotion.from_poses(frames[0].T_world_from_lidar, frame.T_world_from_lidar)
        places.append((motion.parent_from_child(spec.centers().reshape(-1, 2)) // PATCH).astype(int).T + 30)
    bare = [replace(frame, image=None, labels=None, points=frame.points[:0]) for frame in frames]
    return bare, frames_since_seen(frames, spec), np.array(places)


def _driven() -> tuple[list[Frame], list[NDArray], GridSpec]:
    """Return bare frames of a drive through a world that nobody knows, what is given and what is true, and the grid."""
    rng, spec = generator(1440), GridSpec.compact()
    frames, since, places = _poses(spec)
    truth = rng.integers(0, 10, (150, 150))[places[:, 0], places[:, 1]].reshape(since.shape)
    right = (since == 0) & (rng.random(since.shape) < 0.85)
    said = np.where(right, truth, rng.integers(0, 10, since.shape))[:, None]
    classes = np.where(since == 0, 0.8, 0.1)[:, None] * (said == np.arange(10)[:, None, None])
    o = np.moveaxis(rng.dirichlet(np.ones(4), since.shape), -1, 1)
    grids = np.concatenate([classes, (1 - classes.sum(axis=1, keepdims=True)) * o], axis=1)
    return deepcopy(frames), [o.astype(np.float32), grids.astype(np.float32), truth, since], spec


@hidden
def check_remember(maps: Callable) -> None:
    """Ten frames of a drive, against one frame: nothing lost in view, much gained in cells seen before."""
    frames, (occupancy, grids, truth, since), spec = _driven()
    one = grids.argmax(axis=1)  # before an answer may change what it gets
    got = answer_array(maps(frames, occupancy, grids, spec))
    assert got.shape == truth.shape, "maps of another shape, or for another number of frames"
    for name, cells, least in (("in view", since == 0, -0.5), ("seen before", since > 0, LEAST_GAIN)):
        gain = 100 * ((got == truth)[cells].mean() - (one == truth)[cells].mean())
        assert gain > least, name + ": too few points against one frame, on a drive that moves"
