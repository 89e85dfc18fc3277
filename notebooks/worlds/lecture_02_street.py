"""The street of lecture 02: maps of P(occupied) over a drive, their ghosts, and how they are drawn."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from semgrid_edu import plotting
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.occupancy import LogOddsGrid, LogOddsParams, PlanarMotion, Sensor, State, scan_evidence
from semgrid_edu.plotting.colours import STATE_COLOURS, colour_legend

GHOST = (225, 20, 30)
"""The colour of a ghost: occupied in the map, although the road there is empty."""

UNJUDGED = (245, 160, 190)
"""The colour of cells that only the map calls occupied and that have no label: smear, or the body of a car."""

HIDDEN, WAITING = (130, 0, 60), (250, 150, 30)
"""The colours of ghosts without a pass since the last return, and of those with some."""

ROAD, SIDEWALK, VEGETATION = (KITTI_14.index(name) for name in ("road", "sidewalk", "vegetation"))


def things(truth: NDArray) -> NDArray[np.bool_]:
    """Return which cells of a map of classes are labelled, and neither road nor sidewalk."""
    return ~np.isin(truth, (ROAD, SIDEWALK, IGNORE))


def unjudged(p: NDArray, scan: NDArray, truth: NDArray) -> NDArray[np.bool_]:
    """Return which cells the map p calls occupied and its last scan doesn't, while they have no label, (H, W)."""
    return (p > 0.5) & (scan <= 0.5) & (truth == IGNORE)


def add_up(
    frames: Sequence[Frame], spec: GridSpec, sensor: Sensor, tau: float = np.inf, highest: float = 0.97
) -> list[NDArray]:
    """Return the log-odds grid's map of P(occupied) after each frame.

    Parameters
    ----------
    frames : sequence of Frame
        The drive.
    spec : GridSpec
        The grid.
    sensor : Sensor
        The sensor model.
    tau : float
        Memory of a cell, seconds; `LogOddsGrid` itself never forgets.
    highest : float
        Upper limit of P(occupied).
    """
    grid = LogOddsGrid(spec, LogOddsParams(sensor=sensor, highest=highest))
    before = frames[0]
    maps = []
    for frame in frames:
        dt = frame.time - before.time
        motion = PlanarMotion.from_poses(before.T_world_from_lidar, frame.T_world_from_lidar)
        grid._log_odds *= np.float32(np.exp(-dt / tau))
        maps.append(grid.step(frame.points_grid, motion, dt))
        before = frame
    return maps


def alone(frames: Sequence[Frame], spec: GridSpec, sensor: Sensor) -> list[NDArray]:
    """Return P(occupied) after each scan by itself, with a prior of one half."""
    seen = [scan_evidence(frame.points_grid, spec, sensor) for frame in frames]
    return [evidence.occupied / (evidence.occupied + evidence.free) for evidence in seen]


def passes_since_return(scans: Sequence[NDArray]) -> NDArray[np.int64]:
    """Count, in each cell, the scans with a pass since the last return, (H, W); -1 where there was no return.

    Parameters
    ----------
    scans : sequence of (H, W) float
        P(occupied) after each scan by itself, of a vehicle that doesn't move.
    """
    passes = np.full(scans[0].shape, -1)
    for p in scans:
        passes[(p < 0.5) & (passes >= 0)] += 1
        passes[p > 0.5] = 0
    return passes


def draw(
    spec: GridSpec, p: NDArray, ax: Axes, title: str, ghost: NDArray | None = None, legend: bool = False,
    unlabelled: NDArray | None = None,
) -> None:  # fmt: skip
    """Draw a map of P(occupied): free light from 0.25 down, occupied dark from 0.75 up, unknown grey, ghosts red.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    p : (H, W) float
        P(occupied).
    ax : matplotlib Axes
        Where to draw.
    title : str
        Title of the map.
    ghost : (H, W) bool, optional
        Cells to paint red.
    legend : bool
        Whether a legend names the colours.
    unlabelled : (H, W) bool, optional
        Cells to paint pink: they may be ghosts, but have no label.
    """
    colours = plotting.occupancy_colours(plotting.binary_states(p))
    if ghost is not None:
        colours[ghost] = GHOST
    if unlabelled is not None:
        colours[unlabelled] = UNJUDGED
    plotting.grids.draw_map(spec, colours, ax).set_title(title, fontsize=10)
    if legend:
        names = ["free", "occupied", "unknown", "ghost: occupied\nin the map, but\nempty road"]
        shown = [STATE_COLOURS[s] for s in (State.FREE, State.STATIC, State.UNKNOWN)] + [GHOST]
        more = unlabelled is not None
        colour_legend(ax, names + more * ["only in the map,\nand no label"], shown + more * [UNJUDGED])


def note(ax: Axes, letters: dict[str, tuple[tuple[float, float], tuple[float, float]]]) -> None:
    """Write letters on a map, each with an arrow: letter to (what it points at, where it is)."""
    for letter, (at, text) in letters.items():
        style = {"arrowstyle": "->", "color": "tab:blue", "linewidth": 1.5}
        ax.annotate(letter, at, text, color="tab:blue", fontsize=12, fontweight="bold", arrowprops=style)


def draw_ghosts(spec: GridSpec, p: NDArray, ax: Axes, hidden: NDArray, waiting: NDArray, unlabelled: NDArray) -> None:
    """Draw a map with two kinds of ghosts: those without a pass since the last return, and those with some.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    p : (H, W) float
        P(occupied).
    ax : matplotlib Axes
        Where to draw.
    hidden, waiting : (H, W) bool
        The cells of the two kinds.
    unlabelled : (H, W) bool
        Cells that may be ghosts, but have no label.
    """
    colours = plotting.occupancy_colours(plotting.binary_states(p))
    colours[hidden] = HIDDEN
    colours[waiting] = WAITING
    colours[unlabelled] = UNJUDGED
    plotting.grids.draw_map(spec, colours, ax).set_title("ghosts after 1.8 s", fontsize=10)
    names = ["ghost, no pass since\nthe last return", "ghost, one to\nfour passes", "only in the map,\nand no label"]
    colour_legend(ax, names, [HIDDEN, WAITING, UNJUDGED])
