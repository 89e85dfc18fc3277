"""Errors that several returns share, in two models: the pose of a scan, the calibration behind a label (section 4).

The first model is a scan. Several rings of a LIDAR hit a wall in the same scan, so a wrong pose shifts all their
returns together. Evidence cell by cell takes these returns as independent, up to `SensorModel.max_returns` of them.
The second model is a cell of the ground truth, which gets its label by a vote of returns. A wrong calibration gives the
wrong pixels to all of them (lecture 09).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.ground_truth import carry_labels
from semgrid_edu.errors import ArgumentError, check_fields
from semgrid_edu.graphical.exact import eliminate
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.layout import in_rows
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE
from semgrid_edu.stage_models.beam import BINS_PER_CELL, MARGIN, BeamWorld, range_bins, range_state, reflection
from semgrid_edu.stage_models.stage_graph import StageGraph, binary, cut_edges, directed, with_gaps
from semgrid_edu.stage_models.thick_walls import beam_beliefs, occupied, package_row, same_sensor


def scan_with_pose_error(world: BeamWorld | None = None, rings: int = 2) -> StageGraph:
    """Build the graph of one scan whose rings share the pose error e: each range is z = r + e.

    Parameters
    ----------
    world : BeamWorld, optional
        The cells and the beam; eight cells with the package's sensor and a noise of one cell when left out. Its `noise`
        is the standard deviation of the pose along the beams, in cells; the rings' own noise is left out.
    rings : int
        Number of rings, each with one return in the scan; at least 1.

    Returns
    -------
    StageGraph
        Variables m1 ... mK, r1, r2, ... and z1, z2, ... as in `beam_over_cells`, and e in tenths of a cell.
    """
    world = world or same_sensor(1.0)
    if rings < 1:
        raise ArgumentError("rings", "at least 1", rings)
    if world.noise == 0:
        raise ArgumentError("world", "a noise above 0: the pose error", world)
    names = [(f"r{b}", f"z{b}") for b in range(1, rings + 1)]
    factors = [*(binary(cell, world.prior) for cell in world.cells), Factor("e", _pose_error(world))]
    for r, z in names:
        factors += [reflection(world, r), Factor((r, "e", z), _shifted(world))]
    reflected, measured = zip(*names, strict=True)
    return StageGraph(
        "One scan, one pose error",
        directed(factors),
        observed=measured,
        positions=in_rows(world.cells, (), with_gaps(reflected), with_gaps(measured), ["e"]),
        equations={reflected[-1]: "which cell reflects", measured[-1]: "range", "e": "pose error"},
        plates={"scans": (*reflected, *measured, "e")},
        cut=cut_edges("pose"),
    )


def _offsets(world: BeamWorld) -> NDArray[np.int64]:
    margin = int(np.ceil(MARGIN * world.noise)) * BINS_PER_CELL
    return np.arange(-margin, margin + 1)


def _pose_error(world: BeamWorld) -> NDArray[np.float64]:
    """Return P(e): normal, in tenths of a cell."""
    density = np.exp(-0.5 * (_offsets(world) / BINS_PER_CELL / world.noise) ** 2)
    return density / density.sum()


def _shifted(world: BeamWorld) -> NDArray[np.float64]:
    """Return P(z | r, e): 1 for z = r + e, otherwise 0; the last state of r and of z is "none"."""
    ranges = np.arange(world.n_ranges)[:, None] * BINS_PER_CELL + _offsets(world)
    first = _offsets(world)[0]
    table = np.zeros((world.n_ranges + 1, len(_offsets(world)), len(range_bins(world)) + 1))
    table[:-1] = np.eye(table.shape[2])[ranges - first]
    table[-1, :, -1] = 1
    return table


class Counted(NamedTuple):
    """P(occupied) of the cell in which all returns of a scan lie, for one ring, two rings, and so on.

    Parameters
    ----------
    exact : (rings,) float64
        The exact probability, when all rings share one pose error.
    independent : (rings,) float64
        The exact probability if each ring had an error of its own.
    package : (rings,) float64
        The probability in the package's log-odds grid.
    """

    exact: NDArray[np.float64]
    independent: NDArray[np.float64]
    package: NDArray[np.float64]


def count_rings(noise: float = 1.0, rings: int = 3, z: int = 4) -> Counted:
    """Measure the confidence of exact inference, and of the package's grid, in the cell of a scan's returns.

    With a pose error of one cell, 20 cm, the package's grid gives the cell P(occupied) = 0.80 after one ring and 0.97,
    its upper bound, after two. The exact probability is 0.40 after one ring and 0.46 after two, and a third ring adds
    less than 0.001. If each ring had an error of its own, it would be 0.57 after two rings and 0.69 after three.

    Parameters
    ----------
    noise : float
        Standard deviation of the pose along the beams, in cells.
    rings : int
        Largest number of rings, which all have a return at the same range.
    z : int
        That range, in cells, 0 for the middle of the nearest cell.

    Returns
    -------
    Counted
        P(occupied) for each number of rings.
    """
    world = same_sensor(noise)
    exact, package = [], []
    for count in range(1, rings + 1):
        stage = scan_with_pose_error(world, count)
        known = dict.fromkeys(stage.observed, range_state(world, z))
        exact.append(occupied(eliminate(stage.model, world.cells, known).normalised())[z])
        package.append(package_row([z], rings=count)[0, z])
    independent = beam_beliefs(world, [float(z)] * rings).exact[:, z]
    return Counted(np.array(exact), independent, np.array(package))


CONTENTS = tuple(KITTI_14.index(name) for name in ("road", "car"))
"""What may stand in the cell, as classes of KITTI-14."""

MADE = (*CONTENTS, *UNKNOWN_OF_STATE)
"""What the cell may be labelled, as classes of KITTI-14: the states of the variable y."""

STATE_GIVEN_CONTENT = ((0.80, 0.05, 0.05, 0.10), (0.10, 0.60, 0.20, 0.10))
"""Probability of FREE, STATIC, DYNAMIC and UNKNOWN on road and in a car: an assumption."""


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
    """

    returns: int = 3
    outline: float = 0.1
    calibration: float = 0.1
    lost: float = 0.0
    vote: str = "majority"

    def __post_init__(self) -> None:
        """Refuse what the graph can't hold."""
        check_fields(self, "a number from 1 to 9", lambda n: 1 <= n <= 9, "returns")
        check_fields(self, "a probability", lambda p: 0 <= p <= 1, "outline", "calibration", "lost")
        check_fields(self, "majority or standing", lambda vote: vote in ("majority", "standing"), "vote")


