"""The pictures of lecture 04: three filters on one street, a round of CMCDOT, errors, and luck."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from semgrid_edu import plotting
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, Evidence, FilterState, State
from semgrid_edu.plotting.colours import HEADING_COLOURS, colour_patches
from semgrid_edu.plotting.grids import draw_map
from semgrid_edu.plotting.moving import wheel_colours
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
        b, d = 38.3 - 1.72 * k, 36.5 - 0.86 * k
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
    """Draw the surroundings of the overtaking car after step 2, in the scan, and after steps 3 and 4."""
    plotting.occupancy(spec, predicted.probability, ax=axes[0], legend=False)
    draw_map(spec, np.log10(evidence.occupied / evidence.free), axes[1], cmap="RdGy", vmin=-1, vmax=1)
    plotting.occupancy(spec, updated.probability, ax=axes[2], legend=False)
    empty = np.zeros((4, *spec.shape))
    empty[State.FREE] = 1
    plotting.particles(spec, resampled.particles, plotting.occupancy(spec, empty, ax=axes[3], legend=False))
    for ax, title in zip(axes, ("2 predicted", "the scan", "3 updated", "4 resampled: particles"), strict=True):
        ax.set(xlim=(8, -1), ylim=(2, 15), xticks=(0, 5), yticks=(5, 10, 15), xlabel="y, to the left [m]", ylabel="")
        ax.set_title(title, fontsize=10)
    axes[0].set_ylabel("x, forward [m]")


def legend_of_round(fig: Figure) -> None:
    """Add the legend of `draw_round` below its panels."""
    scan = plt.get_cmap("RdGy")([1.0, 0.5 + 0.5 * np.log10(0.3 / 0.7), 0.5])[:, :3] * 255
    named = colour_patches(plotting.STATE_NAMES, plotting.STATE_COLOURS)
    named += colour_patches(("hit", "passed", "not seen"), scan)
    named += colour_patches(("particle: our way", "towards us"), HEADING_COLOURS[::2])
    fig.legend(handles=named, loc="outside lower center", ncols=5, fontsize=9, frameon=False)


def draw_error(error: SamplingError) -> None:
    """Draw the errors of CMCDOT against its number of particles, with BOF's bias."""
    _, ax = plt.subplots(figsize=(7.2, 2.8), layout="constrained")
    ax.loglog(error.numbers, error.to_exact, "s", color=ORANGE, label="error: CMCDOT to exact")
    ax.axhline(error.bias, color=ORANGE, ls="--", label="bias: BOF to exact")
    ax.loglog(error.numbers, error.to_bof, "o", color=VIOLET, label="sampling: CMCDOT to BOF")
    ax.loglog(error.numbers, error.to_bof[1] * (error.numbers / error.numbers[1]) ** -0.5, "k:", label="slope -1/2")
    ax.set_xticks(error.numbers, [f"{number:,}" for number in error.numbers])
    ax.xaxis.minorticks_off()
    ax.set(xlabel="particles", ylabel="root mean square error", ylim=(8e-4, 0.12))
    ax.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.02, 1), fontsize=9)


def draw_crossing(
    ax: Axes, particles: int, stop_speed: float = PARAMS.stop_speed, seed: int = 0, legend: bool = True
) -> None:
    """Draw the street with a car and a person after 2 s of filtering."""
    *_, last = watch(crossing, 2.0, params=replace(PARAMS, n_particles=particles, stop_speed=stop_speed), seed=seed)
    belief, things = last.belief, crossing(last.time)
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
    ax.set(xscale="log", ylim=(-3, 103), xlabel="particles", ylabel="cells that are DYNAMIC [%]")
    ax.set_title("24 seeds", fontsize=10)
    ax.set_xticks(numbers, [f"{number:,}" for number in numbers])
    ax.xaxis.minorticks_off()
    ax.legend(frameon=False, loc="lower right", fontsize=9)


def draw_street(ax: Axes, spec: GridSpec, belief: Belief, title: str, legend: bool) -> None:
    """Draw a belief of the real street, with letters at the oncoming cars E and at the car F ahead of us."""
    plotting.velocity_wheel(spec, belief.probability, belief.velocity, ax=ax, legend=legend)
    for letter, place in (("E", (5.4, 14)), ("F", (2.4, 12))):
        ax.text(*place, letter, weight="bold", ha="center", zorder=3)
    ax.set_title(title, fontsize=10)
