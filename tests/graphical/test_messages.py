"""Sum-product: exact on trees, the recursions of filtering on a chain, and honest about loops."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_models import chain, one_of_you, random_tree, random_undirected, some_evidence

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, GraphicalModel, eliminate, sum_product


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_on_trees_it_is_exact_after_one_iteration(seed):
    model = random_tree(seed)
    evidence, hidden = some_evidence(model, seed)
    beliefs = sum_product(model, evidence)
    assert beliefs.exact
    assert beliefs.iterations <= 2
    assert list(beliefs.marginals) == hidden
    for name, belief in beliefs.marginals.items():
        np.testing.assert_allclose(belief, eliminate(model, name, evidence).normalised().table, atol=1e-12)
        np.testing.assert_array_equal(belief, sum_product(model, evidence, iterations=1).marginals[name])


def test_damping_reaches_the_same_on_a_tree():
    model = random_tree(3)
    damped = sum_product(model, iterations=200, damping=0.5)
    assert damped.exact
    for name, belief in sum_product(model).marginals.items():
        np.testing.assert_allclose(damped.marginals[name], belief, atol=1e-8)


def filtered(first, move, read, seen):
    """P(x_t | z_0 ... z_t) by the recursion of Bayes' filter."""
    belief, beliefs = first, []
    for t, z in enumerate(seen):
        belief = (belief @ move if t else belief) * read[:, z]
        belief = belief / belief.sum()
        beliefs.append(belief)
    return beliefs


def smoothed(first, move, read, seen):
    """P(x_t | all readings): forward times backward."""
    backward, beliefs = np.ones(len(first)), []
    for t, forward in reversed(list(enumerate(filtered(first, move, read, seen)))):
        beliefs.append(forward * backward / (forward @ backward))
        backward = move @ (read[:, seen[t]] * backward)
        backward /= backward.sum()
    return beliefs[::-1]


@pytest.mark.parametrize("steps", [4, 400])
def test_forward_messages_filter_and_beliefs_smooth(steps):
    """The long chain has a probability below 1e-308: messages that aren't normalised would vanish."""
    model, first, move, read = chain(steps, seed=7, symbols=30)
    seen = np.random.default_rng(2).integers(0, 30, size=steps).tolist()
    beliefs = sum_product(model, {f"z{t}": z for t, z in enumerate(seen)})
    assert beliefs.exact
    for t, belief in enumerate(filtered(first, move, read, seen)[:-1]):
        np.testing.assert_allclose(beliefs.messages[f"x{t}", f"P(x{t + 1} | x{t})"], belief, atol=1e-12)
    for t, belief in enumerate(smoothed(first, move, read, seen)):
        np.testing.assert_allclose(beliefs.marginals[f"x{t}"], belief, atol=1e-12)


def ring(strength, size=4):
    rng = np.random.default_rng(0)
    tie = np.exp([[strength, -strength], [-strength, strength]])
    factors = [Factor((f"v{k}", f"v{(k + 1) % size}"), tie) for k in range(size)]
    return GraphicalModel(factors + [Factor(f"v{k}", rng.dirichlet([3, 3])) for k in range(size)])


def test_a_loop_is_approximate_and_says_so():
    """The weaker the ties, the nearer to exact; a known variable cuts the ring open, and then it is exact."""
    errors = {}
    for strength in (0.05, 0.8):
        model = ring(strength)
        beliefs = sum_product(model, iterations=500)
        assert beliefs.converged
        assert not beliefs.exact
        exact = eliminate(model, "v0").normalised().table
        errors[strength] = abs(beliefs.marginals["v0"] - exact).max()
    assert errors[0.05] < 1e-4 < errors[0.8]
    opened = sum_product(ring(0.8), {"v2": 1})
    assert opened.exact
    np.testing.assert_allclose(opened.marginals["v0"], eliminate(ring(0.8), "v0", {"v2": 1}).normalised().table)


@pytest.mark.parametrize("seed", range(5))
def test_beliefs_and_messages_are_distributions(seed):
    beliefs = sum_product(random_undirected(seed), iterations=5)
    for table in (*beliefs.marginals.values(), *beliefs.messages.values()):
        assert table.sum() == pytest.approx(1)
        assert (table >= 0).all()


def test_two_factors_over_the_same_pair_are_a_loop():
    tie = Factor(("x", "y"), [[2, 1], [1, 2]])
    assert not sum_product(GraphicalModel([tie, tie])).exact
    assert sum_product(GraphicalModel([tie * tie])).exact


def test_many_factors_around_one_variable_do_not_vanish():
    star = GraphicalModel([Factor("x", [1e-9, 3e-9]), *([Factor("x", [1e-9, 1e-9])] * 99)])
    np.testing.assert_allclose(sum_product(star).marginals["x"], [0.25, 0.75])


def test_factors_that_contradict_each_other_are_refused():
    with pytest.raises(ArgumentError, match="no assignment agrees"):
        sum_product(GraphicalModel([Factor("x", [0, 1]), Factor("x", [1, 0])]))


def test_a_factor_of_three_variables_of_different_sizes():
    """Messages to each of three axes, by hand: the table times the other two priors, summed."""
    rng = np.random.default_rng(0)
    table, priors = rng.random((2, 3, 4)), [rng.dirichlet(np.ones(k)) for k in (2, 3, 4)]
    model = GraphicalModel([Factor(tuple("abc"), table), *map(Factor, "abc", priors)])
    messages = sum_product(model).messages
    a, b, c = priors
    for name, wanted in zip(
        "abc", (table @ c @ b, a @ (table @ c), (a @ table.reshape(2, 12)).reshape(3, 4).T @ b), strict=True
    ):
        np.testing.assert_allclose(messages["f(a, b, c)", name], wanted / wanted.sum(), rtol=1e-12)


def test_a_variable_called_like_a_factor_is_refused():
    with pytest.raises(ArgumentError, match=r"called like a factor, found f\(x\)"):
        sum_product(GraphicalModel([Factor("x", [1, 2]), Factor("f(x)", [1, 2])]))


def test_it_stops_when_told():
    stopped = sum_product(ring(0.8), iterations=1)
    assert (stopped.iterations, stopped.converged, stopped.exact) == (1, False, False)


def test_variables_without_factors_left_and_models_without_variables():
    beliefs = sum_product(GraphicalModel([Factor("x", [1, 3]), Factor("y", [1, 1])]), {"y": 0})
    assert beliefs.marginals["x"].tolist() == [0.25, 0.75]
    assert sum_product(GraphicalModel([Factor("y", [1, 1])]), {"y": 0}).marginals == {}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"iterations": 0}, "iterations: expected at least 1"),
        ({"damping": 1.0}, "damping: expected 0 <= damping < 1"),
        ({"given": {"w": 0}}, "found w"),
        ({"given": {"m1": 1, "z": 0}}, r"factor P\(z \| m1, m2\)"),
        ({"given": {"m1": 1, "m2": 1, "z": 0}}, "only zeros: it can't happen"),
    ],
)
def test_wrong_arguments_are_refused(arguments, says):
    with pytest.raises(ArgumentError, match=says):
        sum_product(one_of_you(), **arguments)
