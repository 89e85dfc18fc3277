"""What each cut edge costs: the exact answer beside the system's, one function per priced edge of `cut_edges.toml`.

Every number comes from exact inference in the model of its stage, and from what the package itself computes there.
"""

from collections.abc import Callable
from itertools import product as every_combination

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from semgrid_edu.crf import CrfParams, exact_marginals, mean_field_naive
from semgrid_edu.graphical.exact import eliminate
from semgrid_edu.occupancy import State
from semgrid_edu.stage_models.beam import BeamWorld
from semgrid_edu.stage_models.bof import HEAD_ON, STANDING_OR_DRIVING, TOWARDS_A_FENCE, bof_beliefs, expected_things
from semgrid_edu.stage_models.cells_in_a_row import DT, Cell, CellsInARow
from semgrid_edu.stage_models.class_memory import memory_price
from semgrid_edu.stage_models.cmcdot import LEFT_OR_RIGHT, sampling_error
from semgrid_edu.stage_models.cmcdot_graph import cmcdot_stage
from semgrid_edu.stage_models.crf import UNDECIDED, all_free, two_classes
from semgrid_edu.stage_models.ground_truth_label import LabelWorld, count_rings, wrong_label
from semgrid_edu.stage_models.joint_row import exact_beliefs
from semgrid_edu.stage_models.late_fusion import CAR, UNKNOWN, car_by_both
from semgrid_edu.stage_models.line import bayes_on_a_line, filtered, smoothed
from semgrid_edu.stage_models.pixel_ray import (
    believed_by_readers,
    believed_of_post,
    cell_by_cell,
    exact_ray,
    pixel_height,
)
from semgrid_edu.stage_models.stage_graph import Price, StageGraph
from semgrid_edu.stage_models.system import street, system_gain
from semgrid_edu.stage_models.system_world import STATE_OF, SystemWorld
from semgrid_edu.stage_models.thick_walls import beam_beliefs

FOUR_RANGES = (4.0, 4.6, 3.6, 4.2)
"""Ranges of a wall in the fifth of eight cells."""


def the_future() -> Price:
    """Lecture 01: how frequently the most probable place is right, in trips of six steps."""
    stage = bayes_on_a_line(steps=6)
    return Price(_right(stage, smoothed), _right(stage, filtered), "place right, mean of six steps")


def _right(stage: StageGraph, beliefs: Callable) -> float:
    """Return the probability that the most probable place is right, over all readings and steps."""
    total = 0.0
    for readings in every_combination((0, 1), repeat=len(stage.observed)):
        probability = eliminate(stage.model, (), dict(zip(stage.observed, readings, strict=True))).table
        total += float(probability) * beliefs(stage, readings).max(axis=1).mean()
    return total


def behind_the_wall() -> Price:
    """Lecture 02: the cell behind a wall after four ranges, exactly and cell by cell."""
    beliefs = beam_beliefs(BeamWorld(), FOUR_RANGES)
    return Price(beliefs.exact[-1, 5], beliefs.cell_by_cell[-1, 5], "P(occupied) of the cell behind a wall")


def shared_pose_error() -> Price:
    """Lecture 02: the cell of two rings' returns that share the error of the pose, and if each had one of its own."""
    counted = count_rings(rings=2)
    return Price(counted.exact[1], counted.independent[1], "P(occupied) after two rings")


def in_both_places() -> Price:
    """Lecture 03: number of things in a row where one thing stands or drives."""
    exact, bof = (expected_things(beliefs(STANDING_OR_DRIVING))[0] for beliefs in (exact_beliefs, bof_beliefs))
    return Price(exact, bof, "things in the row")


def before_a_fence() -> Price:
    """Lecture 03: whether the thing before a fence stands."""
    exact, bof = (beliefs(TOWARDS_A_FENCE)[0, 1, Cell.STATIC] for beliefs in (exact_beliefs, bof_beliefs))
    return Price(exact, bof, "P(STATIC) before a fence")


def head_on() -> Price:
    """Lecture 03: whether either of two things has come into the cell between them."""
    exact, bof = (1 - beliefs(HEAD_ON)[0, 1, Cell.FREE] for beliefs in (exact_beliefs, bof_beliefs))
    return Price(exact, bof, "P(occupied) between two that come")


def left_by_bof() -> Price:
    """Lecture 04: the part of CMCDOT's error that no number of particles removes."""
    bof = bof_beliefs(LEFT_OR_RIGHT) - exact_beliefs(LEFT_OR_RIGHT)
    return Price(0.0, float(np.sqrt(np.square(bof).mean())), "root mean square error, N → ∞")


