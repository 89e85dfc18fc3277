"""The scenes of lecture 03: a belief that is sheared, boxes that move, a bus; and how they are drawn."""

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semgrid_edu import fast, plotting
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import BofParams, BofState, Evidence, VelocityLattice, WorldModel, bof_predict, bof_update
from worlds.lecture_02_boxes import Box, scan_boxes

STEADY = WorldModel(rates=((0.0,) * 4,) * 4, stop_rate=0, max_acceleration=0, walls=None)
"""A world in which things move, and that is all."""

BUS = GridSpec(x_min=0, x_max=26, y_min=0, y_max=4, cell=0.5)
"""The cells beside our lane, where a bus passes."""

FLANK = 2.25
"""How far to our left the flank of the bus is, metres: in the middle of a row of cells."""


def bus_at(t: float) -> list[Box]:
    """Return a bus of 12 m that comes at 8 m/s, in the lane to our left, after `t` seconds."""
    return [Box.around(30 - 8 * t, FLANK + 1.25, 12, 2.5, 3)]


def watch(
    boxes_at: Callable[[float], list[Box]], spec: GridSpec, params: BofParams, times: NDArray,
    columns: int = 300, field: float = 180,
) -> list[BofState]:  # fmt: skip
    """Return what BOF believes after each scan of a vehicle that doesn't move.

    Parameters
    ----------
    boxes_at : callable
        Returns the boxes of the world at a time, seconds.
    spec : GridSpec
        The cells.
    params : BofParams
        The lattice, and how the world changes.
    times : sequence of float
        Times of the scans, seconds, evenly spaced.
    columns, field
        The scanner, as in `scan_boxes`.
    """
    rng, dt = np.random.default_rng(0), times[1] - times[0]
    state, states = BofState.nothing_known(spec, params.lattice), []
    for t in times:
        points = scan_boxes(boxes_at(t), columns=columns, rings=16, field=field, noise=0.02, rng=rng)
        state = bof_predict(state, spec, params, dt)
        state = bof_update(state, spec, fast.scan_evidence(points, spec, params.world.sensor), params)
        states.append(state)
    return states


def pass_by(
    columns: int, first: float = 0.0, first_sight: tuple[float, float, float] = WorldModel.first_sight
) -> tuple[NDArray, NDArray]:
    """Let the bus pass: return the times of the scans (T,) and the four states along its flank, (4, T, H).

    Parameters
    ----------
    columns : int
        Directions of the scanner in its half circle.
    first : float
        When the filter is switched on, seconds.
    first_sight : (float, float, float)
        Probabilities of FREE, STATIC and DYNAMIC when a cell is first seen.
    """
    times = np.arange(round(10 * first), 29) / 10
    params = BofParams(VelocityLattice(8, spacing=2), WorldModel(first_sight=first_sight))
    states = watch(bus_at, BUS, params, times, columns)
    _, (col,), _ = BUS.cells(np.array([[1.0, FLANK]]))
    return times, np.stack([state.probability[:, ::-1, col] for state in states], axis=1)


def draw_flank(ax: Axes, times: NDArray, states: NDArray, title: str) -> None:
    """Draw the cells along the flank over time: a row per scan, and the front and rear of the bus as lines."""
    picture = plotting.occupancy_colours(states)
    extent = (BUS.x_min, BUS.x_max, times[0] - 0.05, times[-1] + 0.05)
    ax.imshow(picture, extent=extent, origin="lower", aspect="auto", interpolation="nearest")
    span = np.array([0, 3])
    for end, style in ((24, "-"), (36, "--")):
        ax.plot(end - 8 * span, span, style, color="tab:red", linewidth=1.5)
    ax.set(xlim=(0, 18), ylim=(0, 2.85), xlabel="x, forward [m]", facecolor="white")
    ax.set_title(title, fontsize=10)


def sheared() -> list[tuple[str, NDArray, int | None]]:
    """Tell how a belief is sheared and picked: (caption, P(velocity, place) of shape (9, 40), cell of the return)."""
    strip, fan = GridSpec(x_min=0, x_max=20, y_min=0, y_max=0.5, cell=0.5), VelocityLattice(max_speed=4, spacing=1)
    rows, params = [fan.velocities.tolist().index([v, 0]) for v in range(-4, 5)], BofParams(fan, STEADY)
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


def sheared_frames(story: list[tuple[str, NDArray, int | None]]) -> Iterator[Figure]:
    """Draw the story of `sheared`: the joint distribution, its sum over velocities, and the return."""
    from matplotlib import pyplot as plt

    fig, (top, low) = plt.subplots(2, 1, figsize=(6.6, 3.9), layout="constrained", sharex=True, height_ratios=[3, 1.2])
    style = {"cmap": "Blues", "norm": PowerNorm(0.5, 0, 1), "origin": "lower", "extent": (0, 20, -4.5, 4.5)}
    picture = top.imshow(np.zeros((9, 40)), aspect="auto", **style)
    top.set(ylabel="velocity [m/s]", yticks=range(-4, 5, 2))
    low.set(xlabel="place [m]", ylabel="P(occupied)", ylim=(0, 1.25), yticks=(0, 0.5, 1))
    fig.colorbar(picture, ax=(top, low), label="probability", ticks=(0, 0.1, 0.3, 1), shrink=0.65, anchor=(0, 1))
    bars = low.bar(np.arange(0.25, 20, 0.5), np.zeros(40), width=0.5, color="tab:blue")
    (arrow,) = low.plot([], [], "v", color="#c04000", markersize=9)
    for caption, joint, cell in story:
        picture.set_data(joint)
        for bar, height in zip(bars, joint.sum(axis=0), strict=True):
            bar.set_height(height)
        arrow.set_data(*(([], []) if cell is None else ([cell / 2 + 0.25], [1.12])))
        top.set_title(caption, loc="left", fontsize=11)
        yield fig
        fig.set_layout_engine("none")  # only the first frame is laid out


def flank_legend(fig: Figure) -> None:
    """Add the states' colours and the lines of `draw_flank` below a figure."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    names = ("free", "STATIC", "DYNAMIC", "unknown")
    colours = plotting.occupancy_colours(np.eye(4)[:, None])[0] / 255
    states = [Patch(facecolor=c, edgecolor="0.6", label=name) for c, name in zip(colours, names, strict=True)]
    ends = [Line2D([], [], linestyle=s, color="tab:red", label=n) for s, n in (("-", "front"), ("--", "rear"))]
    fig.legend(handles=states + ends, loc="outside lower center", ncols=6, fontsize=9, frameon=False)
