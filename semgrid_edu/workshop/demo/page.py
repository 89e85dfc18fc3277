"""The demo's page: one HTML file that holds its figures, style, script and data."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from string import Template
from typing import NamedTuple

import numpy as np

from semgrid_edu.camera import Camera
from semgrid_edu.grid import GridSpec
from semgrid_edu.plotting import DEPTH_RANGE, STATE_COLOURS, STATE_NAMES, depth_colours
from semgrid_edu.workshop.demo.comparison import Comparison, metrics_table, times_table
from semgrid_edu.workshop.demo.pictures import grid_svg
from semgrid_edu.workshop.demo.record import YOURS, FrameView

NOTICE = (
    '<p class="notice"><b>Expect poor semantics here.</b> The truth is not known for this drive, and the network has '
    "learned from simulated streets alone. Real images look different, so expect many wrong classes in the image "
    "scores, the semantic grid and the refined grid. The occupancy grid and the geometry learn nothing from images, so "
    "they work here as they do on simulated drives, with one reservation: the filter finds the ground by following it "
    "outward from the vehicle. Where parked cars or a fence hide the foot of a bank, it can lose the ground, and then "
    "it takes the bank for an obstacle.</p>"
)

SWITCHES = (
    '<label class="pick">Zoom <select id="zoom"><option value="1" selected>1</option><option value="2">2</option>'
    '<option value="4">4</option></select></label>'
    '<button id="errors" type="button" aria-pressed="false">Errors</button>'
)
"""The switches of the grids: a closer look, and what is wrong where the truth is known."""


class Panel(NamedTuple):
    """A bird's-eye panel: the name of its raster in a `FrameView`, title and symbol of its caption, and what to see."""

    name: str
    title: str
    symbol: str
    see: str


GRID_PANELS = (
    Panel(
        "occupancy",
        "Occupancy grid",
        "o",
        "Light cells are free, dark cells hold something that stands still, orange cells something that moves. Grey "
        "cells are unknown: a grey shadow lies behind each obstacle, because no beam gets there. An arrow is as long "
        "as the distance covered in 0.5&nbsp;s.",
    ),
    Panel(
        "grid",
        "Semantic grid",
        "g",
        "The occupancy grid says where something stands, and the image says what it is. Look at road and sidewalk: "
        "both are simply free in the occupancy grid, and only here are they told apart.",
    ),
    Panel(
        "refined",
        "Refined grid",
        "g after the CRF",
        "The CRF lets nearby cells with similar occupancy agree on a class. This removes specks and closes holes, but "
        "it can also remove what is thin or rare: compare with the semantic grid.",
    ),
    Panel(
        "truth",
        "Truth",
        "",
        "The class of what stands in each cell that the camera sees. The other cells are unknown, and are named by "
        "their most probable occupancy state. Where does the estimate differ, and how far away is that?",
    ),
)


@dataclass(frozen=True, eq=False)
class Summary:
    """What the page says of the drive as a whole.

    Parameters
    ----------
    title : str
        The drive's name.
    spec : GridSpec
        The grid.
    camera : Camera
        The camera at the size of the drive's images.
    network_size : (int, int)
        Height and width of the image that the network sees, pixels.
    classes : sequence of (str, (int, int, int))
        Names and colours of the classes that occur.
    metrics : dict of str to dict of str to float
        Value of each metric, 0..1, by the metric's name and the row of the table.
    labelled : int
        Number of frames with truth. When it is 0, the page shows no metrics and says what to expect.
    milliseconds : dict of str to float
        Median time of each stage per frame, ms.
    comparison : Comparison, optional
        Which stages come from a student's file, when a second run with them is shown beside the package's own.
    your_milliseconds : dict of str to float
        Median time of each stage in that run, ms.
    story : dict of str to object, optional
        `story_data`; without it, the page tells no stories of cells.
    choice : str
        Which frames of the drive are shown, as `ChosenFrames.told` says it.
    broken : str
        What could not be read, so that the page ends before it; empty when all could.
    """

    title: str
    spec: GridSpec
    camera: Camera
    network_size: tuple[int, int]
    classes: Sequence[tuple[str, tuple[int, int, int]]]
    metrics: dict[str, dict[str, float]]
    labelled: int
    milliseconds: dict[str, float]
    comparison: Comparison | None = None
    your_milliseconds: dict[str, float] = field(default_factory=dict)
    story: dict[str, object] | None = None
    choice: str = ""
    broken: str = ""


