"""The graph of a stage: its model, how it is drawn, and the edges that the real system cuts."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes

from semgrid_edu.graphical.drawing import draw
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.model import GraphicalModel


class CutEdge(NamedTuple):
    """A dependence of the exact model that the real system leaves out.

    Parameters
    ----------
    edge : str
        Its two ends, such as "m1 - m2" or "s -> o".
    price : str
        One sentence: what the system leaves out there, and what that costs.
    """

    edge: str
    price: str


CATALOGUE = Path(__file__).with_name("cut_edges.toml")
"""The cut edges of all stages, in the order of the pipeline."""


def cut_edges(stage: str) -> tuple[CutEdge, ...]:
    """Return what the real system cuts in one stage.

    Parameters
    ----------
    stage : str
        A key of `CATALOGUE`, such as "bof".
    """
    return tuple(CutEdge(**edge) for edge in tomllib.loads(CATALOGUE.read_text(encoding="utf-8"))[stage])


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
    """

    title: str
    model: GraphicalModel
    observed: tuple[str, ...] = ()
    positions: Mapping[str, tuple[float, float]] | None = None
    labels: Mapping[str, str] = field(default_factory=dict)
    equations: Mapping[str, str] = field(default_factory=dict)
    plates: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    cut: tuple[CutEdge, ...] = ()

    def draw(self, ax: Axes | None = None, highlight: Iterable[str] = ()) -> Axes:
        """Draw the graph.

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
        )
        ax.set_title(self.title, wrap=True)
        return ax
