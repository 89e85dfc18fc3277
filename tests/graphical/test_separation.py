"""d-separation: what it promises about numbers, and its reasons; `test_pyagrum` has it against an oracle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_models import one_of_you, random_directed, random_undirected

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, GraphicalModel, d_separated, eliminate, why_dependent


def test_in_undirected_models_paths_are_cut_by_what_is_given():
    ring = GraphicalModel([Factor((f"v{k}", f"v{(k + 1) % 4}"), [[2, 1], [1, 2]]) for k in range(4)])
    assert d_separated(ring, "v0", "v2", given=("v1", "v3"))
    assert why_dependent(ring, "v0", "v2", given="v1") == ("v0", "v3", "v2")
    assert why_dependent(GraphicalModel([Factor("a", [1, 1]), Factor("b", [1, 1])]), "a", "b") is None


def dependence(model, a, b, known):
    """The largest |P(a, b | known) - P(a | known) P(b | known)|, over all states of all three groups."""
    joint = eliminate(model, (*known, a, b)).table
    joint = joint.reshape(-1, *joint.shape[-2:])
    joint = joint[joint.sum(axis=(1, 2)) > 0]
    joint /= joint.sum(axis=(1, 2), keepdims=True)
    return abs(joint - joint.sum(axis=2, keepdims=True) * joint.sum(axis=1, keepdims=True)).max()


@settings(max_examples=80, deadline=None)
@given(st.sampled_from([random_directed, random_undirected]), st.integers(0, 10**6), st.integers(0, 3))
def test_separated_variables_are_independent_and_others_are_not(make, seed, count):
    """The converse holds for almost all tables, and random ones are such."""
    model = make(seed)
    a, b, *known = np.random.default_rng(seed).permutation(model.names)[: 2 + count].tolist()
    if d_separated(model, a, b, known):
        assert dependence(model, a, b, known) < 1e-12
    else:
        assert dependence(model, a, b, known) > 1e-9
    assert d_separated(model, a, b, known) == d_separated(model, b, a, known)


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 3))
def test_every_variable_on_the_path_lets_influence_pass(seed, count):
    model = random_directed(seed, variables=8)
    a, b, *known = np.random.default_rng(seed).permutation(model.names)[: 2 + count].tolist()
    path = why_dependent(model, a, b, known)
    if path is None:
        return
    assert (path[0], path[-1]) == (a, b)
    assert len(set(path)) == len(path)
    arrows = [(above, child) for child, family in model.parents.items() for above in family]
    for one, inner, other in zip(path, path[1:], path[2:], strict=False):
        assert (one, inner) in arrows or (inner, one) in arrows
        if (one, inner) in arrows and (other, inner) in arrows:
            below = {inner}
            for _ in model.names:
                below |= {child for above, child in arrows if above in below}
            assert below & set(known)
        else:
            assert inner not in known


@pytest.mark.parametrize(
    ("groups", "says"),
    [(("w", "m1"), "found w"), (("m1", "m1"), "in one of the three"), (("m1", "m2", "m2"), "in one of the three")],
)
def test_wrong_groups_are_refused(groups, says):
    with pytest.raises(ArgumentError, match=says):
        d_separated(one_of_you(), *groups)
