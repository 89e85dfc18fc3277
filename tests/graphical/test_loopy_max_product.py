"""Max-product messages: exact on trees, and how they differ from sums."""

import numpy as np
import pytest

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, GraphicalModel, loopy_max_product, max_product


def chain(seed, states=(2, 3, 4, 2)):
    rng = np.random.default_rng(seed)
    names = [f"x{k}" for k in range(len(states))]
    own = [Factor(name, rng.random(n)) for name, n in zip(names, states, strict=True)]
    pairs = [Factor(names[k : k + 2], rng.random(states[k : k + 2])) for k in range(len(states) - 1)]
    return GraphicalModel([*own, *pairs])


@pytest.mark.parametrize("seed", range(10))
def test_on_a_tree_beliefs_are_max_marginals_and_their_best_states_the_best_assignment(seed):
    model = chain(seed)
    joint = np.einsum("a,b,c,d,ab,bc,cd->abcd", *(factor.table for factor in model.factors))
    found = loopy_max_product(model)
    assert found.exact
    for axis, name in enumerate(model.names):
        expected = joint.max(axis=tuple(k for k in range(4) if k != axis))
        np.testing.assert_allclose(found.marginals[name], expected / expected.sum())
    assert {name: int(p.argmax()) for name, p in found.marginals.items()} == max_product(model)


def test_with_loops_it_does_not_claim_to_be_exact():
    pairs = [Factor(pair, [[2.0, 1.0], [1.0, 2.0]]) for pair in (("a", "b"), ("b", "c"), ("a", "c"))]
    found = loopy_max_product(GraphicalModel([Factor("a", [0.6, 0.4]), *pairs]))
    assert not found.exact
    assert all(p.argmax() == 0 for p in found.marginals.values())


def test_bad_arguments_are_named():
    with pytest.raises(ArgumentError, match="damping"):
        loopy_max_product(chain(0), damping=1.0)
    with pytest.raises(ArgumentError, match="iterations"):
        loopy_max_product(chain(0), iterations=0)
