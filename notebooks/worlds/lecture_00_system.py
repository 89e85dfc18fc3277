"""The whole system as a graph, from the world to the semantic grid, and the edges that the paper cuts (figure 2).

The drawing shows the world above the sensors, and the paper's computation below them: l -> o, i -> s -> p, (p, o) -> g.
Information flows down, never up, and from one instant to the next only inside o.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical import Factor, GraphicalModel, eliminate
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, directed
from worlds.lecture_00_street import CLASS_OF, STATE_OF, STREET, SystemWorld


def whole_system(world: SystemWorld | None = None) -> StageGraph:
    """Build the directed model of the toy street, its sensors, and the paper's chain up to the semantic grid.

    Variables for t = 0, 1, ...: near t and far t (5 contents), l t (a return from near, from far, or none), i t (4
    classes), o t (one state per sequence of scans, which represents what the filter then believes), s t and p t (4
    classes, as i), and g t (16 states: 4 times the label of near, plus the label of far).
    """
    world = world or SystemWorld()
    factors = list(street(world).factors)
    for t in range(world.steps):
        o = f"o{t}"
        s = f"s{t}"
        p = f"p{t}"
        g = f"g{t}"
        history = (f"o{t - 1}",) * (t > 0)
        n = 3 ** (t + 1)
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
        positions=_positions(world.steps),
        observed=tuple(f"{sensor}{t}" for t in range(world.steps) for sensor in "li"),
        labels=_node_labels(world.steps),
        equations=_words(world.steps),
        cut=CUT,
    )


def street(world: SystemWorld) -> GraphicalModel:
    """Build the generative part alone: the cells at each instant (near t, far t), and the readings l t and i t."""
    factors = []
    for t in range(world.steps):
        cells = f"near{t}", f"far{t}"
        for cell, before in zip(cells, (f"near{t - 1}", f"far{t - 1}"), strict=True):
            factors.append(Factor((before, cell), world.change()) if t else Factor(cell, STREET))
        factors += [Factor((*cells, f"l{t}"), world.scan()), Factor((*cells, f"i{t}"), world.image())]
    return directed(factors)


def class_and_sensors(world: SystemWorld, t: int) -> NDArray[np.float64]:
    """Return the joint distribution of a cell's class at instant t and all readings so far.

    (2, 4, 3^(t+1), 4^(t+1)): near and far cell; class; sequence of scans; sequence of images. In a sequence, the last
    reading changes fastest.
    """
    model = street(world)
    instants = range(t + 1)
    readings = *(f"l{k}" for k in instants), *(f"i{k}" for k in instants)
    tables = [eliminate(model, (f"{cell}{t}", *readings)).table for cell in ("near", "far")]
    return np.array([CLASS_OF.T @ table.reshape(5, -1) for table in tables]).reshape(2, 4, 3 ** (t + 1), -1)


def same_belief(o: NDArray) -> NDArray[np.int64]:
    """Assign numbers to N sequences of scans; two that lead to the same belief o get the same number."""
    return np.unique(o.reshape(len(o), -1).round(6), axis=0, return_inverse=True)[1].reshape(-1)


def _labels(world: SystemWorld, t: int) -> NDArray[np.float64]:
    """Return P(g | o, p): the best label of each cell, given its part of o and the pixel's predicted class."""
    joint = class_and_sensors(world, t)
    o = world.occupancy()[t]
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


@cache
def image_for_the_filter() -> Price:
    """How well the state of the near cell is known, with and without the present image."""
    states = np.eye(3)[STATE_OF].T
    with_image = _entropy(states, ("near1",), ("l0", "l1", "i1"))
    scans = _entropy(states, ("near1",), ("l0", "l1"))
    return Price(with_image, scans, "nats: state of the near cell")


@cache
def depth_for_the_image() -> Price:
    """How well the class that the pixel sees is known, with and without the present scan."""
    seen = SystemWorld().sees().reshape(25, 4).T
    with_scan = _entropy(seen, ("near1", "far1"), ("i1", "l1"))
    image = _entropy(seen, ("near1", "far1"), ("i1",))
    return Price(with_scan, image, "nats: class that the pixel sees")


def _entropy(of: NDArray, cells: tuple[str, ...], given: tuple[str, ...]) -> float:
    """Return the mean of -log P(something | readings), nats; P(something | contents of cells) is `of`."""
    joint = of @ eliminate(street(SystemWorld()), (*cells, *given)).table.reshape(of.shape[1], -1)
    return float(-(joint * np.log(np.where(joint > 0, joint / joint.sum(axis=0), 1))).sum())


@cache
def forgotten_class() -> Price:
    """How well the class of the far cell is known, with and without the earlier image."""
    both_images = _entropy(CLASS_OF.T, ("far1",), ("l0", "l1", "i0", "i1"))
    last_image = _entropy(CLASS_OF.T, ("far1",), ("l0", "l1", "i1"))
    return Price(both_images, last_image, "nats: class of the far cell")


CUT = (
    CutEdge(
        "i1 -> o1",
        "The occupancy filter never sees the image, so what the camera recognises can't help it to tell standing from "
        "moving things, or a grazing return from an obstacle: on the toy street the state of the near cell costs 0.48 "
        "nats, and 0.40 with the image.",
        ("i1", "o1"),
        image_for_the_filter,
        at=0.76,
    ),
    CutEdge(
        "l1 -> s1",
        "The segmentation network gets the image alone, so measured depth can't help it where an image is ambiguous: "
        "the class that the toy street's pixel sees costs 0.68 nats, and 0.53 with the scan.",
        ("l1", "s1"),
        depth_for_the_image,
        at=0.66,
    ),
    CutEdge(
        "s1 -> p1, the distance",
        "A pixel's scores are sampled into every cell in which its ray crosses a plane, although the camera saw only "
        "one of them, and the fusion has to find out from o which one.",
        ("s1", "p1"),
        bend=-0.45,
    ),
    CutEdge(
        "near1 - far1 in o1",
        "o holds one distribution per cell, so it can't represent that one of two cells explains a return. On the toy "
        "street a fusion that sees o in both cells loses nothing by that, because o tells all sequences of scans "
        "apart.",
        ("near1", "far1"),
    ),
    CutEdge(
        "g0 -> g1",
        "Only o remembers, because classes aren't carried from frame to frame, so a class that an earlier image "
        "showed is forgotten. On the toy street that costs 0.05 nats in the near cell and 0.10 in the far one, where "
        "0.62 nats become 0.72. The stage `remember` pays it back (lecture 14).",
        ("g0", "g1"),
        forgotten_class,
    ),
    CutEdge(
        "g0 -> o1",
        "Nothing goes back from the semantic grid to the filter, whose rates are the same for a building and for a "
        "parked car.",
        ("g0", "o1"),
        bend=-0.05,
    ),
)
"""The edges that the system cuts."""
