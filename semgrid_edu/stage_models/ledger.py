"""The ledger of cut edges: what each stage leaves out of its exact model, and what that costs."""

import tomllib
from collections.abc import Iterable
from typing import NamedTuple

from semgrid_edu.errors import ArgumentError
from semgrid_edu.stage_models.stage_graph import CATALOGUE, cut_edges, short


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
    lectures = tomllib.loads(CATALOGUE.read_text(encoding="utf-8"))["lectures"]
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
