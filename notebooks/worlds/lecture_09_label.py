"""How one cell of the ground truth gets its label: by a vote of returns that share the calibration error."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from semgrid_edu.datasets.ground_truth import carry_labels
from semgrid_edu.graphical import Factor, eliminate
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, binary, directed

CONTENTS = tuple(KITTI_14.index(name) for name in ("road", "car"))
"""What may be in the cell, as classes of KITTI-14."""

MADE = (*CONTENTS, *UNKNOWN_OF_STATE)
"""The possible labels of the cell, as classes of KITTI-14: the states of the variable y."""

STATE_GIVEN_CONTENT = ((0.80, 0.05, 0.05, 0.10), (0.10, 0.60, 0.20, 0.10))
"""Probability of FREE, STATIC, DYNAMIC and UNKNOWN on road and in a car: an assumption."""


@dataclass(frozen=True)
class LabelWorld:
    """A cell at the outline of a car, the returns that hit it, and their errors.

    Parameters
    ----------
    returns : int
        Number of returns in the cell, 1 to 9.
    outline : float
        Probability that the pixel of a return has the wrong class, because outlines are drawn by hand, 0..1.
    calibration : float
        Probability that the calibration error is so large that all returns of the cell fall on its neighbour's pixels,
        0..1.
    lost : float
        Probability that a return has no labelled pixel, 0..1.
    vote : str
        "majority" or "standing", as in `TruthPolicy`.
    """

    returns: int = 3
    outline: float = 0.1
    calibration: float = 0.1
    lost: float = 0.0
    vote: str = "majority"


def lidar_label_stage(world: LabelWorld | None = None) -> StageGraph:
    """Build the directed model of how one cell gets its label.

    Variables are m (what is there: 0 road, 1 car), c (calibration: 0 right, 1 off), for each return a1, a2, ... (class
    of its pixel: 0 road, 1 car), d1, d2, ... (0 it has a depth, 1 none) and x1, x2, ... (what it brings to the cell: 0
    road, 1 car, 2 nothing), o (FREE, STATIC, DYNAMIC, UNKNOWN), and y (the label, one of `MADE`).
    """
    world = world or LabelWorld()
    right = 1 - world.outline
    shown = [[[right, 1 - right], [1 - right, right]], [[1 - right, right], [right, 1 - right]]]  # by m, then by c
    brought = np.stack([np.eye(3)[:2], np.eye(3)[[2, 2]]], axis=1)  # by class of the pixel, then by depth
    factors = [binary("m", 0.5), binary("c", world.calibration)]
    for k in range(1, world.returns + 1):
        a, d, x = f"a{k}", f"d{k}", f"x{k}"
        factors += [Factor(("m", "c", a), shown), binary(d, world.lost), Factor((a, d, x), brought)]
    votes = tuple(f"x{k}" for k in range(1, world.returns + 1))
    factors += [Factor(("m", "o"), STATE_GIVEN_CONTENT), Factor((*votes, "o", "y"), _voted(world))]
    return StageGraph(
        "How one cell gets its label",
        directed(factors),
        positions=_positions(world.returns),
        observed=("o", *(f"{name}{k}" for k in range(1, world.returns + 1) for name in "ad")),
        equations={"m": "what is there", "c": "calibration", "o": "occupancy", "y": "label"},
        labels={"c": r"$\kappa$", "neighbour": "$y'$"},
        cut=CUT,
        ghosts={"neighbour": (1.1 * world.returns - 0.5, -2.4)},
    )


def wrong_label(world: LabelWorld, content: int | None = None) -> float:
    """Return the probability that the cell gets a wrong label, by exact inference.

    `content` is 0 for road, 1 for a car; if left out, both are equally probable. A cell without a label isn't wrong.
    """
    joint = eliminate(lidar_label_stage(world).model, ("m", "y")).table
    joint = joint / joint.sum(axis=1, keepdims=True)
    wrong = joint[0, 1], joint[1, 0]
    return float(np.mean(wrong) if content is None else wrong[content])


def _voted(world: LabelWorld) -> NDArray[np.float64]:
    """Return P(y | x1, ..., o) by the package's `carry_labels`: each assignment is one cell of a grid."""
    shape = (*(3,) * world.returns, 4)
    cells = np.indices(shape).reshape(len(shape), -1)
    classes = np.array([*CONTENTS, IGNORE], np.uint8)[cells[:-1]]
    pixels = np.arange(classes.size)
    reached = np.tile(np.arange(cells.shape[1]), world.returns)
    label_set = KITTI_14 if world.vote == "standing" else replace(KITTI_14, flat=())
    made = carry_labels(classes, pixels, reached, np.eye(4)[:, cells[-1], None], label_set)[:, 0]
    return (made[:, None] == np.array(MADE)).astype(float).reshape(*shape, len(MADE))


def _positions(n: int) -> dict[str, tuple[float, float]]:
    """Place the world above, what is measured below it, and the label at the bottom."""
    places = {"m": (-0.2, 3.4), "c": (2.2 * n - 1.0, 3.4), "o": (-1.6, 0.0), "y": (1.1 * (n - 1) + 0.6, -1.2)}
    for k in range(n):
        places |= {f"a{k + 1}": (2.2 * k, 1.2), f"d{k + 1}": (2.2 * k + 1.2, 1.2), f"x{k + 1}": (2.2 * k + 0.6, 0.0)}
    return places


@cache
def nine_votes() -> Price:
    """P(wrong label) with nine votes, and if their errors were independent."""
    world = LabelWorld(returns=9)
    alone = binom.sf(world.returns // 2, world.returns, wrong_label(LabelWorld(returns=1)))
    return Price(wrong_label(world), float(alone), "P(wrong label) with nine votes")


CUT = (
    CutEdge(
        "calibration -> votes",
        "Votes are counted as if returns erred independently, but all returns share the calibration, so no number of "
        "votes outvotes its error: with nine of them a label is wrong with probability 0.10, where independent errors "
        "would leave 0.012.",
        ("c", "a3"),
        nine_votes,
    ),
    CutEdge(
        "o -> y, where there is a vote",
        "The occupancy state is asked only where there is no labelled return, so a cell that surely holds something "
        "keeps the label road.",
        ("o", "y"),
        bend=-0.15,
    ),
    CutEdge(
        "a1 - d1",
        "A return counts for what its pixel shows, unless a closer return shares the pixel, so grass behind a fence is "
        "labelled fence.",
        ("a1", "d1"),
    ),
    CutEdge(
        "y - its neighbours",
        "Each cell votes by itself; the clean-up joins neighbours again, without asking what else is known of them.",
        ("y", "neighbour"),
    ),
)
"""The edges that the ground truth cuts."""
