"""Tables of the page: how often the grids are right, and how long each stage takes (section 4.2)."""

from html import escape

from semgrid_edu.demo.comparison import STAGE_WORDS, Comparison
from semgrid_edu.occupancy.tracking import LIDAR_PERIOD

SCAN_MILLISECONDS = 1000 * LIDAR_PERIOD
"""Time from one scan of KITTI's LIDAR to the next, ms."""

COMPARED = " The package's occupancy grid names the unknown cells of the truth, so that both runs have the same truth."
UPPER_BAR = " The upper bar is the package's."


def metrics_table(metrics: dict[str, dict[str, float]], labelled: int, comparison: Comparison | None = None) -> str:
    """Return a table of values in per cent.

    Parameters
    ----------
    metrics : dict of str to dict of str to float
        Values, 0..1, by column and row.
    labelled : int
        Number of frames with truth.
    comparison : Comparison, optional
        Which stages come from a student's file, when some rows are about a second run with them.

    Returns
    -------
    str
        A div element.
    """
    head = "".join(f"<th>{escape(column)}</th>" for column in metrics)
    rows = "".join(_metrics_row(row, metrics) for row in next(iter(metrics.values())))
    return (
        "<div><table><caption><b>How often it is right</b>In per cent, over the "
        f"{labelled} frames whose truth is known. Pixel accuracy is the share of cells with the right class. Class "
        "accuracy is the mean over the classes, so a rare class counts as much as road. FmIoU is the intersection over "
        "union of each class with its truth, weighted by how often the class occurs. Semantic cells are those whose "
        "truth is none of the unknown classes."
        f"{COMPARED if comparison else ''}</caption>"
        f"<thead><tr><th></th>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _metrics_row(row: str, metrics: dict[str, dict[str, float]]) -> str:
    cells = "".join(f"<td>{100 * values[row]:.1f}</td>" for values in metrics.values())
    return f"<tr><th>{_breakable(row)}</th>{cells}</tr>"


def times_table(
    milliseconds: dict[str, float],
    yours: dict[str, float] | None = None,
    comparison: Comparison | None = None,
) -> str:
    """Return a table of the stages' times beside the LIDAR's period.

    Parameters
    ----------
    milliseconds : dict of str to float
        Median time of each stage per frame, ms, by the names in `pipeline.STAGES`.
    yours : dict of str to float, optional
        The same for a second run with a student's stages.
    comparison : Comparison, optional
        Which stages come from the student's file; needed with `yours`.

    Returns
    -------
    str
        A div element.
    """
    runs = [milliseconds, yours] if comparison else [milliseconds]
    replaced = comparison.stages if comparison else ()
    rows = "".join(_time_row(*_words(stage, replaced), [run[stage] for run in runs]) for stage in milliseconds)
    total = _time_row("", "all stages", [sum(run.values()) for run in runs], "total")
    heads = ["the package's, ms", f"{_breakable(comparison.file)}, ms"] if comparison else ["ms"]
    return (
        "<div><table><caption><b>How long it takes</b>Median time for a frame on the computer that made this page, "
        f"without a GPU. A full bar is at least {SCAN_MILLISECONDS:g}&nbsp;ms, the time from one scan of KITTI's LIDAR "
        f"to the next.{UPPER_BAR if comparison else ''}</caption>"
        f"<thead><tr><th></th><th></th>{''.join(f'<th>{head}</th>' for head in heads)}<th></th></tr></thead>"
        f"<tbody>{rows}{total}</tbody></table></div>"
    )


def _breakable(text: str) -> str:
    """Escape a text in which a long name of a file may go on in the next line after each underscore."""
    return escape(text).replace("_", "_<wbr>")


def _words(stage: str, replaced: tuple[str, ...]) -> tuple[str, str]:
    """Return symbols and words of a stage; the words also name the student's stage that replaces it, if one does."""
    symbols, words = STAGE_WORDS[stage]
    return symbols, f"{words}; replaced by <b>{stage}</b>" if stage in replaced else words


def _time_row(symbols: str, words: str, values: list[float], kind: str = "stage") -> str:
    numbers = "".join(f"<td>{value:.1f}</td>" for value in values)
    bars = "".join(f'<span style="width:{min(100.0, 100 * v / SCAN_MILLISECONDS):.1f}%"></span>' for v in values)
    return f'<tr class="{kind}"><th><i>{symbols}</i></th><th>{words}</th>{numbers}<td class="share">{bars}</td></tr>'
