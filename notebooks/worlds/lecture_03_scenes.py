"""The scenes of lecture 03: a belief that is sheared, boxes that move, a bus; and how they are drawn."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from semgrid_edu import fast, plotting
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    BofParams,
    BofState,
    Evidence,
    State,
    VelocityLattice,
    WorldModel,
    bof_predict,
    bof_update,
    smear_area,
)
from worlds.lecture_02_boxes import Box, cells_in, scan_boxes

STEADY = WorldModel(rates=((0.0,) * 4,) * 4, stop_rate=0, max_acceleration=0, walls=None)
"""A world in which things move, and that is all."""

PAPER = WorldModel(walls=None)
"""What BOF assumes, without the package's rules for walls and for places that moving things have left."""

STANDS = (0.952, 0.048, 0.0)
"""First sight in a world in which nothing moves."""

NOTHING_MOVES = WorldModel(
    rates=tuple((*row[:2], 0.0, row[3]) for row in WorldModel.rates), first_sight=STANDS, walls=None
)
"""A world in which things stand, appear, vanish and are forgotten, but never move."""


def unchanging(world: WorldModel) -> WorldModel:
    """Return the same world, in which nothing starts, stops, appears, vanishes or is forgotten."""
    return replace(world, rates=STEADY.rates, stop_rate=0)


BUS = GridSpec(x_min=0, x_max=26, y_min=0, y_max=4, cell=0.5)
"""The cells beside our lane, where a bus passes."""

FLANK = 2.25
"""How far to our left the flank of the bus is, metres: in the middle of a row of cells."""


def bus_at(t: float) -> list[Box]:
    """Return a bus of 12 m that comes at 8 m/s, in the lane to our left, after `t` seconds."""
    return [Box.around(30 - 8 * t, FLANK + 1.25, 12, 2.5, 3)]


def scans_of(
    boxes_at: Callable[[float], list[Box]], spec: GridSpec, times: NDArray, columns: int, field: float = 180
) -> list[Evidence]:
    """Return what each scan of a vehicle that doesn't move tells about the cells.

    Parameters
    ----------
    boxes_at : callable
        Returns the boxes of the world at a time, seconds.
    spec : GridSpec
        The cells.
    times : sequence of float
        Times of the scans, seconds.
    columns, field
        The scanner, as in `scan_boxes`.
    """
    rng = np.random.default_rng(0)
    sensor = WorldModel().sensor
    scans = [scan_boxes(boxes_at(t), columns=columns, rings=16, field=field, noise=0.02, rng=rng) for t in times]
    return [fast.scan_evidence(points, spec, sensor) for points in scans]


@cache
def _bus_scans() -> tuple[NDArray, list[Evidence]]:
    """Return the times of the scans of the bus and what they tell."""
    times = np.arange(29) / 10
    return times, scans_of(bus_at, BUS, times, columns=1000)


def watch(scans: list[Evidence], spec: GridSpec, params: BofParams) -> list[BofState]:
    """Return what BOF believes after each of some scans, a tenth of a second apart."""
    state = BofState.nothing_known(spec, params.lattice)
    states = []
    for scan in scans:
        state = bof_update(bof_predict(state, spec, params, 0.1), spec, scan, params)
        states.append(state)
    return states


def pass_by(first: float = 0.0, world: WorldModel = PAPER) -> tuple[NDArray, NDArray]:
    """Let the bus pass: return the times of the scans (T,) and the four states along its flank, (4, T, H).

    Parameters
    ----------
    first : float
        When the filter is switched on, seconds.
    world : WorldModel
        What the filter assumes.
    """
    times, scans = _bus_scans()
    begin = round(10 * first)
    (_,), (col,), _ = BUS.cells(np.array([[1.0, FLANK]]))
    states = watch(scans[begin:], BUS, BofParams(VelocityLattice(8, spacing=2), world))
    return times[begin:], np.stack([state.probability[:, ::-1, col] for state in states], axis=1)


WALK = np.arange(41) / 10
"""Times of the scans of a walker, seconds."""


def _person(t: float, speed: float, start: float) -> list[Box]:
    """Return a person who walks towards us."""
    return [Box.around(start - speed * t, 0, 0.6, 0.6, 1.7)]


