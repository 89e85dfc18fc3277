"""The pictures of lecture 04: three filters on one street, a round of CMCDOT, errors, and luck."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from semgrid_edu import plotting
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, Evidence, FilterState, State
from semgrid_edu.plotting.animations import wheel_colours
from semgrid_edu.plotting.colours import HEADING_COLOURS, colour_patches
from semgrid_edu.plotting.grids import draw_map
from worlds.lecture_04_cmcdot import SamplingError
from worlds.lecture_04_crossing import CAR, PARAMS, PERSON, SPEC, crossing, watch

ORANGE, VIOLET = "#d95f02", "#6a1b9a"


def three_filters(
    spec: GridSpec, by_log_odds: Sequence[NDArray], by_bof: Sequence[Belief], by_cmcdot: Sequence[Belief]
) -> Iterator[Figure]:
    """Draw the maps of three filters on the sample drive side by side, one frame of the animation after the other."""
    fig, axes = plt.subplots(1, 3, figsize=(9.4, 4.2), layout="compressed")
    style = {"weight": "bold", "ha": "center", "va": "center"}
    style["path_effects"] = [withStroke(linewidth=2, foreground="w")]
    letters = [[ax.text(0, 0, name, **style) for name in "ABCD"] for ax in axes]
    for ax in axes:
        plotting.velocity_wheel(spec, by_bof[0].probability, by_bof[0].velocity, ax=ax, legend=ax is axes[-1])
        ax.set(xlim=(15, -11), ylim=(0, 42), ylabel="x, forward [m]" if ax is axes[0] else "")
    for k in range(0, len(by_bof), 4):
        pictures = [plotting.occupancy_colours(plotting.binary_states(by_log_odds[k]))]
        pictures += [wheel_colours(spec, b[k].probability, b[k].velocity) for b in (by_bof, by_cmcdot)]
        b = 38.3 - 1.72 * k
        d = 36.5 - 0.86 * k
        places = (0.4, 0.42 * k + 1), (4.2, b), (4.2, b + 5), (13.3, d)
        for ax, picture, name, texts in zip(axes, pictures, ("log-odds grid", "BOF", "CMCDOT"), letters, strict=True):
            ax.images[-1].set_data(picture)
            ax.set_title(f"{name}, {k / 10:.1f} s", fontsize=10)
            for text, place in zip(texts, places, strict=True):
                text.set(position=place, visible=0 < place[1] < 41)
        yield fig
        fig.set_layout_engine("none")  # only the first frame is laid out


def draw_round(
    axes: Sequence[Axes], spec: GridSpec, predicted: FilterState, evidence: Evidence,
    updated: FilterState, resampled: FilterState,
) -> None:  # fmt: skip
    """Draw the overtaking car A after step 1, in the scan, after steps 2 and 3, and after step 4."""
    plotting.occupancy(spec, predicted.probability, ax=axes[0], legend=False)
    draw_map(spec, np.log10(evidence.occupied / evidence.free), axes[1], cmap="RdGy", vmin=-1, vmax=1)
    plotting.occupancy(spec, updated.probability, ax=axes[2], legend=False)
    empty = np.zeros((4, *spec.shape))
    empty[State.FREE] = 1
    plotting.particles(spec, resampled.particles, plotting.occupancy(spec, empty, ax=axes[3], legend=False))
    titles = "after step 1", "the scan", "after steps 2 and 3", "after step 4: particles"
    for ax, title in zip(axes, titles, strict=True):
        ax.set(xlim=(5.5, 0.5), ylim=(2, 12), xticks=(1, 3, 5), yticks=(4, 8, 12), xlabel="y, to the left [m]")
        ax.set(ylabel="x, forward [m]" if ax is axes[0] else "")
        ax.set_title(title, fontsize=10)
    axes[0].text(4.9, 7.6, "A", weight="bold", fontsize=11)
    for x, y, name, colour in ((3.7, 4.2, "hit", "k"), (3.7, 2.7, "passed", "k"), (5.1, 10.5, "not seen", "k")):
        axes[1].text(x, y, name, color=colour, fontsize=9)
    axes[1].annotate("", (3.2, 5.3), (3.2, 4.75), arrowprops={"arrowstyle": "->", "color": "k"})


def legend_of_round(fig: Figure) -> None:
    """Add the legend of `draw_round` below its panels."""
    shown = [State.FREE, State.DYNAMIC, State.UNKNOWN]
    named = colour_patches([plotting.STATE_NAMES[k] for k in shown], [plotting.STATE_COLOURS[k] for k in shown])
    named += colour_patches(("scan: hit", "scan: passed"), ((26, 26, 26), (244, 165, 130)))
    named += colour_patches(("particle that flies our way",), HEADING_COLOURS[:1])
    fig.legend(handles=named, loc="outside lower center", ncols=6, fontsize=9, frameon=False)


def draw_error(error: SamplingError) -> None:
    """Draw the errors of CMCDOT against its number of particles, with BOF's bias."""
    _, ax = plt.subplots(figsize=(7.2, 3.4), layout="constrained")
    fine = np.geomspace(error.numbers[0], error.numbers[-1], 50)
    falling = error.to_bof[1] * (fine / error.numbers[1]) ** -0.5
    ax.loglog(fine, np.hypot(error.bias, falling), color=ORANGE)
    ax.loglog(error.numbers, error.to_exact, "s", color=ORANGE)
    ax.axhline(error.bias, color="0.3", ls="--")
    ax.loglog(fine, falling, ":", color=VIOLET)
    ax.loglog(error.numbers, error.to_bof, "o", color=VIOLET)
    names = (
        (34, 0.070, "error: CMCDOT to the exact answer", ORANGE),
        (10, 0.043, "bias: BOF to the exact answer", "0.3"),
        (85, 0.0135, "sampling: CMCDOT to BOF,\nwith a line of slope -1/2", VIOLET),
    )
    for x, y, name, colour in names:
        ax.text(x, y, name, color=colour, fontsize=9, va="center")
    ax.set_xticks(error.numbers, [f"{number:,}" for number in error.numbers])
    ax.set_yticks([0.003, 0.01, 0.03, 0.1], ["0.003", "0.01", "0.03", "0.1"])
    ax.minorticks_off()
    ax.set(xlabel="particles", ylabel="root mean square error", ylim=(0.003, 0.1))
    ax.set_title("100 seeds", fontsize=10)


