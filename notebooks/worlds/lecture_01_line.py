"""Bayes on a line: a vehicle's position on a ring road as a hidden Markov model (paper, section 3.2).

A filter's beliefs are the messages that run forward in time. Those that run backward carry what later readings
tell about earlier positions: smoothing, another question.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical import Factor, in_rows, sum_product
from worlds.lecture_00_stage_graph import StageGraph, directed


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


def _given(stage: StageGraph, readings: Sequence[int]) -> dict[str, int]:
    return {name: int(reading) for name, reading in zip(stage.observed, readings, strict=True)}
