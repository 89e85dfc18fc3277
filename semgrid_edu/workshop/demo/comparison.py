"""A student's stages beside the package's own: which pictures they can change, and what the page says of them.

Tables of the page: how often the grids are right, and how long each stage takes (section 4.2).
"""

from dataclasses import dataclass
from html import escape

from semgrid_edu.occupancy.cmcdot import LIDAR_PERIOD
from semgrid_edu.pipeline import STAGES

MADE_BY = {
    "scores": ("segment",),
    "occupancy": ("track",),
    "grid": ("track", "segment", "sample", "fuse"),
    "refined": tuple(STAGES),
}
"""The stages that a picture depends on."""

STAGE_WORDS = {
    "track": ("l → o", "Bayes filter, CMCDOT"),
    "segment": ("i → s", "image network"),
    "sample": ("s → p", "sampling on planes"),
    "fuse": ("(p, o) → g", "reduction and fusion"),
    "refine": ("g → g", "CRF, mean field"),
}
"""Input and output of each stage, in the symbols of the paper's Fig. 2, and what the package's own stage does."""


@dataclass(frozen=True)
class Comparison:
    """Which stages of the second run come from a student's file; all others are the package's own in both runs.

    Parameters
    ----------
    file : str
        Name of the student's file, without its folder.
    stages : tuple of str
        Names of the stages that the file holds, such as ("track", "refine").
    """

    file: str
    stages: tuple[str, ...]

    @property
    def changed(self) -> tuple[str, ...]:
        """The pictures that these stages can change. The page shows each of them twice."""
        return tuple(name for name, stages in MADE_BY.items() if set(stages) & set(self.stages))

    def lead(self) -> str:
        """Return the sentences that open the page, as HTML."""
        named = _listed([f"<b>{name}</b> ({STAGE_WORDS[name][0]})" for name in self.stages])
        return (
            f"This page compares two runs over the same frames. The first is the package's own. In the second, {named} "
            f"{'comes' if len(self.stages) == 1 else 'come'} from <b>{escape(self.file)}</b>, and the other stages are "
            "the package's. A picture that can differ is shown twice, the package's first."
        )

    def made_with(self, picture: str) -> str:
        """Say which of the file's stages a picture depends on.

        Parameters
        ----------
        picture : str
            Name of the picture, a key of `MADE_BY`.

        Returns
        -------
        str
            Two sentences, as HTML.
        """
        stages = [f"<b>{name}</b>" for name in self.stages if name in MADE_BY[picture]]
        return f"Made with {_listed(stages)} of {escape(self.file)}. Where does it differ from the package's picture?"


def _listed(words: list[str]) -> str:
    """Join words as in a sentence: "a, b and c"."""
    *others, last = words
    return f"{', '.join(others)} and {last}" if others else last


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
