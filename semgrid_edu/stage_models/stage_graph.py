"""The graph of a stage: its model, how it is drawn, and the edges that the real system cuts."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import NamedTuple

from matplotlib.axes import Axes

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.drawing import Dashed, draw
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.storage.files import table_beside


class Price(NamedTuple):
    """What one cut edge costs, on a toy world where the exact answer is known.

    Parameters
    ----------
    exact, system : float
        The exact answer, and what comes out without the edge.
    unit : str
        What the two numbers are.
    """

    exact: float
    system: float
    unit: str

    @property
    def text(self) -> str:
        """The two numbers as they are written on the edge, such as ".34 → .57"."""
        return f"{short(self.exact)} \u2192 {short(self.system)}"


def short(number: float) -> str:
    """Write a number with two digits behind the point, or three where two would leave nothing of it.

    Parameters
    ----------
    number : float
        Not negative.

    Examples
    --------
    >>> short(0.3), short(0.0512), short(0.998), short(1.241), short(1), short(0)
    ('.30', '.051', '.998', '1.24', '1', '0')
    """
    digits = 3 if number < 0.0995 or 0.995 <= number < 0.9985 else 2
    written = f"{number:.{digits}f}"
    return f"{float(written):.0f}" if float(written).is_integer() else written.removeprefix("0")


class CutEdge(NamedTuple):
    """A dependence of the exact model that the real system leaves out.

    Parameters
    ----------
    edge : str
        Its two ends, such as "m1 - m2" or "s -> o".
    price : str
        One sentence: what the system leaves out there, and what that costs.
    ends : tuple of str
        The two drawn nodes that the dashed line joins.
    measure : str
        Name of the function of `stage_models.prices` that measures the price; empty where none has been measured.
    bend, at : float
        The line's curvature and the place of the price on it, as `Dashed` takes them.
    """

    edge: str
    price: str
    ends: tuple[str, ...] = ()
    measure: str = ""
    bend: float = 0.0
    at: float = 0.5

    def measured(self) -> Price | None:
        """Measure the price by exact inference; None where the edge has no measure."""
        return measured_by(self.measure) if self.measure else None


@cache
def measured_by(measure: str) -> Price:
    """Return a price, measured once per process.

    Parameters
    ----------
    measure : str
        Name of a function of `stage_models.prices`.
    """
    exact, system, unit = getattr(import_module("semgrid_edu.stage_models.prices"), measure)()  # imports all stages
    return Price(float(exact), float(system), unit)


CATALOGUE = table_beside(__file__, "cut_edges")
"""The cut edges of each stage, and under "lectures" the lecture that shows it, in the order of the lectures."""


def cut_edges(stage: str) -> tuple[CutEdge, ...]:
    """Return what the real system cuts in one stage.

    Parameters
    ----------
    stage : str
        A key of `CATALOGUE`, such as "bof".
    """
    return tuple(CutEdge(**edge) for edge in CATALOGUE[stage])


def directed(factors: Iterable[Factor]) -> GraphicalModel:
    """Return a directed model of factors that have their child as the last variable: P(last | all others).

    Parameters
    ----------
    factors : iterable of Factor
        One per variable.
    """
    factors = tuple(factors)
    return GraphicalModel(factors, {factor.names[-1]: factor.names[:-1] for factor in factors})


def binary(name: str, p: float) -> Factor:
    """Return P(name): a variable without parents that is 1 with probability p, and 0 otherwise.

    Parameters
    ----------
    name : str
        The variable.
    p : float
        Its probability of being 1.
    """
    return Factor(name, [1 - p, p])


def with_gaps(names: Iterable[str]) -> list[str | None]:
    """Return a row for `in_rows` with a gap between neighbours.

    Parameters
    ----------
    names : iterable of str
        The nodes from left to right.
    """
    return [place for name in names for place in (name, None)][:-1]


@dataclass(frozen=True, eq=False)
class StageGraph:
    """One stage of the paper as a graphical model of toy size.

    Parameters
    ----------
    title : str
        The stage, in a few words.
    model : GraphicalModel
        Built from the package's own functions, small enough for exact inference.
    observed : tuple of str
        The variables that are observed; drawn shaded.
    positions : dict of str to (float, float), optional
        Place of each node: x to the right and y upwards, neighbours about 1 apart. Placed automatically when left out.
    labels, equations : dict of str to str
        Text in each node and to the right of it, as `drawing.draw` takes them.
    plates : dict of str to tuple of str
        The nodes that are repeated for every cell, beam or step, by the text of the box around them.
    cut : tuple of CutEdge
        The edges that the real system cuts, and what that costs.
    ghosts : dict of str to (float, float)
        Nodes that the toy model leaves out, by name, and where they stand: ends of cut edges.
    """

    title: str
    model: GraphicalModel
    observed: tuple[str, ...] = ()
    positions: Mapping[str, tuple[float, float]] | None = None
    labels: Mapping[str, str] = field(default_factory=dict)
    equations: Mapping[str, str] = field(default_factory=dict)
    plates: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    cut: tuple[CutEdge, ...] = ()
    ghosts: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def draw(self, ax: Axes | None = None, highlight: Iterable[str] = ()) -> Axes:
        """Draw the graph, with each cut edge dashed and its price on it: exact answer, arrow, the system's answer.

        A cut edge isn't drawn where this graph doesn't have both its ends, as in a shorter row of cells.

        Parameters
        ----------
        ax : Axes, optional
            Axes to draw into; new ones when left out.
        highlight : iterable of str
            The nodes that the text is about; drawn with a thick coloured outline.

        Returns
        -------
        Axes
            The axes with the drawing, and the title above it.
        """
        ax = draw(
            self.model,
            ax,
            observed=self.observed,
            highlight=highlight,
            positions=self.positions,
            labels=self.labels,
            equations=self.equations,
            plates=self.plates,
            dashed=self.dashed,
            ghosts=self.ghosts,
        )
        ax.set_title(self.title, wrap=True)
        return ax

    @property
    def dashed(self) -> list[Dashed]:
        """The cut edges as they are drawn."""
        drawn = {*self.model.names, *self.ghosts}
        shown = [edge for edge in self.cut if edge.ends and drawn.issuperset(edge.ends)]
        prices = [edge.measured() for edge in shown]
        texts = [price.text if price else "" for price in prices]
        return [
            Dashed(edge.ends, text, " - " not in edge.edge, edge.bend, edge.at)
            for edge, text in zip(shown, texts, strict=True)
        ]


class LedgerLine(NamedTuple):
    """One cut edge and its price.

    Parameters
    ----------
    stage : str
        A key of `CATALOGUE`, such as "bof".
    edge : str
        The edge that is cut.
    exact, system : float
        The exact answer, and what comes out without the edge.
    unit : str
        What the two numbers are.
    lecture : str
        Number of the lecture that shows it, such as "03".
    """

    stage: str
    edge: str
    exact: float
    system: float
    unit: str
    lecture: str


def ledger(stage: str | None = None) -> tuple[LedgerLine, ...]:
    """Measure the price of every cut edge that has a measure, in the order of the lectures.

    Parameters
    ----------
    stage : str, optional
        A key of `CATALOGUE`; all stages when left out, which takes a few seconds.
    """
    lectures = CATALOGUE["lectures"]
    if stage is not None and stage not in lectures:
        raise ArgumentError("stage", f"one of {', '.join(lectures)}", stage)
    lines = []
    for name in lectures if stage is None else [stage]:
        prices = {edge.edge: edge.measured() for edge in cut_edges(name)}
        lines += [LedgerLine(name, edge, *price, lectures[name]) for edge, price in prices.items() if price]
    return tuple(lines)


def ledger_table(lines: Iterable[LedgerLine]) -> str:
    """Return lines of the ledger as a Markdown table, one row per cut edge.

    Parameters
    ----------
    lines : iterable of LedgerLine
        What `ledger` returns, or a part of it.
    """
    rows = ["| lecture | stage | edge cut | what is asked | exact | the system |", "|---|---|---|---|---|---|"]
    for line in lines:
        numbers = [short(line.exact), short(line.system)]
        rows.append("| " + " | ".join([line.lecture, line.stage, f"`{line.edge}`", line.unit, *numbers]) + " |")
    return "\n".join(rows)
