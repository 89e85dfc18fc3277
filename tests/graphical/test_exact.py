"""Exact inference: against the sum over every assignment, and against pyagrum (test_pyagrum.py)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_models import assignments, chain, one_of_you, random_directed, random_undirected, some_evidence

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import (
    Factor,
    GraphicalModel,
    eliminate,
    enumerate_marginals,
    log_total,
    max_product,
    min_fill_order,
)

SEEDS = st.integers(0, 10**6)
MODELS = st.sampled_from([random_directed, random_undirected])
ZEROS = st.sampled_from([0.0, 0.3])


@pytest.mark.parametrize("inference", [enumerate_marginals, eliminate])
def test_without_variables_the_total_is_left(inference):
    """Z of two tied spins by hand: 2 (e + 1/e)."""
    tied = GraphicalModel([Factor(("a", "b"), np.exp([[1, -1], [-1, 1]]))])
    assert inference(tied, ()).table == pytest.approx(2 * (np.e + 1 / np.e))
    assert inference(one_of_you(), (), given={"m1": 1, "m2": 0, "z": 1}).table == pytest.approx(0.16)


def test_impossible_evidence_has_probability_zero():
    nothing = eliminate(one_of_you(), "m1", given={"m2": 1, "z": 0})
    assert nothing.table.tolist() == [0, 0]
    with pytest.raises(ArgumentError, match="no assignment agrees"):
        nothing.normalised()


@settings(max_examples=40, deadline=None)
@given(MODELS, SEEDS, ZEROS)
def test_elimination_is_the_sum_over_every_assignment(make, seed, zeros):
    model = make(seed, zeros=zeros)
    evidence, hidden = some_evidence(model, seed) if eliminate(model, ()).table > 0 else ({}, model.names)
    names = hidden[:2][::-1]
    wanted = enumerate_marginals(model, names, evidence)
    np.testing.assert_allclose(eliminate(model, names, evidence).table, wanted.table, rtol=1e-12)
    order = np.random.default_rng(seed).permutation(hidden[2:]).tolist()
    found = eliminate(model, names, evidence, order=order)
    assert found.names == tuple(names)
    np.testing.assert_allclose(found.table, wanted.table, rtol=1e-12)


def test_min_fill_takes_the_ends_of_a_star_before_its_centre():
    star = GraphicalModel([Factor(("c", f"l{k}"), np.ones((2, 2))) for k in range(5)])
    assert min_fill_order(star).index("c") >= 4
    assert min_fill_order(star, keep=["c"]) == ("l0", "l1", "l2", "l3", "l4")


def test_min_fill_solves_a_tree_of_300_variables_and_a_bad_order_is_refused_before_it_fills_memory():
    model = GraphicalModel([Factor((f"v{k // 3}", f"v{k}"), [[2, 1], [1, 2]]) for k in range(1, 300)])
    np.testing.assert_allclose(eliminate(model, "v7").normalised().table, [0.5, 0.5])
    star = GraphicalModel([Factor(("c", f"l{k}"), np.ones((2, 2))) for k in range(30)])
    with pytest.raises(ArgumentError, match=r"clique \(c, l0, .*, l29\): .* found 2,147,483,648"):
        eliminate(star, (), order=["c", *(f"l{k}" for k in range(30))])


@settings(max_examples=40, deadline=None)
@given(MODELS, SEEDS, ZEROS)
def test_max_product_finds_the_largest_of_all_weights(make, seed, zeros):
    model = make(seed, zeros=zeros)
    evidence, hidden = some_evidence(model, seed) if eliminate(model, ()).table > 0 else (None, None)
    if evidence is None:
        with pytest.raises(ArgumentError):
            max_product(model)
        return
    found = max_product(model, evidence)
    assert list(found) == hidden
    agreeing = [a for a in assignments(model) if evidence.items() <= a.items()]
    assert model.weight(evidence | found) == pytest.approx(max(map(model.weight, agreeing)), rel=1e-12)


def test_ties_are_broken_together():
    """Unequal neighbours in a ring of four: two labellings are best, and argmaxes of marginals are none of them."""
    differ = np.array([[1, 2], [2, 1]])
    ring = GraphicalModel([Factor((f"v{k}", f"v{(k + 1) % 4}"), differ) for k in range(4)])
    assert list(max_product(ring).values()) in ([0, 1, 0, 1], [1, 0, 1, 0])


def viterbi(first, move, read, seen):
    """The textbook recursion in logarithms."""
    score, back = np.log(first * read[:, seen[0]]), []
    for z in seen[1:]:
        candidates = score[:, None] + np.log(move)
        back.append(candidates.argmax(axis=0))
        score = candidates.max(axis=0) + np.log(read[:, z])
    path = [int(score.argmax())]
    for pointers in reversed(back):
        path.append(int(pointers[path[-1]]))
    return path[::-1]


@pytest.mark.parametrize("steps", [1, 5, 400])
def test_on_a_chain_max_product_is_viterbi(steps):
    """400 steps with 30 readings have a probability below 1e-308: only rescaled products reach the end."""
    model, first, move, read = chain(steps, seed=4, states=4, symbols=30)
    seen = np.random.default_rng(1).integers(0, 30, size=steps).tolist()
    found = max_product(model, {f"z{t}": z for t, z in enumerate(seen)})
    assert [found[f"x{t}"] for t in range(steps)] == viterbi(first, move, read, seen)


def test_what_a_long_chain_read_is_too_improbable_for_a_float_but_not_for_its_logarithm():
    """The forward recursion adds up log P(z_t | earlier readings)."""
    model, first, move, read = chain(250, seed=4, symbols=30)
    seen = np.random.default_rng(1).integers(0, 30, size=250).tolist()
    known = {f"z{t}": z for t, z in enumerate(seen)}
    belief, wanted = first, 0.0
    for t, z in enumerate(seen):
        belief = (belief @ move if t else belief) * read[:, z]
        wanted, belief = wanted + np.log(belief.sum()), belief / belief.sum()
    assert wanted < np.log(1e-308)
    assert log_total(model, known) == pytest.approx(wanted, rel=1e-12)
    last = [np.exp(log_total(model, known | {"x249": k}) - wanted) for k in range(3)]
    np.testing.assert_allclose(last, belief, rtol=1e-9)
    with pytest.raises(ArgumentError, match=rf"log_total .* found about 10\^{wanted / np.log(10):.0f}"):
        eliminate(model, "x7", known)


@pytest.mark.parametrize("entry", [1e-10, 1e10])
def test_a_hundred_factors_around_one_variable_neither_vanish_nor_overflow(entry):
    star = GraphicalModel([Factor("x", [entry, 3 * entry])] + [Factor("x", [entry, entry])] * 99)
    assert log_total(star) == pytest.approx(100 * np.log(entry) + np.log(4))
    assert max_product(star) == {"x": 1}
    with pytest.raises(ArgumentError, match="log_total"):
        eliminate(star, "x")


def test_the_logarithm_of_the_impossible():
    assert log_total(one_of_you(), {"m2": 1, "z": 0}) == -np.inf


@pytest.mark.parametrize("inference", [enumerate_marginals, eliminate])
def test_wrong_questions_are_refused(inference):
    for names, evidence, says in (
        ("w", {}, "found w"),
        (("m1", "m1"), {}, "each variable once"),
        ("z", {"z": 1}, "z, which is given as 1"),
        ("m1", {"w": 1}, "found w"),
        ("m1", {"z": 5}, "given z"),
    ):
        with pytest.raises(ArgumentError, match=says):
            inference(one_of_you(), names, evidence)


def test_an_order_must_name_what_is_summed_out():
    with pytest.raises(ArgumentError, match="order: expected each variable to sum out once: m2, z, found m2"):
        eliminate(one_of_you(), "m1", order=["m2"])


def test_too_many_assignments_are_refused_by_count():
    coins = GraphicalModel([Factor(f"v{k}", [0.5, 0.5]) for k in range(20)])
    with pytest.raises(ArgumentError, match="found 1,048,576"):
        enumerate_marginals(coins, "v0")
    assert eliminate(coins, "v0").table.tolist() == [0.5, 0.5]


def test_the_most_likely_assignment_of_the_impossible_is_refused():
    with pytest.raises(ArgumentError, match=r"factor P\(z \| m1, m2\): .* it can't happen"):
        max_product(one_of_you(), {"m1": 1, "m2": 1, "z": 0})
    never = GraphicalModel([Factor(("a", "b"), np.eye(2)), Factor(("a", "b"), 1 - np.eye(2))])
    with pytest.raises(ArgumentError, match="no assignment agrees"):
        max_product(never)
