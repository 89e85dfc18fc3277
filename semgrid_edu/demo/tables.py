"""Tables of the page: how often the grids are right, and how long each stage takes (section 4.2)."""

from html import escape

from semgrid_edu.occupancy.tracking import LIDAR_PERIOD

SCAN_MILLISECONDS = 1000 * LIDAR_PERIOD
"""From one scan of KITTI's LIDAR to the next."""

STAGE_WORDS = {
    "occupancy": ("l → o", "Bayes filter, CMCDOT"),
    "segmentation": ("i → s", "image network"),
    "planes": ("s → p", "sampling on planes"),
    "fusion": ("(p, o) → g", "reduction and fusion"),
    "crf": ("g → g", "CRF, mean field"),
}
"""Symbols and words of each stage of the pipeline."""


def metrics_table(metrics: dict[str, dict[str, float]], labelled: int) -> str:
    """Return a table of values in per cent.

    Parameters
    ----------
    metrics : dict of str to dict of str to float
        Values, 0..1, by column and row.
    labelled : int
        Frames with truth.
    """
    head = "".join(f"<th>{escape(column)}</th>" for column in metrics)
    rows = "".join(_metrics_row(row, metrics) for row in next(iter(metrics.values())))
    return (
        f"<div><table><caption><b>How often it is right</b>Per cent, over the {labelled} frames whose truth is known. "
        "Class accuracy: the mean over classes, so rare ones count as much as road. FmIoU: overlap of each class with "
        "its truth, weighted by how often it occurs. Semantic cells: those whose truth is none of the unknown "
        "classes.</caption>"
        f"<thead><tr><th></th>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _metrics_row(row: str, metrics: dict[str, dict[str, float]]) -> str:
    cells = "".join(f"<td>{100 * values[row]:.1f}</td>" for values in metrics.values())
    return f"<tr><th>{escape(row)}</th>{cells}</tr>"


def times_table(milliseconds: dict[str, float]) -> str:
    """Return a table of the stages' times beside the LIDAR's period.

    Parameters
    ----------
    milliseconds : dict of str to float
        By stage.
    """
    rows = "".join(_time_row(*STAGE_WORDS[stage], value) for stage, value in milliseconds.items())
    total = _time_row("", "all stages", sum(milliseconds.values()), "total")
    return (
        "<div><table><caption><b>How long it takes</b>Median of a frame, here, without a GPU. The LIDAR gives a scan "
        f"every {SCAN_MILLISECONDS:g} ms: that would be a full bar.</caption>"
        f"<thead><tr><th></th><th></th><th>ms</th><th></th></tr></thead><tbody>{rows}{total}</tbody></table></div>"
    )


def _time_row(symbols: str, words: str, value: float, kind: str = "stage") -> str:
    width = min(100.0, 100 * value / SCAN_MILLISECONDS)
    bar = f'<td class="share"><span style="width:{width:.1f}%"></span></td>'
    return f'<tr class="{kind}"><th><i>{symbols}</i></th><th>{words}</th><td>{value:.1f}</td>{bar}</tr>'