def page_html(summary: Summary, frames: Sequence[FrameView]) -> str:
    """Write the page.

    Parameters
    ----------
    summary : Summary
        What the page says of the drive as a whole.
    frames : sequence of FrameView
        The frames to show, at least one.

    Returns
    -------
    str
        HTML that refers to nothing outside itself.
    """
    first, (near, far) = frames[0], DEPTH_RANGE
    panels = [panel for panel in GRID_PANELS if panel.name != "truth" or summary.labelled]
    return Template(_resource("page.html")).substitute(
        title=escape(f"semgrid_edu: {summary.title}"),
        style=_resource("page.css"),
        script="\n".join(map(_resource, ("page.js", "story.js", "panel.js") if summary.story else ("page.js",))),
        panel=_panel(summary) if summary.story else "",
        switches=SWITCHES if summary.story else "",
        column=_column_svg(summary.camera),
        story=_json(summary.story),
        lead=_lead(summary, len(frames)),
        notice=_broken(summary.broken) + ("" if summary.labelled else NOTICE),
        last=len(frames) - 1,
        clock=escape(first.clock),
        longest=max(len(frame.clock) for frame in frames),  # so that the slider keeps its length while it is moved
        **{name: first.images[name] for name in ("photo", "points", "scores")},
        **{f"{name}_text": escape(first.texts[name]) for name in ("points", "scores")},
        near=f"{near:g}",
        far=f"{far:g}",
        ramp=",".join(f"rgb{tuple(colour)}" for colour in depth_colours(np.geomspace(near, far, 9)).tolist()),
        network_size="{1} × {0} pixels".format(*summary.network_size),
        your_scores=_your_scores(summary, first),
        grids="\n".join(_single_or_pair(panel, summary, first) for panel in panels),
        states=_swatches(zip(STATE_NAMES, STATE_COLOURS, strict=True)),
        classes=_swatches(summary.classes),
        metrics=metrics_table(summary.metrics, summary.labelled, summary.comparison) if summary.labelled else "",
        times=times_table(summary.milliseconds, summary.your_milliseconds, summary.comparison),
        frames=_json([vars(frame) for frame in frames]),
    )


def _single_or_pair(panel: Panel, summary: Summary, first: FrameView) -> str:
    """Return a panel as a figure; in a comparison, the package's and the student's in a pair if they can differ."""
    comparison = summary.comparison
    if comparison is None or panel.name not in comparison.changed:
        return _figure(panel, summary, first)
    package = panel._replace(title=f"{panel.title}, the package's")
    title, symbol = f"{panel.title}, {comparison.file}", panel.symbol.removesuffix(" after the CRF")
    yours = Panel(YOURS + panel.name, title, symbol, comparison.made_with(panel.name))
    return f'<div class="pair">{_figure(package, summary, first)}{_figure(yours, summary, first)}</div>'


def _figure(panel: Panel, summary: Summary, first: FrameView) -> str:
    raster, text = first.images.get(panel.name, ""), escape(first.texts.get(panel.name, ""))
    svg = grid_svg(panel.name, summary.spec, summary.camera, raster, text, arrows=panel.name in first.arrows)
    hidden = " hidden" if panel.name in first.images else ""
    missing = f'<p class="note" data-missing="{panel.name}"{hidden}>Nobody labelled this frame.</p>'
    symbol = f" <i>{panel.symbol}</i>" if panel.symbol else ""
    return f"<figure>{svg}{missing}<figcaption><b>{escape(panel.title)}</b>{symbol} — {panel.see}</figcaption></figure>"


def _column_svg(camera: Camera) -> str:
    """Return an empty layer over an image, in which the script draws the points above a cell (eq. (1))."""
    height, width = camera.size
    return f'<svg data-column viewBox="-0.5 -0.5 {width} {height}" aria-hidden="true"></svg>'


def _your_scores(summary: Summary, first: FrameView) -> str:
    """Return the figure of the image scores of a student's own network; empty when the package's made the scores."""
    comparison = summary.comparison
    if comparison is None or "scores" not in comparison.changed:
        return ""
    name = f"{YOURS}scores"
    image, text = first.images[name], escape(first.texts[name])
    return (
        f'\n<figure>\n<div class="stack"><img data-image="photo" src="{first.images["photo"]}" alt="">'
        f'<img data-image="{name}" data-text="{name}" src="{image}" alt="{text}">{_column_svg(summary.camera)}</div>\n'
        f"<figcaption><b>Image scores, {escape(comparison.file)}</b> <i>s</i> — {comparison.made_with('scores')}"
        "</figcaption>\n</figure>"
    )


def _broken(error: str) -> str:
    """Return the notice that the drive could not be read to its end."""
    notice = '<p class="notice"><b>The drive could not be read to its end.</b> The page shows what came before: {}</p>'
    return notice.format(escape(error)) if error else ""


def _lead(summary: Summary, n_frames: int) -> str:
    spec = summary.spec
    size = f"{spec.x_max - spec.x_min:g}&nbsp;m long and {spec.y_max - spec.y_min:g}&nbsp;m wide"
    return (
        f"{summary.comparison.lead() + ' ' if summary.comparison else ''}"
        f"Here are {n_frames} frames of the drive <b>{escape(summary.title)}</b>{summary.choice}, sent through every "
        "stage of the method. A Bayes filter turns the laser scans into a grid of what is free, what stands still and "
        "what moves. A network gives each pixel of the camera image a score for each class. Planes above the ground "
        "carry these scores into the same grid, where a second network fuses them with the occupancy. The result is a "
        "map, "
        f"{size}, of what stands where. Move the slider, press play, or use the arrow keys; click a cell, and "
        "the page tells how it got its class."
    )


def _panel(summary: Summary) -> str:
    whose = " The stories are about the package's own stages." if summary.comparison else ""
    return Template(_resource("panel.html")).substitute(whose=whose)


def _json(data: object) -> str:
    """Write data for a script element, which no text in it can end."""
    return json.dumps(data).replace("<", "\\u003c")


def _swatches(colours: Iterable[tuple[str, tuple[int, int, int]]]) -> str:
    return "".join(f'<span style="--swatch:rgb{tuple(rgb)}">{escape(name)}</span>' for name, rgb in colours)


def _resource(name: str) -> str:
    return files("semgrid_edu.workshop.demo").joinpath(name).read_text(encoding="utf-8")