def draw_crossing(
    ax: Axes, particles: int, stop_speed: float = PARAMS.stop_speed, seed: int = 0, legend: bool = True
) -> None:
    """Draw the street with a car and a person after 2 s of filtering."""
    *_, last = watch(crossing, 2.0, params=replace(PARAMS, n_particles=particles, stop_speed=stop_speed), seed=seed)
    belief = last.belief
    things = crossing(last.time)
    plotting.velocity(
        SPEC, belief.probability, belief.velocity, plotting.occupancy(SPEC, belief.probability, ax, legend)
    )
    for name, thing in (("car", things[CAR]), ("person", things[PERSON])):
        ax.text(thing.y_min - 0.6, thing.x_max + 0.3, name, fontsize=9, weight="bold", zorder=4)
    ax.set(xlim=(9, -9), ylim=(0, 30))
    ax.set_title(f"{particles:,} particles, seed {seed}", fontsize=10)


def draw_luck(ax: Axes, luck: dict[int, NDArray]) -> None:
    """Draw how much of the car and of the person each seed finds, and the mean, by number of particles."""
    numbers = np.array(list(luck))
    for thing, (name, colour, marker, aside) in enumerate((("car", ORANGE, "o", 0.85), ("person", VIOLET, "s", 1.18))):
        for number, shares in luck.items():
            ax.plot(
                np.full(len(shares), number * aside), shares[:, thing], marker, color=colour, ms=4, alpha=0.35, mew=0
            )
        means = [shares[:, thing].mean() for shares in luck.values()]
        ax.plot(numbers * aside, means, marker + "-", color=colour, ms=8, label=f"{name}, mean")
    ax.set(
        xscale="log", ylim=(-3, 118), yticks=range(0, 101, 20), xlabel="particles", ylabel="cells that are DYNAMIC [%]"
    )
    ax.set_title("24 seeds", fontsize=10)
    ax.set_xticks(numbers, [f"{number:,}" for number in numbers])
    ax.xaxis.minorticks_off()
    ax.legend(frameon=False, loc="upper left", fontsize=9)


def draw_late(ax: Axes, times: Sequence[float], shares: dict[str, NDArray]) -> None:
    """Draw how much of the car F each filter of `DRIVES_AWAY`, and the control, calls DYNAMIC, scan by scan."""
    styles = ("o-", "0.2"), ("^-", "#1b7837"), ("s-", VIOLET), ("D-", ORANGE), ("x--", "0.45")
    for (name, found), (style, colour) in zip(shares.items(), styles, strict=True):
        ax.plot(times, found, style, color=colour, ms=5, label=name)
    ax.set(xticks=np.arange(0, 1.9, 0.2), xlabel="time [s]", ylabel="cells of F that are DYNAMIC [%]", ylim=(-2, 80))
    ax.legend(frameon=False, loc="upper left", fontsize=9)


def draw_street(ax: Axes, spec: GridSpec, belief: Belief, title: str, legend: bool) -> None:
    """Draw a belief of the real street, with frames around the lane E, the car F and what stands to the right."""
    plotting.velocity_wheel(spec, belief.probability, belief.velocity, ax=ax, legend=legend)
    frames = (("E", (6.5, 0.3), 4.5, 32.4), ("F", (-1.5, 9), 3.0, 11), ("right of us", (-11.8, 0.3), 9.8, 32.4))
    outline = [withStroke(linewidth=2.5, foreground="w")]
    for name, corner, width, height in frames:
        frame = Rectangle(corner, width, height, fill=False, color=VIOLET, lw=1.8, zorder=3)
        ax.add_patch(frame)
        place = (corner[0] + width - 0.4, corner[1] + height - 0.5)
        ax.text(*place, name, weight="bold", va="top", zorder=4, path_effects=outline)
    ax.set(ylim=(0, 33))
    ax.set_title(title, fontsize=10)
