"""Which errors a vote can remove: a binomial sum, and errors that gather in the same cells."""

import numpy as np
import pytest
from scipy.stats import binom
from worlds.lecture_09_votes import COUNTS, KINDS, MOST, RATE, count_votes

from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.grid import GridSpec


@pytest.fixture(scope="module")
def found():
    drive = sample_drive()
    return {kind: count_votes([drive[10]], GridSpec.compact(), kind) for kind in KINDS}


def test_errors_of_returns_by_themselves_are_independent_and_are_outvoted(found):
    votes = found["each return by itself"]
    assert votes.one == pytest.approx(RATE, abs=0.02)
    assert votes.another == pytest.approx(RATE, abs=0.03)
    assert votes.changed[0] == pytest.approx(RATE, abs=0.03)
    assert binom.sf(MOST // 2, MOST, RATE) < votes.changed[-1] < 0.3 * votes.changed[0]  # more in cells of two classes


@pytest.mark.parametrize("kind", list(KINDS)[1:])
def test_errors_at_outlines_come_together(found, kind):
    assert found[kind].another > 2 * found[kind].one


def test_what_is_shared_comes_together_more_often(found):
    assert found["outlines drawn off"].another > found["outlines, each pixel anew"].another
    assert found["the camera off"].another > found["a camera for each return"].another


def test_the_same_draw_gives_the_same_votes(found):
    again = count_votes([sample_drive()[10]], GridSpec.compact(), "the camera off")
    np.testing.assert_array_equal(again.changed, found["the camera off"].changed)
    assert again.changed.shape == (len(COUNTS),)
