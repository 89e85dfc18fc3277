"""How one cell of the ground truth gets its label: by a vote of returns that share an error."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.ground_truth import carry_labels
from semgrid_edu.graphical import Factor, eliminate
from semgrid_edu.labels import KITTI_14
from worlds.lecture_00_stage_graph import CutEdge, StageGraph, binary, directed

CONTENTS = tuple(KITTI_14.index(name) for name in ("road", "car"))
"""What may be in the cell, as classes of KITTI-14."""

CUT: tuple[CutEdge, ...] = ()
"""The vote isn't an inference in this model, so it cuts no edge of it."""


@dataclass(frozen=True)
class LabelWorld:
    """A cell, the returns that hit it, and their errors.

    Parameters
    ----------
    returns : int
        Number of returns in the cell, 1 to 9.
    alone : float
        Probability that a return brings the other class, each by itself, 0..1.
    shared : float
        Probability that the calibration is so far off that all returns of the cell fall on the other class, 0..1.
    vote : str
        "majority" or "standing", as in `TruthPolicy`.
    """

    returns: int = 3
    alone: float = 0.1
    shared: float = 0.1
    vote: str = "majority"


def lidar_label_stage(world: LabelWorld | None = None) -> StageGraph:
    """Build the directed model of how one cell gets its label.

    Variables are m (what is there: 0 road, 1 car), c (calibration: 0 right, 1 off), for each return x1, x2, ... (the
    class that it brings: 0 road, 1 car), and y (the label: 0 road, 1 car).
    """
    world = world or LabelWorld()
    right = 1 - world.alone
    brought = [[[right, 1 - right], [1 - right, right]], [[1 - right, right], [right, 1 - right]]]  # by m, then by c
    votes = tuple(f"x{k}" for k in range(1, world.returns + 1))
    factors = [
        binary("m", 0.5),
        binary("c", world.shared),
        *(Factor(("m", "c", x), brought) for x in votes),
        Factor((*votes, "y"), _voted(world)),
    ]
    middle = 1.2 * (world.returns - 1) / 2
    places = {x: (1.2 * k, 1.1) for k, x in enumerate(votes)}
    return StageGraph(
        "How one cell gets its label",
        directed(factors),
        positions={"m": (middle - 1, 2.2), "c": (middle + 1, 2.2), "y": (middle, 0.0), **places},
        observed=votes,
        equations={"m": "what is there", "c": "calibration", "y": "label"},
        labels={"c": r"$\kappa$"},
        cut=CUT,
    )


def wrong_label(world: LabelWorld, content: int | None = None) -> float:
    """Return the probability that the cell gets the wrong label, by exact inference.

    `content` is 0 for road, 1 for a car; if left out, both are equally probable.
    """
    joint = eliminate(lidar_label_stage(world).model, ("m", "y")).table
    wrong = joint[0, 1] / joint[0].sum(), joint[1, 0] / joint[1].sum()
    return float(np.mean(wrong) if content is None else wrong[content])


def _voted(world: LabelWorld) -> NDArray[np.float64]:
    """Return P(y | x1, ...) by the package's `carry_labels`: each assignment is one cell of a grid."""
    shape = (2,) * world.returns
    cells = np.indices(shape).reshape(len(shape), -1)
    classes = np.array(CONTENTS, np.uint8)[cells]
    reached = np.tile(np.arange(cells.shape[1]), world.returns)
    label_set = KITTI_14 if world.vote == "standing" else replace(KITTI_14, flat=())
    unknown = np.eye(4)[:, np.zeros(cells.shape[1], int), None]  # no cell is without a vote
    made = carry_labels(classes, np.arange(classes.size), reached, unknown, label_set)[:, 0]
    return (made[:, None] == np.array(CONTENTS)).astype(float).reshape(*shape, 2)
