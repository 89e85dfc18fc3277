"""The drawings of lecture 08: rays past a car, and the fusion network with the size of every map."""

from collections.abc import Sequence

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import FusionNet

CAMERA, NEAR, FAR, ROOF = 1.65, 8.0, 12.0, 1.4
"""The height of the camera, where the car begins and ends, and the height of its roof, metres."""


def where_ray_ends(x: float, z: float) -> tuple[str, float, float]:
    """Follow the ray from the camera through the point (x, z) to the car or the road: class, and place it meets."""
    slope = (z - CAMERA) / x
    if CAMERA + slope * NEAR <= ROOF:
        return ("road", x, z) if x < NEAR and z == 0 else ("car", NEAR, CAMERA + slope * NEAR)
    on_roof = (ROOF - CAMERA) / slope
    return ("car", on_roof, ROOF) if on_roof <= FAR else ("road", -CAMERA / slope, 0.0)


def six_rays() -> Figure:
    """Draw the rays through two points above each of three cells, from the side."""
    fig, ax = plt.subplots(figsize=(8.2, 2.6), layout="constrained")
    ax.fill([NEAR, FAR, FAR, NEAR], [0, 0, ROOF, ROOF], color=np.divide(KITTI_14.rgb[3], 255), alpha=0.35)
    ax.text((NEAR + FAR) / 2, 0.6, "the car", ha="center")
    for x, name in zip((6, 10, 14), ("before", "in", "behind"), strict=True):
        ax.text(x, -0.35, name, ha="center")
        for z in (0.0, ROOF):
            called, x_end, z_end = where_ray_ends(x, z)
            colour = np.divide(KITTI_14.rgb[KITTI_14.index(called)], 255)
            ax.plot([0, x_end], [CAMERA, z_end], color=colour, linewidth=0.8)
            marker = "o" if called == "car" else "s"
            ax.plot(x, z, marker, color=colour, markersize=9, markeredgecolor="white", zorder=3)
    ax.plot(0, CAMERA, "k>", markersize=9)
    ax.annotate("camera", (0, CAMERA), (6, 6), textcoords="offset points")
    ax.hlines([0, ROOF], 0, 20, color="0.6", linestyle=":", zorder=0)
    ax.set(xlim=(-0.5, 18), ylim=(-0.5, 2.1), xlabel="x, forward [m]", ylabel="z, up [m]")
    return fig


def mark(axes: Sequence[Axes], places: dict[str, tuple[float, float]]) -> None:
    """Mark places of maps by their names, with a ring.

    Parameters
    ----------
    axes : sequence of Axes
        The maps.
    places : dict of str to (float, float)
        x and y of each place, by its name.
    """
    for ax in axes:
        for name, (x, y) in places.items():
            ax.plot(y, x, "o", markersize=7, markerfacecolor="none", markeredgecolor="black", markeredgewidth=2.4)
            ax.plot(y, x, "o", markersize=7, markerfacecolor="none", markeredgecolor="white", markeredgewidth=1)
            ax.annotate(name, (y, x), (6, 3), textcoords="offset points", fontsize=9,
                        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "black"})  # fmt: skip


def map_sizes(net: FusionNet, n_rows: int, n_cols: int) -> list[tuple[str, str, int]]:
    """Return what the network does and the size of the map after it, and how often that map was halved, in order.

    Parameters
    ----------
    net : FusionNet
        The network.
    n_rows, n_cols : int
        The size of the grid.
    """
    reduction = net.reduce[0]
    n_joined = net.conv_deconv.encoder[0][0][0].in_channels
    sizes = [("planes", f"{reduction.in_channels} x {reduction.kernel_size[0]}", 0)]
    sizes += [("1x1", str(reduction.out_channels), 0), ("o joins", str(n_joined), 0)]
    stages = list(zip(net.conv_deconv.encoder, net.conv_deconv.decoder, strict=True))
    for level, (encode, _) in enumerate(stages):
        sizes += [
            (f"3x3{' x2' * (len(encode) > 1)}", str(_width(encode)), level),
            ("pool", str(_width(encode)), level + 1),
        ]
    for level, (_, decode) in reversed(list(enumerate(stages))):
        sizes += [
            ("unpool\n+ skip", str(_first_width(decode)), level),
            (f"3x3{' x2' * (len(decode) > 1)}", str(_width(decode)), level),
        ]
    return [(what, f"{channels}\n{n_rows >> level} x {n_cols >> level}", level) for what, channels, level in sizes]


def _width(layers: Sequence) -> int:
    """Return the number of channels after some layers."""
    last = layers[-1]
    return (last if hasattr(last, "out_channels") else last[0]).out_channels


def _first_width(layers: Sequence) -> int:
    """Return the number of channels before some layers."""
    first = layers[0]
    return (first if hasattr(first, "in_channels") else first[0]).in_channels


def fusion_network(net: FusionNet, n_rows: int, n_cols: int) -> Figure:
    """Draw the network: a box for each map, lower where it is smaller, with its channels and its size.

    Parameters are those of `map_sizes`.
    """
    fig, ax = plt.subplots(figsize=(9.6, 3.9), layout="constrained")
    maps = map_sizes(net, n_rows, n_cols)
    for x, (what, size, level) in enumerate(maps):
        height = 0.85 / 2**level + 0.15
        colour = "#f6c9a0" if what == "o joins" else "#bcd6f2"
        ax.bar(x, height, 0.5, bottom=-1.7 * level, color=colour, edgecolor="0.3")
        ax.text(x, -1.7 * level + height + 0.08, what, ha="center", va="bottom", fontsize=8.5)
        ax.text(x, -1.7 * level - 0.1, size, ha="center", va="top", fontsize=8)
    down = {level: x for x, (what, _, level) in enumerate(maps) if what.startswith("3x3") and x < len(maps) // 2 + 1}
    up = {level: x for x, (what, _, level) in enumerate(maps) if what.startswith("unpool")}
    for level, x in up.items():
        y = -1.7 * level + 0.35
        arrow = {"arrowstyle": "->", "linestyle": "--", "color": "0.45"}
        ax.annotate("", (x - 0.3, y), (down[level] + 0.3, y), arrowprops=arrow)
    ax.set(xlim=(-0.7, len(maps) - 0.3), ylim=(-6.3, 1.6))
    ax.axis("off")
    return fig
