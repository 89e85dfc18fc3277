"""Bayes on a line: a vehicle's place on a ring road as a hidden Markov model (lecture 01; paper, section 3.2).

A filter is half of message passing on a chain: its beliefs are the messages that run forward in time. The messages
that run backward carry what later readings say about earlier places.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.exact import max_product
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.layout import in_rows
from semgrid_edu.graphical.messages import sum_product
from semgrid_edu.stage_models.stage_graph import StageGraph, cut_edges, directed


def bayes_on_a_line(
    steps: int = 4,
    n_cells: int = 10,
    poles: Sequence[int] = (2, 3, 7),
    moved: Sequence[float] = (0.1, 0.8, 0.1),
    hit: float = 0.8,
    false_alarm: float = 0.1,
) -> StageGraph:
    """Build lecture 01's ring road: places n0, n1, ... one step apart, and what the sensor reads at each.

    Parameters
    ----------
    steps : int
        Number of readings, at least 1; the vehicle moves between them.
    n_cells : int
        Number of cells of the ring; after the last comes cell 0 again.
    poles : sequence of int
        The cells beside which a pole stands.
    moved : sequence of float
        Probability that the vehicle moves by d cells from one reading to the next, for d = 0, 1, 2, ...; sums to 1.
    hit, false_alarm : float
        Probability that the sensor says "pole" beside a pole, and elsewhere.

    Returns
    -------
    StageGraph
        Variables n0, n1, ... with `n_cells` states each, and z0, z1, ...: 0 is "nothing", 1 is "pole".
    """
    if steps < 1:
        raise ArgumentError("steps", "at least 1", steps)
    kernel = np.zeros(n_cells)
    np.add.at(kernel, np.arange(len(moved)) % n_cells, moved)
    move = np.array([np.roll(kernel, n) for n in range(n_cells)])
    says_pole = np.where(np.isin(np.arange(n_cells), poles), hit, false_alarm)
    read = np.stack([1 - says_pole, says_pole], axis=1)
    factors = [Factor("n0", np.full(n_cells, 1 / n_cells))]
    factors += [Factor((f"n{t - 1}", f"n{t}"), move) for t in range(1, steps)]
    factors += [Factor((f"n{t}", f"z{t}"), read) for t in range(steps)]
    places, readings = ([f"{letter}{t}" for t in range(steps)] for letter in "nz")
    return StageGraph(
        "Bayes on a line",
        directed(factors),
        observed=tuple(readings),
        positions=in_rows(places, readings),
        equations={places[-1]: "place", readings[-1]: "reading"},
        cut=cut_edges("line"),
    )


def filtered(stage: StageGraph, readings: Sequence[int]) -> NDArray[np.float64]:
    """Return the filter's beliefs: the messages of sum-product that run forward along the chain.

    The message from n_t to P(n_{t+1} | n_t) is P(n_t | z_0 ... z_t), lecture 01's posterior at step t.

    Parameters
    ----------
    stage : StageGraph
        A graph from `bayes_on_a_line`.
    readings : (T,) int
        What the sensor said at each step: 0 for "nothing", 1 for "pole".

    Returns
    -------
    (T, N) float64
        One belief per step.
    """
    beliefs = sum_product(stage.model, _given(stage, readings))
    last = len(readings) - 1
    passed = [beliefs.messages[f"n{t}", f"P(n{t + 1} | n{t})"] for t in range(last)]
    return np.array([*passed, beliefs.marginals[f"n{last}"]])


def smoothed(stage: StageGraph, readings: Sequence[int]) -> NDArray[np.float64]:
    """Return P(n_t | all readings) for each step, (T, N): the product of forward and backward messages.

    Parameters are those of `filtered`.
    """
    marginals = sum_product(stage.model, _given(stage, readings)).marginals
    return np.array([marginals[f"n{t}"] for t in range(len(readings))])


def most_likely_path(stage: StageGraph, readings: Sequence[int]) -> list[int]:
    """Return the most likely sequence of places, one cell per step, given all readings (Viterbi).

    Parameters are those of `filtered`.
    """
    best = max_product(stage.model, _given(stage, readings))
    return [best[f"n{t}"] for t in range(len(readings))]


def _given(stage: StageGraph, readings: Sequence[int]) -> dict[str, int]:
    if len(readings) != len(stage.observed):
        raise ArgumentError("readings", f"one per step, {len(stage.observed)}", len(readings))
    return {name: int(says) for name, says in zip(stage.observed, readings, strict=True)}
