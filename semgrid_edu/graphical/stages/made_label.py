"""The label of one cell, made from image labels and LIDAR: what stands there, errors, votes (section 4, lecture 09)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.ground_truth import carry_labels
from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.exact import eliminate
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.stages.stage_graph import CutEdge, StageGraph
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE

CONTENTS = tuple(KITTI_14.index(name) for name in ("road", "car"))
"""What may stand in the cell, as classes of KITTI-14."""

MADE = (*CONTENTS, *UNKNOWN_OF_STATE)
"""What the cell may be labelled, as classes of KITTI-14: the states of the variable y."""

STATE_GIVEN_CONTENT = ((0.80, 0.05, 0.05, 0.10), (0.10, 0.60, 0.20, 0.10))
"""Probability of FREE, STATIC, DYNAMIC and UNKNOWN on road and in a car: an assumption."""

MADE_LABEL_CUT = (
    CutEdge(
        "calibration - votes",
        "Votes are counted as if returns erred independently, but all returns share the calibration, so no number of "
        "votes outvotes its error.",
    ),
    CutEdge(
        "o -> y, where there is a vote",
        "The occupancy state is asked only where no labelled return lies, so a cell that surely holds something keeps "
        "the label road.",
    ),
    CutEdge(
        "a1 - d1",
        "A return is taken to lie on what its pixel shows, unless a closer return shares the pixel, so grass behind a "
        "fence is labelled fence.",
    ),
    CutEdge(
        "y - its neighbours",
        "Each cell votes by itself; the clean-up joins neighbours again, without asking what else is known of them.",
    ),
)
"""What the recipe leaves out when it makes the label of a cell."""


@dataclass(frozen=True)
class LabelWorld:
    """A cell at the outline of a car, which some returns hit, and the errors in what is known of them.

    Parameters
    ----------
    returns : int
        Number of returns in the cell, 1 to 9.
    outline : float
        Probability that the pixel of a return has the wrong class, because outlines are drawn by hand, 0..1.
    calibration : float
        Probability that the calibration is off by so much that all returns of the cell fall on the pixels of what
        stands beside it, 0..1.
    lost : float
        Probability that a return has no labelled pixel, 0..1.
    vote : str
        "majority" or "standing", as in `TruthPolicy`.

    Raises
    ------
    ArgumentError
        When a number is outside its range, or there is no such vote.
    """

    returns: int = 3
    outline: float = 0.1
    calibration: float = 0.1
    lost: float = 0.0
    vote: str = "majority"

    def __post_init__(self) -> None:
        """Refuse what the graph can't hold."""
        if not 1 <= self.returns <= 9:
            raise ArgumentError("returns", "a number from 1 to 9", self.returns)
        for name in ("outline", "calibration", "lost"):
            if not 0 <= getattr(self, name) <= 1:
                raise ArgumentError(name, "a probability", getattr(self, name))
        if self.vote not in ("majority", "standing"):
            raise ArgumentError("vote", "majority or standing", repr(self.vote))


def made_label_stage(world: LabelWorld | None = None) -> StageGraph:
    """Build the directed model of how one cell gets its label.

    Parameters
    ----------
    world : LabelWorld, optional
        The cell and its errors; the defaults when left out.

    Returns
    -------
    StageGraph
        Variables m (what stands there: 0 road, 1 car), c (calibration: 0 right, 1 off), for each return a1, a2, ...
        (class of its pixel: 0 road, 1 car), d1, d2, ... (0 it has a depth, 1 none) and x1, x2, ... (what it brings to
        the cell: 0 road, 1 car, 2 nothing), o (FREE, STATIC, DYNAMIC, UNKNOWN), and y (the label, one of `MADE`).
    """
    world = world or LabelWorld()
    right = 1 - world.outline
    shown = [[[right, 1 - right], [1 - right, right]], [[1 - right, right], [right, 1 - right]]]  # by m, then by c
    brought = np.stack([np.eye(3)[:2], np.eye(3)[[2, 2]]], axis=1)  # by class of the pixel, then by depth
    factors, parents = [Factor("m", [0.5, 0.5]), Factor("c", [1 - world.calibration, world.calibration])], {}
    for k in range(1, world.returns + 1):
        a, d, x = f"a{k}", f"d{k}", f"x{k}"
        factors += [Factor(("m", "c", a), shown), Factor(d, [1 - world.lost, world.lost]), Factor((a, d, x), brought)]
        parents |= {a: ("m", "c"), x: (a, d)}
    votes = tuple(f"x{k}" for k in range(1, world.returns + 1))
    factors += [Factor(("m", "o"), STATE_GIVEN_CONTENT), Factor((*votes, "o", "y"), _voted(world))]
    return StageGraph(
        "How one cell gets its label",
        GraphicalModel(factors, parents | {"o": ("m",), "y": (*votes, "o")}),
        observed=("o", *(f"{name}{k}" for k in range(1, world.returns + 1) for name in "ad")),
        positions=_positions(world.returns),
        equations={"m": "what stands there", "c": "calibration", "o": "occupancy", "y": "label"},
        cut=MADE_LABEL_CUT,
    )


def wrong_label(world: LabelWorld, content: int | None = None) -> float:
    """Return how probable it is that the cell gets the label of what doesn't stand there.

    Parameters
    ----------
    world : LabelWorld
        The cell and its errors.
    content : int, optional
        0 when road lies there, 1 when a car stands there; either is as probable when left out.

    Returns
    -------
    float
        By exact inference. A cell without a label isn't wrong.
    """
    joint = eliminate(made_label_stage(world).model, ("m", "y")).table
    joint = joint / joint.sum(axis=1, keepdims=True)
    wrong = joint[0, 1], joint[1, 0]
    return float(np.mean(wrong) if content is None else wrong[content])


def _voted(world: LabelWorld) -> NDArray[np.float64]:
    """Return P(y | x1, ..., o) by the package's own `carry_labels`, to which each assignment is one cell of a grid."""
    shape = (*(3,) * world.returns, 4)
    cells = np.indices(shape).reshape(len(shape), -1)
    classes = np.array([*CONTENTS, IGNORE], np.uint8)[cells[:-1]]
    n = cells.shape[1]
    pixels, reached = np.arange(classes.size), np.tile(np.arange(n), world.returns)
    label_set = KITTI_14 if world.vote == "standing" else replace(KITTI_14, flat=())
    made = carry_labels(classes, pixels, reached, np.eye(4)[:, cells[-1], None], label_set)[:, 0]
    return (made[:, None] == np.array(MADE)).astype(float).reshape(*shape, len(MADE))


def _positions(n: int) -> dict[str, tuple[float, float]]:
    """Place the world above, what is measured below it, and the label at the bottom."""
    places = {"m": (1.0, 2.4), "c": (1.8 * n - 0.6, 2.4), "o": (-1.6, 0.0), "y": (0.9 * (n - 1) + 0.4, -1.2)}
    for k in range(n):
        places |= {f"a{k + 1}": (1.8 * k, 1.2), f"d{k + 1}": (1.8 * k + 0.8, 1.2), f"x{k + 1}": (1.8 * k + 0.4, 0.0)}
    return places
