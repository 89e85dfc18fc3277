"""Which errors a vote can remove: a binomial sum, and errors that gather where an outline passes."""

import numpy as np
import pytest
from scipy.stats import binom
from worlds.lecture_09_votes import KINDS, MOST, RATE, count_votes

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


def test_all_cells_are_those_of_one_class_and_of_several(found):
    for votes in found.values():
        one, several, of_all = votes.changed
        np.testing.assert_allclose(of_all, (1 - votes.several) * one + votes.several * several)