def lidar_label_stage(world: LabelWorld | None = None) -> StageGraph:
    """Build the directed model of how one cell gets its label.

    Parameters
    ----------
    world : LabelWorld, optional
        The cell and its errors; the defaults when left out.

    Returns
    -------
    StageGraph
        Variables m (what is there: 0 road, 1 car), c (calibration: 0 right, 1 off), for each return a1, a2, ...
        (class of its pixel: 0 road, 1 car), d1, d2, ... (0 it has a depth, 1 none) and x1, x2, ... (what it brings to
        the cell: 0 road, 1 car, 2 nothing), o (FREE, STATIC, DYNAMIC, UNKNOWN), and y (the label, one of `MADE`).
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
        observed=("o", *(f"{name}{k}" for k in range(1, world.returns + 1) for name in "ad")),
        positions=_positions(world.returns),
        equations={"m": "what is there", "c": "calibration", "o": "occupancy", "y": "label"},
        labels={"c": r"$\kappa$", "neighbour": "$y'$"},
        cut=cut_edges("label"),
        ghosts={"neighbour": (1.1 * world.returns - 0.5, -2.4)},
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
    joint = eliminate(lidar_label_stage(world).model, ("m", "y")).table
    joint = joint / joint.sum(axis=1, keepdims=True)
    wrong = joint[0, 1], joint[1, 0]
    return float(np.mean(wrong) if content is None else wrong[content])


def _voted(world: LabelWorld) -> NDArray[np.float64]:
    """Return P(y | x1, ..., o) by the package's own `carry_labels`, to which each assignment is one cell of a grid."""
    shape = (*(3,) * world.returns, 4)
    cells = np.indices(shape).reshape(len(shape), -1)
    classes = np.array([*CONTENTS, IGNORE], np.uint8)[cells[:-1]]
    pixels, reached = np.arange(classes.size), np.tile(np.arange(cells.shape[1]), world.returns)
    label_set = KITTI_14 if world.vote == "standing" else replace(KITTI_14, flat=())
    made = carry_labels(classes, pixels, reached, np.eye(4)[:, cells[-1], None], label_set)[:, 0]
    return (made[:, None] == np.array(MADE)).astype(float).reshape(*shape, len(MADE))


def _positions(n: int) -> dict[str, tuple[float, float]]:
    """Place the world above, what is measured below it, and the label at the bottom."""
    places = {"m": (-0.2, 3.4), "c": (2.2 * n - 1.0, 3.4), "o": (-1.6, 0.0), "y": (1.1 * (n - 1) + 0.6, -1.2)}
    for k in range(n):
        places |= {f"a{k + 1}": (2.2 * k, 1.2), f"d{k + 1}": (2.2 * k + 1.2, 1.2), f"x{k + 1}": (2.2 * k + 0.6, 0.0)}
    return places
