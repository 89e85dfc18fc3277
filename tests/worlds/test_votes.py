"""Which errors a vote can remove: a binomial sum, and errors that gather where an outline passes."""

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


def test_errors_of_returns_by_themselves_are_as_frequent_everywhere_and_are_outvoted(found):
    votes = found["each return by itself"]
    assert votes.wrong == pytest.approx([RATE, RATE], abs=0.02)
    one, several, of_all = votes.changed
    assert one[-1] == pytest.approx(binom.sf(MOST // 2, MOST, RATE), abs=0.002)
    assert one[-1] < of_all[-1] < several[-1]


@pytest.mark.parametrize("kind", list(KINDS)[1:])
def test_other_errors_gather_where_an_outline_passes(found, kind):
    assert found[kind].wrong[1] > 4 * found[kind].wrong[0]


def test_what_is_shared_is_outvoted_less(found):
    shared, own = found["the camera off"].changed[2], found["a camera for each return"].changed[2]
    assert shared[-1] / shared[0] > own[-1] / own[0]


def test_a_wide_margin_is_changed_less_and_one_vote_alone_doesnt_see_it(found):
    one_vote, all_votes = found["each return by itself"].by_margin.T
    assert all_votes[-1] < 0.1 * all_votes[0]
    assert one_vote.mean() == pytest.approx(RATE, abs=0.02)


def test_all_cells_are_those_of_one_class_and_of_several(found):
    for votes in found.values():
        one, several, of_all = votes.changed
        np.testing.assert_allclose(of_all, (1 - votes.several) * one + votes.several * several)


def test_the_same_draw_gives_the_same_votes(found):
    again = count_votes([sample_drive()[10]], GridSpec.compact(), "the camera off")
    np.testing.assert_array_equal(again.changed, found["the camera off"].changed)
    assert again.changed.shape == (3, len(COUNTS))
