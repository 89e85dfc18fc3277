"""The demo's page: one HTML file that holds its figures, style, script and data."""

import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import NamedTuple

import numpy as np

from semgrid_edu.camera import Camera
from semgrid_edu.occupancy.cmcdot import LIDAR_PERIOD
from semgrid_edu.plotting import DEPTH_RANGE, STATE_COLOURS, STATE_NAMES, depth_colours
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.demo.pictures import grid_svg
from semgrid_edu.workshop.demo.record import YOURS, FrameView, Record
from semgrid_edu.workshop.demo.stages_file import STAGE_WORDS, Comparison

SCAN_MILLISECONDS = 1000 * LIDAR_PERIOD
"""Time from one scan of KITTI's LIDAR to the next, ms."""

COMPARED = " The package's occupancy grid names the unknown cells of the truth, so that both runs have the same truth."
"""Added to the table of metrics in a comparison."""

REMEMBERED = (
    " This truth calls unknown what the camera doesn't see now, so among all cells a memory counts as wrong wherever "
    "it still knows the class: compare the semantic cells."
)
"""Added to the table of metrics if a map with memory is scored."""

HEIGHTS_TEXT = " This network looks at a cell only at the heights of its lowest and highest return, which it knows."
HEIGHTS_WIRE = """\
<g class="wires"><path d="M131 55H150V94H594"/></g><g class="how"><text x="370" y="86">heights of returns</text></g>
"""
"""What the page adds to its data flow for a network with `uses_return_heights`."""

LEARNED = " on frames from which it has learned"
"""Added to the heading of the metrics if they aren't those of new frames."""

CRF_COSTS = {
    True: "The CRF makes this map worse",
    False: "Here the CRF costs class accuracy, though not pixel accuracy",
}
"""Said above the metrics if the refined map has less class accuracy, by whether it has less pixel accuracy, too."""

GAPS = " White cells are left out: they are in view, but nobody labelled what is there."
"""Added to the caption of the truth if its labels have gaps."""


MOST_LEFT_OUT = 20
"""How many damaged frames the page names."""


class Panel(NamedTuple):
    """A bird's-eye panel.

    Parameters
    ----------
    name : str
        Name of its raster among the images of a `FrameView`.
    title, symbol : str
        The beginning of its caption, and its symbol in Fig. 2, if any.
    see : str
        What to look for, as HTML.
    """

    name: str
    title: str
    symbol: str
    see: str


def page_html(
    record: Record,
    title: str,
    camera: Camera,
    network_size: tuple[int, int],
    story: dict[str, object],
    choice: str = "",
    broken: str = "",
    left_out: Sequence[str] = (),
    expected: str = "",
    credit: str = "",
    switch: str = "",
    learned: bool = False,
) -> str:
    """Write the page.

    Parameters
    ----------
    record : Record
        What was recorded of the drive; at least one frame. Without truth the page shows no metrics.
    title : str
        The drive's name.
    camera : Camera
        The camera at the size of the drive's images.
    network_size : (int, int)
        Height and width of the image that the network sees, pixels.
    story : dict of str to object
        `story_data`.
    choice : str
        Which frames of the drive are shown, from `ChosenFrames.told`.
    broken : str
        What could not be read, so that the page ends there; empty if everything could.
    left_out : sequence of str
        A line for each damaged frame that was left out.
    expected : str
        What to expect of the classes, in plain text; its first sentence is set in bold.
    credit : str
        Whose data the page shows, in plain text.
    switch : str
        What leads to another page, as HTML.
    learned : bool
        Whether the network has learned from this drive; its scores then say nothing of new streets.

    Returns
    -------
    str
        HTML that refers to nothing outside itself.
    """
    first = record.views[0]
    near, far = DEPTH_RANGE
    comparison = record.comparison
    panels = [Panel(name, **words) for name, words in table_beside(__file__, "captions").items()]
    made = {*first.images, *["truth"] * bool(record.labelled)}
    shown = [panel for panel in panels if panel.name in made]
    if record.gaps:
        shown[-1] = shown[-1]._replace(see=shown[-1].see + GAPS)
    whose = " The stories are about the package's own stages." if comparison else ""
    return _filled(
        "page.html",
        title=escape(f"semgrid_edu: {title}"),
        style=_resource("page.css"),
        script="\n".join(map(_resource, ("page.js", "story.js", "panel.js"))),
        whose=whose,
        column=_column_svg(camera),
        story=_json(story),
        lead=_lead(record, title, choice),
        notice=_broken(broken) + _left_out(left_out) + _notice(expected),
        switch=f'<p class="switch">{switch}</p>' if switch else "",
        credit=escape(f"Data: {credit} ") if credit else "",
        last=len(record.views) - 1,
        clock=escape(first.clock),
        longest=max(len(frame.clock) for frame in record.views),  # so that the slider keeps its length
        **{name: first.images[name] for name in ("photo", "points", "scores")},
        **{f"{name}_text": escape(first.texts[name]) for name in ("points", "scores")},
        near=f"{near:g}",
        far=f"{far:g}",
        ramp=",".join(f"rgb{tuple(colour)}" for colour in depth_colours(np.geomspace(near, far, 9)).tolist()),
        network_size="{1} × {0} pixels".format(*network_size),
        heights_text=HEIGHTS_TEXT if story["uses_return_heights"] else "",
        heights_wire=HEIGHTS_WIRE if story["uses_return_heights"] else "",
        your_scores=_your_scores(first, camera, comparison),
        grids="\n".join(_single_or_pair(panel, record, camera) for panel in shown),
        states=_swatches(zip(STATE_NAMES, STATE_COLOURS, strict=True)),
        classes=_swatches(record.classes()),
        metrics=_metrics(record, learned) if record.labelled else "",
        times=_times(record),
        frames=_json([vars(frame) for frame in record.views]),
    )


