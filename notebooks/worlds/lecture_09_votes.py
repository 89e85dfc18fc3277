"""Which errors a vote can remove: the same cells of a drive, with one kind of error after the other."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import transform_points
from semgrid_edu.datasets.project_lidar import closest_returns
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.workshop.flaws import NO_FLAWS, TruthFlaws, flawed_labels, miscalibrated

MOST = 9
"""Votes of each cell that is looked at; cells with fewer returns are left out."""
COUNTS = (1, 3, 5, 9)
"""How many of them vote."""
MARGINS = (0, 2, 4, 6)
"""Least margins of four bands: how many votes the most frequent class is ahead of the next, of all `MOST`."""
RATE = 0.1
"""Probability that a return brings a wrong class, each by itself: about as often as with a camera that is off."""
CAMERA = replace(NO_FLAWS, rotation=TruthFlaws().rotation, translation=TruthFlaws().translation)
OUTLINES = replace(NO_FLAWS, outline=TruthFlaws().outline)


class Votes(NamedTuple):
    """What an error does to the returns of many cells, and to the vote of some of them.

    Parameters
    ----------
    several : float
        Share of the cells whose returns bring several classes even without the error, because an outline passes.
    wrong : (2,) float64
        Probability that a return brings another class than without the error, in cells of one class and of several.
    changed : (3, len(COUNTS)) float64
        Share of the cells whose majority is another one than without the error, by the number of votes: of cells of one
        class, of cells of several, and of all.
    by_margin : (len(MARGINS), 2) float64
        The same share of cells of several classes, with one vote and with all, by the margin without the error.
    """

    several: float
    wrong: NDArray[np.float64]
    changed: NDArray[np.float64]
    by_margin: NDArray[np.float64]


Spoil = Callable[[Frame, NDArray, np.random.Generator], NDArray]


def each_by_itself(frame: Frame, numbers: NDArray, rng: np.random.Generator) -> NDArray:
    """Return the class that each return brings, if one in ten brings a class drawn at random."""
    classes = shown(frame, numbers)
    other = (classes + rng.integers(1, KITTI_14.n_semantic, len(classes))) % KITTI_14.n_semantic
    return np.where(rng.random(len(classes)) < RATE, other, classes)


def outlines_off(frame: Frame, numbers: NDArray, rng: np.random.Generator) -> NDArray:
    """Return the classes, if outlines are drawn a little off: neighbouring pixels are shifted alike."""
    labels = flawed_labels(frame.labels.image, KITTI_14, OUTLINES, rng)
    return shown(replace(frame, labels=replace(frame.labels, image=labels)), numbers)


def one_camera_off(frame: Frame, numbers: NDArray, rng: np.random.Generator) -> NDArray:
    """Return the classes, if the camera is turned and displaced by a small random error."""
    return shown(replace(frame, camera=miscalibrated(frame.camera, CAMERA, rng)), numbers)


def own_camera_off(frame: Frame, numbers: NDArray, rng: np.random.Generator) -> NDArray:
    """Return the classes, if each return had a camera of its own with such an error: nothing is shared."""
    in_camera = transform_points(frame.camera.T_camera_from_lidar, frame.points[numbers, :3])
    turn = np.radians(CAMERA.rotation) * rng.standard_normal((len(numbers), 3))
    shifted = in_camera + np.cross(turn, in_camera) + CAMERA.translation * rng.standard_normal((len(numbers), 3))
    return _at(frame, shifted @ frame.camera.K.T)


KINDS: dict[str, tuple[Spoil, int]] = {
    "each return by itself": (each_by_itself, 6),
    "outlines drawn off": (outlines_off, 4),
    "the camera off": (one_camera_off, 6),
    "a camera for each return": (own_camera_off, 6),
}
"""The kinds of error by name, and how often each is drawn; outlines differ in each frame, so four draws are enough.
The last kind is a control that no data have: nothing is shared."""


def shown(frame: Frame, numbers: NDArray) -> NDArray:
    """Return the class of the pixel on which each of some returns falls."""
    return _at(frame, _homogeneous(frame, numbers))


def count_votes(frames: Sequence[Frame], spec: GridSpec, kind: str) -> Votes:
    """Let one error spoil the returns of some frames, and count what it does to the votes.

    Parameters
    ----------
    frames : sequence of Frame
        Labelled frames.
    spec : GridSpec
        The grid; only cells with at least `MOST` returns count.
    kind : str
        A key of `KINDS`. All frames share a camera, as those of a day do.
    """
    exact, spoilt = (np.concatenate(part) for part in zip(*_drawn(frames, spec, *KINDS[kind]), strict=True))
    several = (exact != exact[:, :1]).any(axis=1)
    changed = np.stack([_majority(exact[:, :n]) != _majority(spoilt[:, :n]) for n in COUNTS])
    kinds = ~several, several, np.ones_like(several)
    most = np.sort(_votes_of_each_class(exact), axis=1)
    band = np.digitize(most[:, -1] - most[:, -2], MARGINS) - 1
    return Votes(
        float(several.mean()),
        np.array([(exact != spoilt)[kind].mean() for kind in kinds[:2]]),
        np.stack([changed[:, kind].mean(axis=1) for kind in kinds]),
        np.stack([changed[[0, -1]][:, several & (band == b)].mean(axis=1) for b in range(len(MARGINS))]),
    )


def _drawn(frames: Sequence[Frame], spec: GridSpec, spoil: Spoil, seeds: int) -> Iterator[tuple[NDArray, NDArray]]:
    """Yield the classes of `MOST` returns of each cell in random order, (N, MOST), without the error and with it."""
    for seed in range(seeds):
        for number, frame in enumerate(frames):
            returns, _ = closest_returns(frame)
            rows, cols, inside = spec.cells(frame.points_grid[returns])
            returns = returns[inside]
            cells = (rows * spec.shape[1] + cols)[inside]
            order = np.random.default_rng([seed, number]).permutation(len(cells))
            order = order[np.argsort(cells[order], kind="stable")]
            _, first, count = np.unique(cells[order], return_index=True, return_counts=True)
            chosen = returns[order[first[count >= MOST, None] + np.arange(MOST)]]
            key = [seed] if spoil is one_camera_off else [seed, number]
            spoilt = spoil(frame, chosen.ravel(), np.random.default_rng([9, *key]))
            yield shown(frame, chosen.ravel()).reshape(chosen.shape), spoilt.reshape(chosen.shape)


def _homogeneous(frame: Frame, numbers: NDArray) -> NDArray:
    """Return the homogeneous image points of some returns, (N, 3)."""
    return transform_points(frame.camera.T_camera_from_lidar, frame.points[numbers, :3]) @ frame.camera.K.T


def _at(frame: Frame, uvw: NDArray) -> NDArray:
    """Return the class at the nearest pixel of homogeneous image points, or at the image's rim if it is outside."""
    height, width = frame.camera.size
    u, v = np.rint(uvw[:, :2] / uvw[:, 2:]).astype(int).T
    return frame.labels.image[v.clip(0, height - 1), u.clip(0, width - 1)]


def _majority(classes: NDArray) -> NDArray:
    """Return the most frequent class of each row, the first of equally frequent ones."""
    return _votes_of_each_class(classes).argmax(axis=1)


def _votes_of_each_class(classes: NDArray) -> NDArray:
    """Return how many entries of each row are of each class, (N, n_semantic)."""
    return (classes[..., None] == np.arange(KITTI_14.n_semantic)).sum(axis=1)
