"""Models: what they collect from their factors, and what they refuse."""

import re

import numpy as np
import pytest
from random_models import one_of_you

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, GraphicalModel

COIN = Factor("x", [0.5, 0.5])
COPY = Factor(("x", "y"), np.eye(2))


def test_a_directed_model_knows_its_variables_and_factors():
    model = one_of_you()
    assert model.cardinalities == {"m1": 2, "m2": 2, "z": 2}
    assert model.labels == ("P(m1)", "P(m2)", "P(z | m1, m2)")
    assert model.parents == {"m1": (), "m2": (), "z": ("m1", "m2")}
    assert model.directed
    assert not model.given(z=1).directed


def test_every_factor_of_an_undirected_model_has_its_own_label():
    model = GraphicalModel([COIN, COPY, COIN])
    assert model.labels == ("f(x)", "f(x, y)", "f(x) #2")
    assert model.neighbours == {"x": {"y"}, "y": {"x"}}


def test_weights_by_hand():
    """The four maps of two cells: 0.16, 0.16, 0.04 agree with "one of you", 0.64 doesn't."""
    weights = {(a, b): one_of_you().weight({"m1": a, "m2": b, "z": 1}) for a in (0, 1) for b in (0, 1)}
    assert weights == pytest.approx({(0, 0): 0, (0, 1): 0.16, (1, 0): 0.16, (1, 1): 0.04})
    assert one_of_you().weight({"m1": np.True_, "m2": False, "z": np.int8(1)}) == pytest.approx(0.16)


def test_slicing_keeps_one_factor_for_each():
    sliced = one_of_you().given(z=1, m1=0)
    assert [factor.names for factor in sliced.factors] == [(), ("m2",), ("m2",)]


@pytest.mark.parametrize(
    ("factors", "parents", "says"),
    [
        ([COIN, Factor(("x", "y"), np.ones((3, 2)))], None, "variable x: expected 2 states in every factor, found 3"),
        ([COIN, Factor(("x", "y"), [[1, 0], [0.6, 0.6]])], {"y": ("x",)}, "P(y | x): expected a sum of 1 over y"),
        ([COIN, Factor(("x", "y"), [[1, 0], [0.6, 0.6]])], {"y": ("x",)}, "found 1.2 at x=1: normalise over y"),
        ([Factor("x", [0.5, 0.4])], {}, "P(x): expected a sum of 1 over x, found 0.9: normalise over x"),
        ([COPY, Factor(("y", "x"), np.eye(2))], {"y": ("x",), "x": ("y",)}, "no cycle of arrows, found x -> y -> x"),
        ([COPY], {"y": ("x",)}, "exactly one factor over (x)"),
        ([COIN, COIN, COPY], {"y": ("x",)}, "exactly one factor over (x)"),
        ([COIN, COPY, Factor(("x", "y"), np.eye(2))], {"y": ("x",)}, "exactly one factor over (y, x)"),
        ([COIN, COPY, Factor((), 2.0)], {"y": ("x",)}, "one per variable, 2 in all, found 3"),
        ([COIN, COPY], {"y": ("w",)}, "parents: expected variables among"),
        ([COIN, COPY], {"y": ("x",), "w": ("x",)}, "parents: expected variables among"),
        ([COIN, np.eye(2)], None, "objects of the class Factor, found ndarray"),
    ],
)  # fmt: skip
def test_wrong_models_are_refused_with_the_reason(factors, parents, says):
    with pytest.raises(ArgumentError, match=re.escape(says)):
        GraphicalModel(factors, parents)


def test_unknown_names_and_states_are_refused():
    with pytest.raises(ArgumentError, match="found w"):
        one_of_you().given(w=1)
    with pytest.raises(ArgumentError, match="given z: expected a state from 0 to 1, found 2"):
        one_of_you().given(z=2)
    with pytest.raises(ArgumentError, match="none for m2, z"):
        one_of_you().weight({"m1": 0})
