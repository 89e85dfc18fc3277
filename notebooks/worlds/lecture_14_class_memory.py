"""The class of one cell over time: the value of earlier images when a network repeats its errors (section 3).

The paper forgets classes at every frame. Here they are remembered, exactly, for one cell of the toy street. Its content
changes by the filter's own rates, so a parked car stays, a moving one takes its class along, and new contents have the
street's shares. Each frame has a scan and a class that the network names. Beside them runs a chain of errors: what made
the network wrong at one frame is mostly still there at the next.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from semgrid_edu.graphical import Factor, eliminate, in_rows
from semgrid_edu.occupancy import State
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, directed
from worlds.lecture_00_street import CLASS_OF, CLASSES, STATE_OF, STREET, SystemWorld


class StillStreet(SystemWorld):
    """A street on which nothing changes."""

    def change(self) -> NDArray[np.float64]:
        """Return P(content now | content before), (5, 5): the content stays."""
        return np.eye(len(STREET))


@dataclass(frozen=True)
class MemoryWorld:
    """One cell that a LIDAR and a camera observe repeatedly.

    Parameters
    ----------
    steps : int
        Number of frames, 1 to 5.
    repeats : float
        Probability that the network does at a frame what it did at the one before: that it is wrong again in the same
        way, or right again. With 0 the frames are independent witnesses, with 1 all are alike.
    street : SystemWorld
        The rates at which contents change, the time between frames, and how often the network is right, all frames
        together: `change`, `dt` and `pixel_right`. `p_hit_occupied` and `p_hit_free` of its scanner say how often a
        beam stops in the cell.
    """

    steps: int = 3
    repeats: float = 0.6
    street: SystemWorld = field(default_factory=SystemWorld)

    def errors(self) -> NDArray[np.float64]:
        """Return P(e): the network names what it sees (0), or class k whatever it sees (1 + k)."""
        each = (1 - self.street.pixel_right) / (len(CLASSES) - 1)
        return np.array([1 - len(CLASSES) * each, *[each] * len(CLASSES)])

    def errs_again(self) -> NDArray[np.float64]:
        """Return P(e now | e before): the same as before, or a new draw from P(e)."""
        fresh = np.tile(self.errors(), (len(CLASSES) + 1, 1))
        return self.repeats * np.eye(len(fresh)) + (1 - self.repeats) * fresh

    def named(self) -> NDArray[np.float64]:
        """Return P(class named | content, e), (5, 5, 4): zeros and ones."""
        fixed = np.broadcast_to(np.eye(len(CLASSES)), (len(STREET), len(CLASSES), len(CLASSES)))
        return np.concatenate([CLASS_OF[:, None], fixed], axis=1)

    def returned(self) -> NDArray[np.float64]:
        """Return P(beam goes on, or stops in the cell | content), (5, 2)."""
        sensor = self.street.params.sensor
        stops = np.where(STATE_OF == State.FREE, sensor.p_hit_free, sensor.p_hit_occupied)
        return np.stack([1 - stops, stops], axis=1)


def class_over_time(world: MemoryWorld | None = None) -> StageGraph:
    """Build the chain of a cell's content, the chain of the network's errors, and what is observed of both.

    Variables for t = 0, 1, ...: m t (5 contents), e t (`MemoryWorld.errors`), z t (the class that the network names)
    and l t (whether a beam stops in the cell).
    """
    world = world or MemoryWorld()
    factors = []
    for t in range(world.steps):
        m = f"m{t}"
        e = f"e{t}"
        factors += [
            Factor((f"m{t - 1}", m), world.street.change()) if t else Factor(m, STREET),
            Factor((f"e{t - 1}", e), world.errs_again()) if t else Factor(e, world.errors()),
            Factor((m, e, f"z{t}"), world.named()),
            Factor((m, f"l{t}"), world.returned()),
        ]
    rows = {name: [f"{name}{t}" for t in range(world.steps)] for name in "lmze"}
    last = world.steps - 1
    return StageGraph(
        "The class of one cell",
        directed(factors),
        positions=in_rows(*rows.values()),
        observed=(*rows["l"], *rows["z"]),
        equations={f"l{last}": "scan", f"m{last}": "content", f"z{last}": "class named", f"e{last}": "error"},
        plates={"cells": tuple(name for row in rows.values() for name in row)},
        cut=CUT,
    )


def readings(named: Sequence[int], stopped: Sequence[int]) -> dict[str, int]:
    """Return what is observed of a cell, by variable.

    `named` is the class that the network names at each frame, `stopped` whether a beam stops in the cell.
    """
    observed = {f"z{t}": int(value) for t, value in enumerate(named)}
    return observed | {f"l{t}": int(value) for t, value in enumerate(stopped)}


def exact_classes(world: MemoryWorld, named: Sequence[int], stopped: Sequence[int]) -> NDArray[np.float64]:
    """Return P(class at each frame | frames up to it) by elimination, (T, 4)."""
    model = class_over_time(world).model
    known = readings(named, stopped)
    beliefs = []
    for t in range(world.steps):
        given = {name: known[name] for k in range(t + 1) for name in (f"z{k}", f"l{k}")}
        beliefs.append(eliminate(model, f"m{t}", given).normalised().table @ CLASS_OF)
    return np.array(beliefs)


def factored_classes(
    world: MemoryWorld, named: NDArray, stopped: NDArray, exponent: float = 1.0, memory: bool = True
) -> NDArray[np.float64]:
    """Filter the class as a real system can afford to: one belief per cell, without the chain of errors.

    Each frame multiplies the belief by P(l | content) P(z | content)^w. With w below 1, several frames together count
    for less than as many independent ones, because they share errors.

    Parameters
    ----------
    world : MemoryWorld
        The cell and its sensors.
    named, stopped : (..., T) int
        What is observed at each frame, for any number of sequences.
    exponent : float
        w, what one frame is worth beside the others.
    memory : bool
        Whether the earlier images count. Without, only the scans are remembered, as in the paper.

    Returns
    -------
    (..., 4) float64
        P(class) at the last frame.
    """
    named = np.asarray(named)
    stopped = np.asarray(stopped)
    image = np.einsum("e,mek->km", world.errors(), world.named())  # one frame by itself
    beam = world.returned().T
    change = world.street.change()
    belief = np.broadcast_to(np.array(STREET), (*named.shape[:-1], len(STREET)))
    last = named.shape[-1] - 1
    for t in range(last + 1):
        belief = belief @ change if t else belief
        weight = exponent if memory or t == last else 0.0
        belief = belief * beam[stopped[..., t]] * image[named[..., t]] ** weight
        belief = belief / belief.sum(axis=-1, keepdims=True)
    return belief @ CLASS_OF


class MemoryPrice(NamedTuple):
    """Mean of -log P(true class) at the last frame, in nats, from the least information to the most.

    Parameters
    ----------
    forgotten : float
        All scans, but the last image alone: the paper.
    independent : float
        Every image as a witness of its own, exponent 1.
    weighted : float
        The same with the best exponent, one for all frames.
    exact : float
        The exact posterior, which keeps the chain of errors.
    exponent : float
        That best exponent.
    """

    forgotten: float
    independent: float
    weighted: float
    exact: float
    exponent: float


def memory_price(world: MemoryWorld | None = None) -> MemoryPrice:
    """Measure what memory gains and what the factored filter loses, by exact sums over everything that may be seen."""
    world = world or MemoryWorld()
    joint, named, stopped = _all_readings(world)

    def loss(exponent: float, memory: bool = True) -> float:
        return _log_loss(joint, factored_classes(world, named, stopped, exponent, memory))

    best = float(minimize_scalar(loss, bounds=(0, 1.5), method="bounded", options={"xatol": 1e-5}).x)
    possible = joint[joint.sum(axis=-1) > 0]
    exact = _log_loss(possible, possible / possible.sum(axis=-1, keepdims=True))
    return MemoryPrice(loss(1.0, memory=False), loss(1.0), loss(best), exact, best)


def loss_by_exponent(world: MemoryWorld, exponents: Sequence[float]) -> list[float]:
    """Return the mean of -log P(true class) at the last frame for each exponent, nats, by exact sums."""
    joint, *seen = _all_readings(world)
    return [_log_loss(joint, factored_classes(world, *seen, exponent)) for exponent in exponents]


def frames_worth(frames: int, repeats: float) -> float:
    """Return the number of independent frames that are worth as much as these, whose errors are correlated.

    For Gaussian errors with the correlation r = `repeats` from each frame to the next, an autoregressive series, the
    textbook's answer is 1 + (T - 1) (1 - r) / (1 + r). Each of T frames then has the exponent worth / T.

    Examples
    --------
    >>> frames_worth(3, 0.0), frames_worth(3, 0.6), frames_worth(3, 1.0)
    (3.0, 1.5, 1.0)
    """
    return 1 + (frames - 1) * (1 - repeats) / (1 + repeats)


def _all_readings(world: MemoryWorld) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return P(class at the last frame, readings) for every sequence, (N, 4), and the sequences, twice (N, T)."""
    times = range(world.steps)
    names = (*(f"z{t}" for t in times), *(f"l{t}" for t in times))
    table = eliminate(class_over_time(world).model, (*names, f"m{world.steps - 1}")).table
    sequences = np.array(list(np.ndindex(table.shape[:-1])))
    return table.reshape(-1, len(STREET)) @ CLASS_OF, *np.split(sequences, 2, axis=1)


def _log_loss(joint: NDArray, belief: NDArray) -> float:
    """Return the mean of -log belief under the joint distribution of class and readings, nats."""
    return float(-(joint * np.log(np.where(joint > 0, belief, 1))).sum())


@cache
def errors_by_themselves() -> Price:
    """How well a cell's class is known after three frames that err together."""
    price = memory_price()
    return Price(price.exact, price.weighted, "nats: class of a cell, three frames")


CUT = (
    CutEdge(
        "e1 -> e2",
        "The filter keeps no error from frame to frame, so frames that err together count as if each were right or "
        "wrong by itself. An exponent below 1 makes up for part of it: after three frames the class of a cell still "
        "costs 0.38 nats, and 0.34 if the errors were followed.",
        ("e1", "e2"),
        errors_by_themselves,
        bend=-0.7,
    ),
)
"""The edge that the memory of classes cuts."""