def _single_or_pair(panel: Panel, record: Record, camera: Camera) -> str:
    """Return a panel as a figure; in a comparison, if they can differ, the package's and the student's side by side."""
    comparison = record.comparison
    if comparison is None or panel.name not in comparison.changed:
        return _figure(panel, record, camera)
    package = panel._replace(title=f"{panel.title}, the package's")
    title = f"{panel.title}, {comparison.file}"
    symbol = panel.symbol.removesuffix(" after the CRF")
    yours = Panel(YOURS + panel.name, title, symbol, comparison.made_with(panel.name))
    return f'<div class="pair">{_figure(package, record, camera)}{_figure(yours, record, camera)}</div>'


def _figure(panel: Panel, record: Record, camera: Camera) -> str:
    first = record.views[0]
    raster = first.images.get(panel.name, "")
    text = escape(first.texts.get(panel.name, ""))
    svg = grid_svg(panel.name, record.spec, camera, raster, text, arrows=panel.name in first.arrows)
    hidden = " hidden" if panel.name in first.images else ""
    missing = f'<p class="note" data-missing="{panel.name}"{hidden}>Nobody labelled this frame.</p>'
    symbol = f" <i>{panel.symbol}</i>" if panel.symbol else ""
    return f"<figure>{svg}{missing}<figcaption><b>{escape(panel.title)}</b>{symbol} — {panel.see}</figcaption></figure>"


def _column_svg(camera: Camera) -> str:
    """Return an empty layer over an image, in which the script draws the points above a cell (eq. (1))."""
    height, width = camera.size
    return f'<svg data-column viewBox="-0.5 -0.5 {width} {height}" aria-hidden="true"></svg>'


def _your_scores(first: FrameView, camera: Camera, comparison: Comparison | None) -> str:
    """Return the figure of the image scores of a student's own network; empty when the package's made the scores."""
    if comparison is None or "scores" not in comparison.changed:
        return ""
    name = f"{YOURS}scores"
    image = first.images[name]
    text = escape(first.texts[name])
    return (
        f'\n<figure>\n<div class="stack"><img data-image="photo" src="{first.images["photo"]}" alt="">'
        f'<img data-image="{name}" data-text="{name}" src="{image}" alt="{text}">{_column_svg(camera)}</div>\n'
        f"<figcaption><b>Image scores, {escape(comparison.file)}</b> <i>s</i> — {comparison.made_with('scores')}"
        "</figcaption>\n</figure>"
    )


def _broken(error: str) -> str:
    """Return the notice that the drive could not be read to its end."""
    notice = '<p class="notice"><b>The drive could not be read to its end.</b> The page shows what came before: {}</p>'
    return notice.format(escape(error)) if error else ""


def _left_out(lines: Sequence[str]) -> str:
    """Return the notice that says which frames could not be read."""
    notice = '<p class="notice"><b>Damaged frames were left out: {}.</b> {}</p>'
    return notice.format(len(lines), "<br>".join(map(escape, lines[:MOST_LEFT_OUT]))) if lines else ""


def _notice(expected: str) -> str:
    """Return the notice that says what to expect of the classes."""
    first, _, rest = escape(expected).partition(". ")
    return _filled("notice.html", first=first.removesuffix("."), rest=rest) if expected else ""