def sampling() -> Price:
    """Lecture 04: what sampling adds to that error with 100 particles."""
    error = sampling_error(LEFT_OR_RIGHT, [100], seeds=range(40))
    return Price(0.0, float(error.to_bof[0]), "root mean square error, N = 100")


def out_of_a_wall() -> Price:
    """Lecture 04: whether a thing arrives that leaves a cell in which something may stand."""
    unseen = {"unknown": 1.0}
    world = CellsInARow(({"static": 0.3, "right": 0.5}, unseen, unseen), ("???",), clearing_time=DT)
    found = eliminate(cmcdot_stage(world).model, "m1", {"one1": 1}).normalised().table
    return Price(exact_beliefs(world)[0, 1, Cell.RIGHT], found[State.DYNAMIC], "P(DYNAMIC) beside its origin")


def behind_a_car() -> Price:
    """Lecture 05: the cell behind a car, when the pixels say road, car, car, car."""
    exact, system = (infer([0, 1, 1, 1])[2] for infer in (exact_ray, cell_by_cell))
    return Price(exact, system, "P(car) of the cell behind a car")


def flat_world() -> Price:
    """Lecture 05: whether what a car's pixel shows stands where the ray meets the ground."""
    places = eliminate(pixel_height().model, ("x",), {"a": 1}).normalised().table
    return Price(places[0], 1.0, "P(a car's pixel shows the ground's place)")


def four_readers() -> Price:
    """Lecture 06: what four cells know that read one pixel."""
    exact, system = believed_by_readers(4)
    return Price(exact, system, "P(car) when four cells read car")


def gap_in_a_post() -> Price:
    """Lecture 07: a pixel of a post that the network takes for something else, between four that it names rightly."""
    exact, alone = believed_of_post([1, 1, 0, 1, 1])[:, 2]
    return Price(exact, alone, "P(post) of a gap in a post")


def hidden_from_both() -> Price:
    """Lecture 08: the cell whose pixel shows a car, and which no beam reached."""
    exact, late = car_by_both(CAR, UNKNOWN)
    return Price(exact, late, "P(car), pixel says car, o UNKNOWN")


def nine_votes() -> Price:
    """Lecture 09: how probable a wrong label is with nine votes, and if each vote had an error of its own."""
    world, one = LabelWorld(returns=9), LabelWorld(returns=1)
    alone = binom.sf(world.returns // 2, world.returns, wrong_label(one))
    return Price(wrong_label(world), float(alone), "P(wrong label) with nine votes")


def mean_field_picks_a_side() -> Price:
    """Lecture 10: the centre of nine cells that are undecided, at the default weights."""
    unary, values = two_classes(UNDECIDED), all_free(UNDECIDED.shape)
    exact, found = (infer(unary, values, CrfParams())[0, 1, 1] for infer in (exact_marginals, mean_field_naive))
    return Price(exact, found, "P(class 0) of an undecided cell")


def image_for_the_filter() -> Price:
    """Lecture 00: how well the state of the near cell is known, with and without the present image."""
    states = np.eye(3)[STATE_OF].T
    with_image, scans = (_log_loss(states, ("near1",), given) for given in (("l0", "l1", "i1"), ("l0", "l1")))
    return Price(with_image, scans, "nats: state of the near cell")


def depth_for_the_image() -> Price:
    """Lecture 00: how well the class that the pixel sees is known, with and without the present scan."""
    seen = SystemWorld().sees().reshape(25, 4).T
    with_scan, image = (_log_loss(seen, ("near1", "far1"), given) for given in (("i1", "l1"), ("i1",)))
    return Price(with_scan, image, "nats: class that the pixel sees")


def _log_loss(of: NDArray, cells: tuple[str, ...], given: tuple[str, ...]) -> float:
    """Return the mean of -log P(something | readings), nats: the entropy of what the contents of cells say."""
    told = of @ eliminate(street(SystemWorld()), (*cells, *given)).table.reshape(of.shape[1], -1)
    return float(-(told * np.log(np.where(told > 0, told / told.sum(axis=0), 1))).sum())


def forgotten_class() -> Price:
    """Lecture 00: how well the class of the far cell is known, with and without the earlier image."""
    gain = system_gain()
    return Price(gain.joint.log_loss[1], gain.scans.log_loss[1], "nats: class of the far cell")


def errors_by_themselves() -> Price:
    """Lecture 14: how well a cell's class is known after three frames that err together."""
    price = memory_price()
    return Price(price.exact, price.weighted, "nats: class of a cell, three frames")
