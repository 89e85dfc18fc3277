"""Mean field on graphs: its free energy falls to a bound of -log Z, zeros included."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from random_models import assignments, one_of_you, random_directed, random_undirected

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, GraphicalModel, eliminate, mean_field_graph

TIE = np.array([[3.0, 1.0], [1.0, 3.0]])


def free_energy(model, q):
    """E[log Q] - E[log product of factors] by summing over every assignment."""
    total = 0.0
    for assignment in assignments(model):
        p = np.prod([q[name][state] for name, state in assignment.items()])
        total += p * (np.log(p) - np.log(model.weight(assignment))) if p > 0 else 0.0
    return total


@settings(max_examples=20, deadline=None)
@given(st.sampled_from([random_directed, random_undirected]), st.integers(0, 10**6), st.sampled_from([None, 1]))
def test_the_free_energy_never_rises_and_bounds_log_z(make, seed, start):
    model = make(seed, variables=5)
    beliefs = mean_field_graph(model, seed=start)
    assert len(beliefs.free_energy) == beliefs.iterations
    assert (np.diff(beliefs.free_energy) <= 1e-12).all()
    assert beliefs.free_energy[-1] >= -np.log(eliminate(model, ()).table) - 1e-12
    assert beliefs.free_energy[-1] == pytest.approx(free_energy(model, beliefs.marginals), abs=1e-10)


@settings(max_examples=20, deadline=None)
@given(st.sampled_from([random_directed, random_undirected]), st.integers(0, 10**6), st.sampled_from([None, 1]))
def test_with_forbidden_combinations_it_stays_at_what_is_allowed(make, seed, start):
    """Infinite while Q allows what a factor forbids; once finite, it stays finite and falls."""
    model = make(seed, variables=5, zeros=0.3)
    assume(all(factor.table.any() for factor in model.factors))
    beliefs = mean_field_graph(model, seed=start)
    finite = np.isfinite(beliefs.free_energy)
    assert (np.diff(finite.astype(int)) >= 0).all()
    assert (np.diff(beliefs.free_energy[finite]) <= 1e-12).all()
    if finite.any():
        assert beliefs.free_energy[-1] == pytest.approx(free_energy(model, beliefs.marginals), abs=1e-10)
        assert beliefs.free_energy[-1] >= -np.log(eliminate(model, ()).table) - 1e-12


def test_without_coupling_it_is_exact():
    model = GraphicalModel([Factor("x", [1, 3]), Factor("y", [2, 2]), Factor("x", [1, 1]), Factor(("x", "w"), TIE)])
    beliefs = mean_field_graph(model, {"w": 0})
    assert beliefs.exact
    np.testing.assert_allclose(beliefs.marginals["x"], [0.5, 0.5])
    assert beliefs.free_energy[-1] == pytest.approx(-np.log(eliminate(model, (), {"w": 0}).table))


def test_an_update_is_the_fixed_point_equation():
    """At convergence q_i ~ exp(sum_j q_j log f_ij), written out for two variables."""
    prior = np.array([0.4, 0.6])
    beliefs = mean_field_graph(GraphicalModel([Factor("x", prior), Factor(("x", "y"), TIE)]), iterations=500)
    assert beliefs.converged
    assert not beliefs.exact
    x, y = beliefs.marginals["x"], beliefs.marginals["y"]
    wanted = prior * np.exp(np.log(TIE) @ y)
    np.testing.assert_allclose(x, wanted / wanted.sum(), atol=1e-9)


def test_a_seed_breaks_a_symmetry_that_the_default_start_keeps():
    """Two spins tied so strongly that two mirrored minima lie below the symmetric point."""
    spins = GraphicalModel([Factor(("x", "y"), TIE**3)])
    still, broken = mean_field_graph(spins), mean_field_graph(spins, seed=0)
    assert still.marginals["x"].tolist() == [0.5, 0.5]
    assert broken.free_energy[-1] < still.free_energy[-1] - 0.1
    np.testing.assert_array_equal(mean_field_graph(spins, seed=0).marginals["x"], broken.marginals["x"])


def test_a_hard_tie_is_settled_by_the_start():
    """x = y: only one corner or the other has finite free energy, and the prior says which."""
    model = GraphicalModel([Factor("x", [0.3, 0.7]), Factor(("x", "y"), np.eye(2))])
    beliefs = mean_field_graph(model)
    assert beliefs.marginals["x"].tolist() == beliefs.marginals["y"].tolist() == [0, 1]
    assert beliefs.free_energy[-1] == pytest.approx(-np.log(0.7))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"iterations": 0}, "iterations: expected at least 1"),
        ({"given": {"w": 0}}, "found w"),
        ({"given": {"m1": 1, "m2": 1, "z": 0}}, "it can't happen"),
    ],
)
def test_wrong_arguments_are_refused(arguments, says):
    with pytest.raises(ArgumentError, match=says):
        mean_field_graph(one_of_you(), **arguments)
