"""SegNet, FCN and DeepLab drawn with channels, height and width of every map, read off the networks as they run."""

from typing import NamedTuple

import torch
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Rectangle
from torch import Tensor, nn

Shape = tuple[int, int, int]

COLOURS = {"down": "#9ecae1", "up": "#fdd0a2", "scores": "#fdae6b", "image": "#d9d9d9"}
"""Maps on the way down, on the way up, with a channel for each class, and the image."""


MOST = 11
"""Maps of the longest network; all are drawn to its scale, so that heights can be compared."""


class Map(NamedTuple):
    """One map of a network.

    Parameters
    ----------
    made_by : str
        The layers that make it from the map before, in a few words.
    shape : (int, int, int)
        Channels, height and width.
    kind : str
        One of `COLOURS`.
    """

    made_by: str
    shape: Shape
    kind: str


class Drawn(NamedTuple):
    """A network as a row of maps.

    Parameters
    ----------
    maps : list of Map
        From the image to the scores.
    over : list of (int, int)
        Numbers of the maps between which something is handed over directly.
    handed : str
        What is handed over.
    """

    maps: list[Map]
    over: list[tuple[int, int]]
    handed: str


@torch.inference_mode()
def shapes_of(net: nn.Module, image: Tensor, parts: list[str]) -> list[Shape]:
    """Return the shapes of what some parts of a network make of an image.

    Parameters
    ----------
    net : Module
        The network.
    image : (1, 3, h, w) float
        The image.
    parts : list of str
        Names of the parts, such as "backbone.layer1"; a part that makes several maps gives the shape of each.
    """
    found: list[Shape] = []

    def note(_module, _inputs, output) -> None:
        found.extend(tuple(one.shape[1:]) for one in ([output] if isinstance(output, Tensor) else output))

    hooks = [net.get_submodule(part).register_forward_hook(note) for part in parts]
    net(image)
    for hook in hooks:
        hook.remove()
    return found


def draw_segnet(net: nn.Module, image: Tensor) -> Drawn:
    """Return SegNet as a row of maps. Parameters are those of `shapes_of`."""
    stages = range(len(net.conv_deconv.encoder))
    down = shapes_of(net, image, [f"conv_deconv.encoder.{k}" for k in stages])
    up = shapes_of(net, image, [f"conv_deconv.decoder.{k}" for k in reversed(stages)])
    channels, h, w = down[-1]
    depths = [sum(isinstance(layer, nn.Conv2d) for layer in part.modules()) for part in net.conv_deconv.encoder]
    maps = [_image(image)]
    convs = ["conv" + f" x{depth}" * (depth > 1) for depth in depths]
    for k in stages:
        maps.append(Map(("pool, " if k else "") + convs[k], down[k], "down"))
    maps.append(Map("pool", (channels, h // 2, w // 2), "down"))
    for k, shape in zip(reversed(stages), up, strict=True):
        maps.append(Map(f"unpool, {convs[k]}", shape, "up" if k else "scores"))
    return Drawn(maps, [(1 + k, len(maps) - 1 - k) for k in stages], "indices")


def draw_fcn(net: nn.Module, image: Tensor) -> Drawn:
    """Return FCN as a row of maps. Parameters are those of `shapes_of`."""
    pools = shapes_of(net, image, ["backbone"])
    conv7, score_32, score_16, score_8 = shapes_of(net, image, ["conv7", "score_conv7", "score_pool4", "score_pool3"])
    maps = [_image(image), *(Map("convs, pool", shape, "down") for shape in pools)]
    maps += [Map("conv 7x7, 1x1", conv7, "down"), Map("score 1x1", score_32, "scores")]
    maps += [Map("double, add", score_16, "scores"), Map("double, add", score_8, "scores")]
    maps.append(Map("enlarge x8", (score_8[0], *image.shape[2:]), "scores"))
    return Drawn(maps, [(4, 8), (3, 9)], "skips: scored by 1x1, added")


def draw_deeplab(net: nn.Module, image: Tensor) -> Drawn:
    """Return DeepLab as a row of maps. Parameters are those of `shapes_of`."""
    stem, *layers = shapes_of(net, image, ["backbone.conv1", *(f"backbone.layer{k}" for k in range(1, 5))])
    (scored, *_) = shapes_of(net, image, ["aspp.0"])
    maps = [_image(image), Map("conv, stride 2", stem, "down"), Map("pool, convs", layers[0], "down")]
    maps.append(Map("convs, stride 2", layers[1], "down"))
    maps += [Map("convs, rate 2", layers[2], "down"), Map("convs, rate 4", layers[3], "down")]
    maps.append(Map("rates 2 4 6 8, mean", scored, "scores"))
    maps.append(Map("enlarge x8", (scored[0], *image.shape[2:]), "scores"))
    return Drawn(maps, [], "")


def _image(image: Tensor) -> Map:
    return Map("image", tuple(image.shape[1:]), "image")


def draw_maps(drawn: Drawn, ax: Axes, title: str) -> None:
    """Draw a network: a box for each map, as high as the map and wider with more channels.

    Parameters
    ----------
    drawn : Drawn
        The network.
    ax : Axes
        Where to draw.
    title : str
        The title.
    """
    full = drawn.maps[0].shape[1]
    middles = [1.0 * k for k in range(len(drawn.maps))]
    for x, one in zip(middles, drawn.maps, strict=True):
        channels, h, w = one.shape
        width = 0.12 + 0.36 * min(channels / 128, 1)
        height = 0.12 + 1.6 * h / full
        ax.add_patch(
            Rectangle((x - width / 2, -height / 2), width, height, facecolor=COLOURS[one.kind], edgecolor="0.2")
        )
        ax.text(x, -1.02, f"{channels} x\n{h} x {w}", ha="center", va="top", fontsize=8)
        ax.text(x, -1.75, one.made_by.replace(", ", ",\n"), ha="center", va="top", fontsize=8, color="0.35")
    for x in middles[:-1]:
        ax.add_patch(FancyArrowPatch((x + 0.28, 0), (x + 0.72, 0), arrowstyle="->", mutation_scale=9, color="0.3"))
    for level, (start, end) in enumerate(drawn.over):
        y = 1.0 + 0.22 * (len(drawn.over) - level)
        ax.plot(
            [start, start, end], [0.12 + 0.8 * drawn.maps[start].shape[1] / full, y, y], color="tab:red", linewidth=1.2
        )
        tip = 0.1 + 0.8 * drawn.maps[end].shape[1] / full
        ax.add_patch(
            FancyArrowPatch((end, y), (end, tip), arrowstyle="->", mutation_scale=9, color="tab:red", linewidth=1.2)
        )
    if drawn.over:
        top = 1.05 + 0.22 * len(drawn.over)
        ax.text(sum(drawn.over[0]) / 2, top, drawn.handed, ha="center", va="bottom", fontsize=9, color="tab:red")
    ax.set(xlim=(-0.5, MOST - 0.5), ylim=(-2.55, 1.52 + 0.22 * len(drawn.over) if drawn.over else 1.1))
    ax.set_title(title, fontsize=10)
    ax.axis("off")