@cache
def _walk_scans(speed: float, start: float, spec: GridSpec) -> list[Evidence]:
    """Return what the scans of a walker tell."""
    return scans_of(lambda t: _person(t, speed, start), spec, WALK, columns=100, field=60)


def walker(
    speed: float, spacing: float, world: WorldModel = PAPER, start: float = 15.2, cell: float = 0.5
) -> NDArray[np.float64]:
    """Return P(DYNAMIC) of a person who walks towards us, after each scan of `WALK`, (41,).

    Parameters
    ----------
    speed : float
        Speed of the person, m/s.
    spacing : float
        Spacing of the velocities of the lattice, which ends at 2 m/s.
    world : WorldModel
        What the filter assumes.
    start : float
        Where the person is at first, metres ahead.
    cell : float
        Side of a cell, metres.
    """
    lane = GridSpec(x_min=4, x_max=18, y_min=-2, y_max=2, cell=cell)
    states = watch(_walk_scans(speed, start, lane), lane, BofParams(VelocityLattice(2, spacing), world))
    told = []
    for t, state in zip(WALK, states, strict=True):
        here = cells_in(_person(t, speed, start)[0], lane, margin=0.5) & (state.occupied.sum(axis=0) > 0.5)
        told.append(state.probability[State.DYNAMIC, here].mean())
    return np.array(told)


def smear_and_found(
    held: NDArray, spec: GridSpec, boxes_at: Callable[[float], list[Box]], scan: int
) -> tuple[float, float, float]:
    """Return three areas, m²: what boxes have left and still seems occupied, what is found of them, and their own.

    Parameters
    ----------
    held : (H, W) float
        P(occupied) after the scan.
    spec : GridSpec
        The cells.
    boxes_at : callable
        Returns the boxes of the world at a time, seconds; all but the first move.
    scan : int
        Number of the scan, from 0; there are ten a second.
    """
    now = boxes_at(scan / 10)
    smear = 0.0
    for box in range(1, len(now)):
        been = np.any([cells_in(boxes_at(t / 10)[box], spec) for t in range(scan + 1)], axis=0)
        smear += smear_area(held, been & ~cells_in(now[box], spec, margin=0.5), spec)
    here = np.any([cells_in(box, spec) for box in now[1:]], axis=0)
    return smear, (here & (held > 0.5)).sum() * spec.cell**2, here.sum() * spec.cell**2


def outline(ax: Axes, boxes: list[Box]) -> list[Line2D]:
    """Draw the outlines of boxes on a map whose axes are y and x, and return them."""
    lines = [ax.plot([], [], color="#d00000", linewidth=1.8)[0] for _ in boxes]
    move_outline(lines, boxes)
    return lines


def move_outline(lines: list[Line2D], boxes: list[Box]) -> None:
    """Move the outlines of `outline` to where the boxes are now."""
    for line, box in zip(lines, boxes, strict=True):
        line.set_data(
            [box.y_min, box.y_max, box.y_max, box.y_min, box.y_min],
            [box.x_min, box.x_min, box.x_max, box.x_max, box.x_min],
        )


def draw_flank(ax: Axes, times: NDArray, states: NDArray, title: str) -> None:
    """Draw the cells along the flank over time: a column per scan, and the front and rear of the bus as lines."""
    picture = plotting.occupancy_colours(states).swapaxes(0, 1)
    extent = (times[0] - 0.05, times[-1] + 0.05, BUS.x_min, BUS.x_max)
    ax.imshow(picture, extent=extent, origin="lower", aspect="auto", interpolation="nearest")
    if times[0] > 0:
        ax.axvspan(0, times[0] - 0.05, facecolor="white", edgecolor="0.75", hatch="///", linewidth=0)
        box = {"facecolor": "white", "linewidth": 0}
        ax.text(times[0] / 2, 2, "not yet on", fontsize=9, ha="center", va="center", bbox=box)
    span = np.array([0, 3])
    for end, style in ((24, "-"), (36, "--")):
        ax.plot(span, end - 8 * span, style, color="#c000c0", linewidth=2)
    ax.set(xlim=(0, 2.85), ylim=(0, 18), yticks=range(0, 19, 3), xlabel="time [s]", facecolor="white")
    ax.set_title(title, fontsize=10)


