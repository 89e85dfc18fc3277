"""Discrete graphical models, small enough for exact inference: a common language for every stage.

A model is a product of factors. `enumerate_marginals` implements the definition of inference, `eliminate` and
`max_product` are exact and efficient, `sum_product` is exact on trees, and `mean_field_graph` is approximate.
`d_separated` reads independences off the graph, and `draw` plots it.
"""

from semgrid_edu.graphical.drawing import draw
from semgrid_edu.graphical.exact import eliminate, enumerate_marginals, log_total, max_product, min_fill_order
from semgrid_edu.graphical.factor import Factor, product
from semgrid_edu.graphical.mean_field import mean_field_graph
from semgrid_edu.graphical.messages import Beliefs, sum_product
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.places import Dashed, in_rows
from semgrid_edu.graphical.separation import d_separated, why_dependent
from semgrid_edu.metrics import total_variation

__all__ = [
    "Beliefs",
    "Dashed",
    "Factor",
    "GraphicalModel",
    "d_separated",
    "draw",
    "eliminate",
    "enumerate_marginals",
    "in_rows",
    "log_total",
    "max_product",
    "mean_field_graph",
    "min_fill_order",
    "product",
    "sum_product",
    "total_variation",
    "why_dependent",
]
