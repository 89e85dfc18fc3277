"""Factors: products, sums and slices by hand, the laws they obey, and what they refuse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, product

XY = Factor(("x", "y"), [[1, 2, 3], [4, 5, 6]])


def test_a_product_by_hand():
    both = Factor("y", [1, 0, 2]) * XY
    assert both.names == ("y", "x")
    assert both.table.tolist() == [[1, 4], [0, 0], [6, 12]]


def test_sums_maxima_and_slices_by_hand():
    assert XY.sum("x").table.tolist() == [5, 7, 9]
    assert XY.sum("x", "y").table == 21
    assert XY.marginal("y").table.tolist() == [5, 7, 9]
    assert XY.max("y").table.tolist() == [3, 6]
    assert XY.given(x=1).table.tolist() == [4, 5, 6]
    assert XY.given(x=1, y=2).table == 6
    assert XY.given(y=np.int64(0)).names == ("x",)
    assert XY.normalised().table[1, 2] == 6 / 21


def test_axes_follow_the_order_of_names():
    assert XY.ordered("y", "x").table.tolist() == XY.table.T.tolist()
    assert XY.cardinalities == {"x": 2, "y": 3}


@given(st.integers(0, 10**6))
def test_products_commute_associate_and_let_sums_pass(seed):
    rng = np.random.default_rng(seed)
    f, g, h = (Factor(tuple(names), rng.random([2 + "xyz".index(n) for n in names])) for names in ("xy", "yz", "zx"))
    np.testing.assert_allclose((f * g).ordered("z", "x", "y").table, (g * f).ordered("z", "x", "y").table)
    np.testing.assert_allclose(((f * g) * h).table, (f * (g * h)).ordered("x", "y", "z").table)
    np.testing.assert_allclose((f * g).sum("z").table, (f * g.sum("z")).table)


def test_a_factor_keeps_its_own_table():
    table = np.ones(2)
    factor = Factor("x", table)
    table[0] = 5
    assert factor.table.tolist() == [1, 1]
    with pytest.raises(ValueError, match="read-only"):
        factor.table[0] = 5


@pytest.mark.parametrize(
    ("names", "table", "says"),
    [
        (("x", "x"), np.ones((2, 2)), "each variable once"),
        (("x",), np.ones((2, 2)), "one axis"),
        (("x",), np.ones(0), "at least one state"),
        (("x",), [1.0, -0.1], "none of them negative"),
        (("x",), [1.0, np.nan], "finite"),
        (("x",), [1.0, np.inf], "finite .* found inf"),
    ],
)
def test_bad_tables_are_refused(names, table, says):
    with pytest.raises(ArgumentError, match=says):
        Factor(names, table)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda: XY * Factor("y", [1, 1]), "variable y: expected 3 states"),
        (lambda: Factor("x", [1e200]) * Factor("x", [1e200]), "finite .* found inf"),
        (lambda: XY.sum("w"), "w"),
        (lambda: XY.marginal("w"), "w"),
        (lambda: XY.given(w=0), "w"),
        (lambda: XY.given(x=2), "given x: expected a state from 0 to 1, found 2"),
        (lambda: XY.given(x=-1), "found -1"),
        (lambda: XY.given(x=0.5), "found 0.5"),
        (lambda: XY.ordered("x"), "in some order"),
        (lambda: Factor("x", [0, 0]).normalised(), "no assignment agrees"),
    ],
)
def test_operations_name_what_is_wrong(wrong, says):
    with pytest.raises(ArgumentError, match=says):
        wrong()


def test_a_number_is_no_factor():
    with pytest.raises(TypeError, match="unsupported operand"):
        XY * 2


def test_entries_at_the_ends_of_the_range_of_floats_are_normalised():
    assert Factor("x", [1e308, 1e308]).normalised().table.tolist() == [0.5, 0.5]
    assert Factor("x", [5e-324, 5e-324]).normalised().table.tolist() == [0.5, 0.5]


@given(st.lists(st.just(0.0) | st.floats(1e-150, 1e150), min_size=1, max_size=5))
def test_taking_out_a_power_of_two_loses_no_bit(table):
    factor, power = Factor("x", table).rescaled()
    assert np.ldexp(factor.table, power).tolist() == table
    assert factor.table.max() == 0 or 0.5 <= factor.table.max() < 1


def test_a_product_too_large_is_refused_by_the_names_of_its_variables():
    many = [Factor(f"v{k}", np.ones(10)) for k in range(8)]
    with pytest.raises(ArgumentError, match=r"clique \(v0, v1, .*, v7\): .*10,000,000 entries, found 100,000,000"):
        product(many)
    assert product([]).table == 1