def _lead(record: Record, title: str, choice: str) -> str:
    spec = record.spec
    return _filled(
        "lead.html",
        comparison=f"{record.comparison.lead()} " if record.comparison else "",
        n_frames=len(record.views),
        title=escape(title),
        choice=choice,
        length=f"{spec.x_max - spec.x_min:g}",
        width=f"{spec.y_max - spec.y_min:g}",
    )


def _metrics(record: Record, learned: bool) -> str:
    """Return the table of metrics, in per cent."""
    metrics = record.metrics()
    where = LEARNED if learned else ""
    head = "".join(f"<th>{escape(column)}</th>" for column in metrics)
    cells = {row: [f"<td>{100 * values[row]:.1f}</td>" for values in metrics.values()] for row in metrics["FmIoU"]}
    rows = "".join(f"<tr><th>{_breakable(row)}</th>{''.join(values)}</tr>" for row, values in cells.items())
    compared = (COMPARED if record.comparison else "") + (REMEMBERED if "remember" in record.stages else "")
    crf = _crf_costs(metrics)
    return _filled(
        "metrics.html", where=where, crf=crf, labelled=record.labelled, compared=compared, head=head, rows=rows
    )


def _crf_costs(metrics: dict[str, dict[str, float]]) -> str:
    """Return a sentence if the CRF costs the package's map class accuracy, else nothing."""
    rows = [f"semantic cells, {row}" for row in ("network", "network + CRF")]
    if not all(row in metrics["class accuracy"] for row in rows):
        return ""
    pixels, classes = ([metrics[name][row] for row in rows] for name in ("pixel accuracy", "class accuracy"))
    if classes[1] >= classes[0]:
        return ""
    without, refined = (100 * one for one in classes)
    said = CRF_COSTS[pixels[1] < pixels[0]]
    return f"{said}: class accuracy over semantic cells is {without:.1f} % without it and {refined:.1f} % with it."


def _times(record: Record) -> str:
    """Return the table of the stages' times beside the LIDAR's period."""
    runs = [record.milliseconds()]
    heads = ["ms"]
    replaced = ()
    comparison = record.comparison
    if comparison:
        runs.append(record.milliseconds(YOURS))
        replaced = comparison.stages
        heads = ["the package's, ms", f"{_breakable(comparison.file)}, ms"]
    totals = [{"all": sum(run.values())} for run in runs]
    full = max(SCAN_MILLISECONDS, *(total["all"] for total in totals))
    rows = [
        _time_row(symbols, f"{words}; replaced by <b>{stage}</b>" if stage in replaced else words, runs, stage, full)
        for stage, (symbols, words) in ((stage, STAGE_WORDS[stage]) for stage in record.stages)
    ]
    return _filled(
        "times.html",
        full=f"{full:.0f}",
        period=f"{SCAN_MILLISECONDS:g}",
        upper=" The upper bar is the package's." if comparison else "",
        heads="".join(f"<th>{head}</th>" for head in heads),
        rows="".join(rows) + _time_row("", "all stages", totals, "all", full, kind="total"),
    )


def _time_row(
    symbols: str, words: str, runs: list[dict[str, float]], stage: str, full: float, kind: str = "stage"
) -> str:
    values = [run[stage] for run in runs]
    numbers = "".join(f"<td>{value:.1f}</td>" for value in values)
    bars = "".join(f'<span style="width:{100 * v / full:.1f}%"></span>' for v in values)
    return f'<tr class="{kind}"><th><i>{symbols}</i></th><th>{words}</th>{numbers}<td class="share">{bars}</td></tr>'


def _breakable(text: str) -> str:
    """Escape a text, and let the browser break a long file name after each underscore."""
    return escape(text).replace("_", "_<wbr>")


def _json(data: object) -> str:
    """Return data for a script element as JSON in which no text can end that element."""
    return json.dumps(data).replace("<", "\\u003c")


def _swatches(colours: Iterable[tuple[str, tuple[int, int, int]]]) -> str:
    return "".join(
        f'<span style="--swatch:rgb{tuple(rgb)}" data-texture="{name}">{name}</span>'
        for name, rgb in ((escape(name), rgb) for name, rgb in colours)
    )


def _filled(name: str, **words: object) -> str:
    return Template(_resource(name)).substitute(words)


def _resource(name: str) -> str:
    return files("semgrid_edu.workshop.demo").joinpath(name).read_text(encoding="utf-8")