def draw_flanks(passed: dict[str, tuple[NDArray, NDArray]]) -> None:
    """Draw what `pass_by` returned, by title: panels side by side, with the legend below."""
    from matplotlib import pyplot as plt

    fig, axes = plt.subplots(1, len(passed), figsize=(8.6, 3.5), layout="constrained", sharex=True, sharey=True)
    for ax, (name, run) in zip(axes, passed.items(), strict=True):
        draw_flank(ax, *run, name)
    axes[0].set_ylabel("x, forward [m]")
    flank_legend(fig)


def sheared() -> list[tuple[str, NDArray, int | None]]:
    """Tell how a belief is sheared and picked: (caption, P(velocity, place) of shape (9, 40), cell of the return)."""
    strip = GridSpec(x_min=0, x_max=20, y_min=0, y_max=0.5, cell=0.5)
    fan = VelocityLattice(max_speed=4, spacing=1)
    rows = [fan.velocities.tolist().index([v, 0]) for v in range(-4, 5)]
    params = BofParams(fan, STEADY)
    occupied = np.zeros((len(fan), *strip.shape), np.float32)
    occupied[rows, 19:22] = 1 / 27
    belief = BofState(1 - occupied.sum(axis=0), 0 * occupied[0], occupied, fan.velocities, np.zeros((len(fan), 2)))
    story = [("A   place known, velocity not", belief, None)]
    for names, cell in (("BC", 21), ("DE", 23)):
        belief = bof_predict(belief, strip, params, dt=0.5)
        story.append((f"{names[0]}   half a second later", belief, None))
        hit = (np.arange(40) == cell)[::-1, None]
        scan = Evidence(np.where(hit, 0.8, 0.3).astype(np.float32), np.where(hit, 0.05, 0.7).astype(np.float32))
        belief = bof_update(belief, strip, scan, params)
        story.append((f"{names[1]}   a beam comes back", belief, cell))
    return [(caption, belief.occupied[rows, ::-1, 0], cell) for caption, belief, cell in story]


def draw_sheared(story: list[tuple[str, NDArray, int | None]]) -> None:
    """Draw the story of `sheared` as a strip: the joint distribution, its sum over velocities, and the returns."""
    from matplotlib import pyplot as plt

    fig, axes = plt.subplots(
        2, len(story), figsize=(12.5, 4), layout="constrained", sharex=True, sharey="row", height_ratios=[3, 1.2]
    )
    style = {"cmap": "Blues", "norm": PowerNorm(0.5, 0, 1), "origin": "lower", "extent": (0, 20, -4.5, 4.5)}
    for (top, low), (caption, joint, cell) in zip(axes.T, story, strict=True):
        picture = top.imshow(joint, aspect="auto", **style)
        top.set_title(caption, loc="left", fontsize=10)
        low.bar(np.arange(0.25, 20, 0.5), joint.sum(axis=0), width=0.5, color="tab:blue")
        if cell is not None:
            low.plot(cell / 2 + 0.25, 1.12, "v", color="#c04000", markersize=8)
        low.set(xlabel="place [m]", xlim=(5, 15), xticks=(6, 8, 10, 12, 14))
    axes[0, 0].set(ylabel="velocity [m/s]", yticks=range(-4, 5, 2))
    axes[1, 0].set(ylabel="P(occupied)", ylim=(0, 1.25), yticks=(0, 0.5, 1))
    fig.colorbar(picture, ax=axes, label="probability", ticks=(0, 0.1, 0.3, 1), shrink=0.65)


def flank_legend(fig: Figure) -> None:
    """Add the states' colours and the lines of `draw_flank` below a figure."""
    from matplotlib.patches import Patch

    names = ("free", "STATIC", "DYNAMIC", "unknown")
    colours = plotting.occupancy_colours(np.eye(4)[:, None])[0] / 255
    states = [Patch(facecolor=c, edgecolor="0.6", label=name) for c, name in zip(colours, names, strict=True)]
    ends = [
        Line2D([], [], linestyle=s, color="#c000c0", linewidth=2, label=n) for s, n in (("-", "front"), ("--", "rear"))
    ]
    fig.legend(handles=states + ends, loc="outside lower center", ncols=6, fontsize=9, frameon=False)
