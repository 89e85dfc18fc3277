"""The figures of the page: bird's-eye panels, and those shown twice when stages are compared."""

from html import escape
from typing import NamedTuple

from semgrid_edu.camera import Camera
from semgrid_edu.grid import GridSpec
from semgrid_edu.workshop.demo.comparison import Comparison
from semgrid_edu.workshop.demo.grids import grid_svg
from semgrid_edu.workshop.demo.record import YOURS, FrameView


class Panel(NamedTuple):
    """A bird's-eye panel of the page.

    Parameters
    ----------
    name : str
        Name of its raster among the images of a `FrameView`.
    title : str
        The first words of its caption.
    symbol : str
        Its symbol in the paper's Fig. 2; empty when it has none.
    see : str
        The rest of its caption: what to look for, as HTML.
    """

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


class PanelFrame(NamedTuple):
    """What every bird's-eye panel of a page shares.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    camera : Camera
        The camera, whose left and right borders are drawn.
    first : FrameView
        The frame that the page shows when it is opened.
    """

    spec: GridSpec
    camera: Camera
    first: FrameView


def panels_html(shared: PanelFrame, with_truth: bool, comparison: Comparison | None = None) -> str:
    """Return the bird's-eye panels, in the order of Fig. 2.

    Parameters
    ----------
    shared : PanelFrame
        What all panels share.
    with_truth : bool
        Whether any frame has truth.
    comparison : Comparison, optional
        Which stages come from a student's file. With it, panels that can differ are shown twice, side by side.

    Returns
    -------
    str
        A figure element for each panel; two in a div for each pair.
    """
    panels = [panel for panel in GRID_PANELS if panel.name != "truth" or with_truth]
    return "\n".join(_single_or_pair(panel, shared, comparison) for panel in panels)


def _single_or_pair(panel: Panel, shared: PanelFrame, comparison: Comparison | None) -> str:
    if comparison is None or panel.name not in comparison.changed:
        return _figure(panel, shared)
    package = panel._replace(title=f"{panel.title}, the package's")
    yours = Panel(
        YOURS + panel.name,
        f"{panel.title}, {comparison.file}",
        panel.symbol.removesuffix(" after the CRF"),
        comparison.made_with(panel.name),
    )
    return f'<div class="pair">{_figure(package, shared)}{_figure(yours, shared)}</div>'


def _figure(panel: Panel, shared: PanelFrame) -> str:
    first = shared.first
    raster, text = first.images.get(panel.name, ""), escape(first.texts.get(panel.name, ""))
    svg = grid_svg(panel.name, shared.spec, shared.camera, raster, text, arrows=panel.name in first.arrows)
    hidden = " hidden" if panel.name in first.images else ""
    missing = f'<p class="note" data-missing="{panel.name}"{hidden}>Nobody labelled this frame.</p>'
    symbol = f" <i>{panel.symbol}</i>" if panel.symbol else ""
    return f"<figure>{svg}{missing}<figcaption><b>{escape(panel.title)}</b>{symbol} — {panel.see}</figcaption></figure>"


def column_svg(camera: Camera) -> str:
    """Return an empty layer over an image, in which the script draws the points above a cell (eq. (1)).

    Parameters
    ----------
    camera : Camera
        The camera at the size of the image. The centre of its first pixel is (0, 0).

    Returns
    -------
    str
        An svg element.
    """
    height, width = camera.size
    return f'<svg data-column viewBox="-0.5 -0.5 {width} {height}" aria-hidden="true"></svg>'


def your_scores_html(first: FrameView, camera: Camera, comparison: Comparison | None) -> str:
    """Return the figure of the image scores of a student's own network.

    Parameters
    ----------
    first : FrameView
        The frame that the page shows when it is opened.
    camera : Camera
        The camera at the size of the drive's images.
    comparison : Comparison or None
        Which stages come from a student's file.

    Returns
    -------
    str
        A figure element; "" when the package's own network made the scores.
    """
    if comparison is None or "scores" not in comparison.changed:
        return ""
    name = f"{YOURS}scores"
    image, text = first.images[name], escape(first.texts[name])
    return (
        f'\n<figure>\n<div class="stack"><img data-image="photo" src="{first.images["photo"]}" alt="">'
        f'<img data-image="{name}" data-text="{name}" src="{image}" alt="{text}">{column_svg(camera)}</div>\n'
        f"<figcaption><b>Image scores, {escape(comparison.file)}</b> <i>s</i> — {comparison.made_with('scores')}"
        "</figcaption>\n</figure>"
    )
