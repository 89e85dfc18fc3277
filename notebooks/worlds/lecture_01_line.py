"""Bayes on a line: a vehicle's position on a ring road as a hidden Markov model (paper, section 3.2).

A filter is half of message passing on a chain: its beliefs are the messages that run forward in time. The messages that
run backward carry the evidence of later readings about earlier positions.
"""

from collections.abc import Callable, Sequence
from functools import cache
from itertools import product as every_combination

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical import Factor, eliminate, in_rows, max_product, sum_product
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, directed


def bayes_on_a_line(
    steps: int = 4,
    n_cells: int = 10,
    poles: Sequence[int] = (2, 3, 7),
    moved: Sequence[float] = (0.1, 0.8, 0.1),
    hit: float = 0.8,
    false_alarm: float = 0.1,
) -> StageGraph:
    """Build the ring road: positions n0, n1, ... one step apart, and the sensor's reading at each.

    Parameters
    ----------
    steps : int
        Number of readings; the vehicle moves between them.
    n_cells : int
        Number of cells of the ring; after the last comes cell 0 again.
    poles : sequence of int
        The cells with a pole.
    moved : sequence of float
        Probability that the vehicle moves by d cells from one reading to the next, for d = 0, 1, 2, ...; sums to 1.
    hit, false_alarm : float
        Probability that the sensor reports a pole where there is one, and elsewhere.

    Returns
    -------
    StageGraph
        Variables n0, n1, ... with `n_cells` states each, and z0, z1, ...: 0 is "nothing", 1 is "pole".
    """
    kernel = np.zeros(n_cells)
    np.add.at(kernel, np.arange(len(moved)) % n_cells, moved)
    move = np.array([np.roll(kernel, n) for n in range(n_cells)])
    reports_pole = np.where(np.isin(np.arange(n_cells), poles), hit, false_alarm)
    read = np.stack([1 - reports_pole, reports_pole], axis=1)
    factors = [Factor("n0", np.full(n_cells, 1 / n_cells))]
    factors += [Factor((f"n{t - 1}", f"n{t}"), move) for t in range(1, steps)]
    factors += [Factor((f"n{t}", f"z{t}"), read) for t in range(steps)]
    places = [f"n{t}" for t in range(steps)]
    readings = [f"z{t}" for t in range(steps)]
    return StageGraph(
        "Bayes on a line",
        directed(factors),
        positions=in_rows(places, readings),
        observed=tuple(readings),
        equations={places[-1]: "place", readings[-1]: "reading"},
        cut=CUT,
    )


def filtered(stage: StageGraph, readings: Sequence[int]) -> NDArray[np.float64]:
    """Return the filter's beliefs, (T, N): the messages of sum-product that run forward along the chain.

    `stage` is from `bayes_on_a_line`; `readings` has 0 for "nothing" and 1 for "pole". The message from n_t to
    P(n_{t+1} | n_t) is P(n_t | z_0 ... z_t), lecture 01's posterior at step t.
    """
    beliefs = sum_product(stage.model, _given(stage, readings))
    last = len(readings) - 1
    passed = [beliefs.messages[f"n{t}", f"P(n{t + 1} | n{t})"] for t in range(last)]
    return np.array([*passed, beliefs.marginals[f"n{last}"]])


def smoothed(stage: StageGraph, readings: Sequence[int]) -> NDArray[np.float64]:
    """Return P(n_t | all readings) for each step, (T, N): the product of forward and backward messages."""
    marginals = sum_product(stage.model, _given(stage, readings)).marginals
    return np.array([marginals[f"n{t}"] for t in range(len(readings))])


def most_likely_path(stage: StageGraph, readings: Sequence[int]) -> list[int]:
    """Return the most likely sequence of places given all readings, one cell per step (Viterbi)."""
    best = max_product(stage.model, _given(stage, readings))
    return [best[f"n{t}"] for t in range(len(readings))]


def _given(stage: StageGraph, readings: Sequence[int]) -> dict[str, int]:
    return {name: int(reading) for name, reading in zip(stage.observed, readings, strict=True)}


@cache
def the_future() -> Price:
    """How often the most probable position is right in trips of six steps, with all readings and with past ones."""
    stage = bayes_on_a_line(steps=6)
    return Price(_right(stage, smoothed), _right(stage, filtered), "place right, mean of six steps")


def _right(stage: StageGraph, beliefs: Callable) -> float:
    """Return the probability that the most probable position is right, over all readings and steps."""
    total = 0.0
    for readings in every_combination((0, 1), repeat=len(stage.observed)):
        probability = eliminate(stage.model, (), _given(stage, readings)).table
        total += float(probability) * beliefs(stage, readings).max(axis=1).mean()
    return total


CUT = (
    CutEdge(
        "n1 <- n2",
        "The filter passes messages forward in time and none backward, so a later reading never corrects what was "
        "believed of an earlier place: over a trip of six steps the most probable place is right with probability "
        "0.34, and with 0.46 if all six readings were used for each.",
        ("n2", "n1"),
        the_future,
        bend=-0.55,
    ),
)
"""The edges that the filter cuts."""
