"""The whole system as a graph, and what joint inference would gain over passing marginals forward (paper, figure 2).

In the drawing, the world stands above the sensors, and what the paper computes below them: l -> o, i -> s -> p,
(p, o) -> g. Information flows down, never up, and from one instant to the next only inside o.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical.exact import eliminate
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.stage_models.stage_graph import StageGraph, cut_edges, directed
from semgrid_edu.stage_models.system_world import CLASS_OF, STATE_OF, STREET, SystemWorld


def whole_system(world: SystemWorld | None = None) -> StageGraph:
    """Build the directed model of the toy street, its sensors, and the paper's chain up to the semantic grid.

    Parameters
    ----------
    world : SystemWorld, optional
        The toy street and its sensors; the defaults, with two instants, when left out.

    Returns
    -------
    StageGraph
        Variables for t = 0, 1, ...: near t and far t (5 contents), l t (a return from near, from far, or none), i t (4
        classes), o t (one state per sequence of scans, which stands for what the filter then believes), s t and p t (4
        classes, as i), and g t (16 states: 4 times the label of near, plus the label of far).
    """
    world = world or SystemWorld()
    factors = list(street(world).factors)
    for t in range(world.steps):
        o, s, p, g = f"o{t}", f"s{t}", f"p{t}", f"g{t}"
        history, n = (f"o{t - 1}",) * (t > 0), 3 ** (t + 1)
        remember = np.eye(n).reshape(*[n // 3] * (t > 0), 3, n)
        factors += [
            Factor((*history, f"l{t}", o), remember),
            Factor((f"i{t}", s), np.eye(4)),
            Factor((s, p), np.eye(4)),
            Factor((o, p, g), _labels(world, t)),
        ]
    return StageGraph(
        "The whole system",
        directed(factors),
        observed=tuple(f"{sensor}{t}" for t in range(world.steps) for sensor in "li"),
        positions=_positions(world.steps),
        labels=_node_labels(world.steps),
        equations=_words(world.steps),
        cut=cut_edges("system"),
    )


def street(world: SystemWorld) -> GraphicalModel:
    """Build the generative part alone: the cells at each instant, and the scan and the image that they cause.

    Parameters
    ----------
    world : SystemWorld
        The toy street and its sensors.

    Returns
    -------
    GraphicalModel
        A directed model with the variables near t, far t, l t and i t.
    """
    factors = []
    for t in range(world.steps):
        cells = f"near{t}", f"far{t}"
        for cell, before in zip(cells, (f"near{t - 1}", f"far{t - 1}"), strict=True):
            factors.append(Factor((before, cell), world.change()) if t else Factor(cell, STREET))
        factors += [Factor((*cells, f"l{t}"), world.scan()), Factor((*cells, f"i{t}"), world.image())]
    return directed(factors)


def class_and_sensors(world: SystemWorld, t: int) -> NDArray[np.float64]:
    """Return the joint distribution of a cell's class now and of all readings up to now.

    Parameters
    ----------
    world : SystemWorld
        The toy street and its sensors.
    t : int
        The instant that is now, from 0.

    Returns
    -------
    (2, 4, 3^(t+1), 4^(t+1)) float64
        Axes: near and far cell; class; sequence of scans; sequence of images. In a sequence, the last reading changes
        fastest.
    """
    model, instants = street(world), range(t + 1)
    readings = *(f"l{k}" for k in instants), *(f"i{k}" for k in instants)
    tables = [eliminate(model, (f"{cell}{t}", *readings)).table for cell in ("near", "far")]
    return np.array([CLASS_OF.T @ table.reshape(5, -1) for table in tables]).reshape(2, 4, 3 ** (t + 1), -1)


def same_belief(o: NDArray) -> NDArray[np.int64]:
    """Give each sequence of scans a number; two get the same when the filter believes the same after both.

    Parameters
    ----------
    o : (N, ...) float
        What the filter believes after each of N sequences.

    Returns
    -------
    (N,) int
        The number of each sequence, from 0.
    """
    return np.unique(o.reshape(len(o), -1).round(6), axis=0, return_inverse=True)[1].reshape(-1)


def _labels(world: SystemWorld, t: int) -> NDArray[np.float64]:
    """Return P(g | o, p): the best label of each cell, given its own column of o and the class that the pixel names."""
    joint, o = class_and_sensors(world, t), world.occupancy()[t]
    now = joint.reshape(2, 4, len(o), -1, 4).sum(axis=3)
    best = []
    for cell in (0, 1):
        group = same_belief(o[:, cell])
        pooled = np.stack([now[cell][:, group == number].sum(axis=1) for number in group], axis=1)
        best.append(pooled.argmax(axis=0))
    return np.eye(16)[4 * best[0] + best[1]]


def _positions(steps: int) -> dict[str, tuple[float, float]]:
    slots = {
        "near": (0.0, 1.0),
        "far": (2.6, 0.0),
        "i": (0.0, -1.2),
        "l": (2.6, -1.2),
        "s": (0.0, -2.4),
        "p": (0.0, -3.5),
        "o": (2.6, -2.9),
        "g": (1.3, -4.6),
    }
    return {f"{name}{t}": (x + 4.6 * t, y) for t in range(steps) for name, (x, y) in slots.items()}


def _node_labels(steps: int) -> dict[str, str]:
    symbols = {"near": "m", "far": "m'"} | {name: name for name in "liospg"}
    times = ["t" if t == steps - 1 else f"t-{steps - 1 - t}" for t in range(steps)]
    return {f"{name}{t}": f"${symbol}_{{{times[t]}}}$" for t in range(steps) for name, symbol in symbols.items()}


def _words(steps: int) -> dict[str, str]:
    words = {
        "near": "near cell",
        "far": "far cell",
        "l": "LIDAR",
        "i": "image",
        "o": "occupancy",
        "s": "scores",
        "p": "planes",
        "g": "semantic grid",
    }
    return {f"{name}{0 if name in 'isp' else steps - 1}": text for name, text in words.items()}


class Score(NamedTuple):
    """How well the class of each cell is known, on average over everything that street and sensors may do.

    Parameters
    ----------
    log_loss : (2,) float64
        Mean of -log P(true class) of the near and the far cell, nats.
    right : (2,) float64
        Share of cases in which the most probable class is the true one.
    """

    log_loss: NDArray[np.float64]
    right: NDArray[np.float64]


class SystemGain(NamedTuple):
    """How well the class of a cell is known at the last instant, from the least information to the most.

    Parameters
    ----------
    image : Score
        The best that can be made of the scores s alone.
    multiplied : Score
        The product of s and o in each cell, as if they were independent given the class: nothing is learned.
    cell_by_cell : Score
        The best function of s and of the cell's own state probabilities in o: what a perfectly trained fusion that
        doesn't look at neighbours would give.
    neighbours : Score
        The best function of s and of o in both cells: what a perfectly trained fusion that sees the whole grid would
        give.
    scans : Score
        The exact posterior given all scans and the last image: as if the filter had kept everything.
    joint : Score
        The exact posterior given all scans and all images.
    """

    image: Score
    multiplied: Score
    cell_by_cell: Score
    neighbours: Score
    scans: Score
    joint: Score


def system_gain(world: SystemWorld | None = None) -> SystemGain:
    """Measure what is lost on the way from the sensors to the semantic grid, by exact sums over all readings.

    With the defaults, the paper's chain, trained perfectly (`cell_by_cell`), has a log loss of 0.743 nats for the near
    cell and 0.720 for the far one, and is right in 69.9 and 72.6 % of the cases. Joint inference has 0.682 and 0.618
    nats, and is right in 71.3 and 76.0 %. Most of this gain comes from the earlier image: with one instant (`steps=1`),
    joint inference equals `neighbours`. o itself loses nothing here (`neighbours` equals `scans`), because its values
    tell all nine sequences of scans apart. Multiplying s and o as if they were independent gives 1.201 and 1.059 nats,
    which is worse than s alone, with 1.008 and 0.938.

    Parameters
    ----------
    world : SystemWorld, optional
        The toy street and its sensors; the defaults, with two instants, when left out.
    """
    world = world or SystemWorld()
    joint = class_and_sensors(world, world.steps - 1)
    o = world.occupancy()[-1]
    n_scans, n_images = joint.shape[2:]
    scans, images = np.divmod(np.arange(n_scans * n_images), n_images)
    s = images % 4
    flat = joint.reshape(2, 4, -1)
    each, both = [same_belief(o[:, cell])[scans] for cell in (0, 1)], same_belief(o)[scans]
    return SystemGain(
        image=_best(flat, [s, s]),
        multiplied=_score(flat, _multiplied(world, o)[:, :, scans, s]),
        cell_by_cell=_best(flat, [4 * each[0] + s, 4 * each[1] + s]),
        neighbours=_best(flat, [4 * both + s] * 2),
        scans=_best(flat, [4 * scans + s] * 2),
        joint=_best(flat, [np.arange(flat.shape[2])] * 2),
    )


def _best(joint: NDArray, keys: list[NDArray]) -> Score:
    """Score P(class | key), the best rule when nothing but a key of the readings is known."""
    rules = []
    for cell, key in zip(joint, keys, strict=True):
        pooled = np.stack([np.bincount(key, weights) for weights in cell])[:, key]
        rules.append(pooled / pooled.sum(axis=0))
    return _score(joint, np.array(rules))


def _score(joint: NDArray, rule: NDArray) -> Score:
    """Score a rule P(class | readings), (2, 4, N), under the joint distribution of class and readings."""
    surprise = -np.log(np.where(joint > 0, rule, 1))
    chosen = np.take_along_axis(joint, rule.argmax(axis=1)[:, None], axis=1)
    return Score((joint * surprise).sum(axis=(1, 2)), chosen.sum(axis=(1, 2)))


def _multiplied(world: SystemWorld, o: NDArray) -> NDArray[np.float64]:
    """Return P(class | o) P(class | s) / P(class) of each cell, normalised; (2, 4, sequences of scans, 4)."""
    model, t = street(world), world.steps - 1
    cells = eliminate(model, (f"near{t}", f"far{t}")).table
    seen = np.einsum("nf,nfc->c", cells, world.sees())
    s = seen[:, None] * world.confusion()
    s /= s.sum(axis=0)
    rules = []
    for cell, content in enumerate((cells.sum(axis=1), cells.sum(axis=0))):
        prior = content @ CLASS_OF
        in_state = content * (np.arange(3)[:, None] == STATE_OF) @ CLASS_OF
        by_state = np.vstack([in_state / in_state.sum(axis=1, keepdims=True), prior])
        product = (o[:, cell] @ by_state).T[:, :, None] * (s / prior[:, None])[:, None, :]
        rules.append(product / product.sum(axis=0))
    return np.array(rules)
