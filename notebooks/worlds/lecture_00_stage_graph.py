"""The graph of one stage of the system: its model, its drawing, and the edges that the real system cuts."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from matplotlib.axes import Axes

from semgrid_edu.graphical import Dashed, Factor, GraphicalModel, draw


class Price(NamedTuple):
    """The cost of one cut edge on a toy world: the question, the exact answer, and the answer without the edge."""

    exact: float
    system: float
    unit: str

    @property
    def text(self) -> str:
        """The label of the edge with both numbers, such as ".34 → .57"."""
        return f"{short(self.exact)} \u2192 {short(self.system)}"


def short(number: float) -> str:
    """Round a number >= 0 to two decimals, or to three if two would hide it.

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
    cost : str
        One sentence: what the system leaves out, and what that costs.
    ends : tuple of str
        The two nodes of the drawing that the dashed line joins.
    price : callable, optional
        Measures the cost by exact inference.
    bend, at : float
        Curvature of the line, and the position of the price on it: see `Dashed`.
    """

    edge: str
    cost: str
    ends: tuple[str, str]
    price: Callable[[], Price] | None = None
    bend: float = 0.0
    at: float = 0.5


def directed(factors: Iterable[Factor]) -> GraphicalModel:
    """Return the directed model of conditional distributions P(last variable | all others), one per variable."""
    factors = tuple(factors)
    return GraphicalModel(factors, {factor.names[-1]: factor.names[:-1] for factor in factors})


def binary(name: str, p: float) -> Factor:
    """Return P(name) of a variable that is 1 with probability p, else 0."""
    return Factor(name, [1 - p, p])


def with_gaps(names: Iterable[str]) -> list[str | None]:
    """Return a row for `in_rows` with a gap between neighbours."""
    return [place for name in names for place in (name, None)][:-1]


@dataclass(frozen=True, eq=False)
class StageGraph:
    """One stage of the paper as a graphical model of toy size.

    Parameters
    ----------
    title : str
        The stage, in a few words.
    model : GraphicalModel
        Small enough for exact inference; its numbers come from the package.
    positions : dict of str to (float, float)
        Where each node is drawn: x to the right, y upwards, neighbours about 1 apart.
    observed : tuple of str
        The observed variables; drawn shaded.
    labels, equations : dict of str to str
        Text in each node, and to its right: see `draw`.
    plates : dict of str to tuple of str
        Nodes that are repeated for every cell, beam or step, by the text of the box around them.
    cut : tuple of CutEdge
        The edges that the real system cuts.
    ghosts : dict of str to (float, float)
        Ends of cut edges that the toy model leaves out, and where they are drawn.
    """

    title: str
    model: GraphicalModel
    positions: Mapping[str, tuple[float, float]]
    observed: tuple[str, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)
    equations: Mapping[str, str] = field(default_factory=dict)
    plates: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    cut: tuple[CutEdge, ...] = ()
    ghosts: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def draw(self, ax: Axes | None = None, highlight: Iterable[str] = ()) -> Axes:
        """Draw the graph. Each cut edge is dashed and carries its price: exact answer, arrow, the system's answer."""
        ax = draw(
            self.model,
            ax,
            positions=self.positions,
            observed=self.observed,
            highlight=highlight,
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
        """The cut edges to draw: those with both ends in this graph (a shorter row of cells lacks some)."""
        drawn = {*self.model.names, *self.ghosts}
        shown = [edge for edge in self.cut if drawn.issuperset(edge.ends)]
        texts = [edge.price().text if edge.price else "" for edge in shown]
        return [
            Dashed(edge.ends, text, " - " not in edge.edge, edge.bend, edge.at)
            for edge, text in zip(shown, texts, strict=True)
        ]
