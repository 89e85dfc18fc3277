"""The demo's page: one HTML file that holds its pictures, style and script."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from string import Template
from typing import NamedTuple

import numpy as np

from semgrid_edu.camera import Camera
from semgrid_edu.demo.grids import grid_svg
from semgrid_edu.demo.tables import metrics_table, times_table
from semgrid_edu.grid import GridSpec
from semgrid_edu.plotting import DEPTH_RANGE, STATE_COLOURS, STATE_NAMES, depth_colours


class Panel(NamedTuple):
    """A bird's-eye panel: its raster's name, its title, its symbol in Fig. 2 and what to see."""

    name: str
    title: str
    symbol: str
    see: str


GRID_PANELS = (
    Panel(
        "occupancy",
        "Occupancy grid",
        "o",
        "Light is free, dark stands still, orange moves, grey nobody has seen. Behind each obstacle lies a grey "
        "shadow. Arrows reach as far as things move in half a second.",
    ),
    Panel(
        "grid",
        "Semantic grid",
        "g",
        "Occupancy says where something stands, the image says what it is. Road and sidewalk, both just free in the "
        "occupancy grid, part here.",
    ),
    Panel(
        "refined",
        "Refined grid",
        "g after the CRF",
        "Cells that lie close and have like occupancy agree on a class, so specks and holes go. What is thin or rare "
        "may go with them: compare.",
    ),
    Panel(
        "truth",
        "Truth",
        "",
        "What stands in the cells that the camera sees; the others are unknown, named by their occupancy. Where does "
        "the estimate differ, and how far away?",
    ),
)

NOTICE = (
    '<p class="notice"><b>Expect poor semantics here.</b> No truth is known for this drive, and the network has learnt '
    "from simulated streets alone. Real images are out of its domain: image scores, semantic grid and refined grid "
    "are often wrong. Occupancy and geometry learn nothing from images and hold, with one reserve: the filter takes "
    "the ground as flat, so a slope or high grass beside the road counts as standing.</p>"
)


@dataclass(frozen=True)
class FrameView:
    """One frame as the page shows it.

    Parameters
    ----------
    clock : str
        Which frame, and when.
    images : dict of str to str
        Data URIs of photo, points, scores, occupancy, grid, refined and, where it is known, truth.
    texts : dict of str to str
        What a reader hears who doesn't see them.
    arrows : str
        Velocities, as an SVG path.
    """

    clock: str
    images: dict[str, str]
    texts: dict[str, str]
    arrows: str


@dataclass(frozen=True, eq=False)
class Summary:
    """What the page says of the drive as a whole.

    Parameters
    ----------
    title : str
        The drive's name.
    spec : GridSpec
    camera : Camera
    network_size : (int, int)
        Height and width of the image that the network sees, pixels.
    classes : sequence of (str, (int, int, int))
        Names and colours of the classes that occur.
    metrics : dict of str to dict of str to float
        Values, 0..1, by metric and row.
    labelled : int
        Frames with truth; with none, the page shows no metrics and says what to expect.
    milliseconds : dict of str to float
        Time of each stage.
    """

    title: str
    spec: GridSpec
    camera: Camera
    network_size: tuple[int, int]
    classes: Sequence[tuple[str, tuple[int, int, int]]]
    metrics: dict[str, dict[str, float]]
    labelled: int
    milliseconds: dict[str, float]


def page_html(summary: Summary, frames: Sequence[FrameView]) -> str:
    """Write the page.

    Parameters
    ----------
    summary : Summary
    frames : sequence of FrameView
        At least one.

    Returns
    -------
    str
        HTML that refers to nothing outside itself.
    """
    first, ramp = frames[0], depth_colours(np.geomspace(*DEPTH_RANGE, 9))
    near, far = DEPTH_RANGE
    panels = [panel for panel in GRID_PANELS if panel.name != "truth" or summary.labelled]
    return Template(_resource("page.html")).substitute(
        title=escape(f"semgrid_edu: {summary.title}"),
        style=_resource("page.css"),
        script=_resource("page.js"),
        lead=_lead(summary, len(frames)),
        notice="" if summary.labelled else NOTICE,
        last=len(frames) - 1,
        clock=escape(first.clock),
        **{name: first.images[name] for name in ("photo", "points", "scores")},
        **{f"{name}_text": escape(first.texts[name]) for name in ("points", "scores")},
        near=f"{near:g}",
        far=f"{far:g}",
        ramp=",".join(f"rgb{tuple(colour)}" for colour in ramp.tolist()),
        network_size="{1} × {0} pixels".format(*summary.network_size),
        grids="\n".join(_panel(panel, summary, first) for panel in panels),
        states=_swatches(zip(STATE_NAMES, STATE_COLOURS, strict=True)),
        classes=_swatches(summary.classes),
        metrics=metrics_table(summary.metrics, summary.labelled) if summary.labelled else "",
        times=times_table(summary.milliseconds),
        frames=json.dumps([vars(frame) for frame in frames]).replace("<", "\\u003c"),
    )


def _lead(summary: Summary, n_frames: int) -> str:
    spec = summary.spec
    size = f"{spec.x_max - spec.x_min:g} m long and {spec.y_max - spec.y_min:g} m wide"
    return (
        f"Here are {n_frames} frames of the drive <b>{escape(summary.title)}</b>, sent through every stage of the "
        "method. A Bayes filter turns laser scans into a grid of what is free, what stands and what moves. A network "
        "names what the camera sees; planes above the ground carry the names into the same grid, where a second "
        f"network fuses both. Out comes a map, {size}, of what stands where. Move the slider, press play, or use the "
        "arrow keys."
    )


def _panel(panel: Panel, summary: Summary, first: FrameView) -> str:
    raster, text = first.images.get(panel.name, ""), escape(first.texts.get(panel.name, ""))
    svg = grid_svg(panel.name, summary.spec, summary.camera, raster, text)
    hidden = " hidden" if panel.name in first.images else ""
    missing = f'<p class="note" data-missing="{panel.name}"{hidden}>Nobody labelled this frame.</p>'
    symbol = f" <i>{panel.symbol}</i>" if panel.symbol else ""
    return f"<figure>{svg}{missing}<figcaption><b>{panel.title}</b>{symbol} — {panel.see}</figcaption></figure>"


def _swatches(colours: Iterable[tuple[str, tuple[int, int, int]]]) -> str:
    return "".join(f'<span style="--swatch:rgb{tuple(rgb)}">{escape(name)}</span>' for name, rgb in colours)


def _resource(name: str) -> str:
    return files("semgrid_edu.demo").joinpath(name).read_text(encoding="utf-8")
