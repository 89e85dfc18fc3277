"""How one cell gets its label: errors by themselves and shared ones, against binomial sums."""

import pytest
from scipy.stats import binom
from worlds.lecture_09_label import LabelWorld, wrong_label


@pytest.mark.parametrize("returns", [1, 3, 5])
def test_a_shared_error_is_never_outvoted(returns):
    right, off = binom.sf(returns // 2, returns, [0.1, 0.9])
    for shared in (0.0, 0.1):
        world = LabelWorld(returns, alone=0.1, shared=shared)
        assert wrong_label(world) == pytest.approx((1 - shared) * right + shared * off, abs=1e-12)
    assert wrong_label(LabelWorld(returns, alone=0.0, shared=0.1)) == pytest.approx(0.1, abs=1e-12)
