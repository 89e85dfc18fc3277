import numpy as np
import pytest

from semgrid_edu.errors import ArgumentError
from semgrid_edu.training.loss import class_frequencies, median_frequency_weights


def test_frequencies_and_weights_by_hand():
    # Class 0: 15 of 24 cells; class 1: 3 of the 16 in whose maps it occurs; class 2: 6 of 8; class 3: none.
    maps = np.array([[[0, 0, 0, 0], [0, 0, 0, 1]], [[0, 0, 0, 0], [0, 0, 1, 1]], [[0, 0, 2, 2], [2, 2, 2, 2]]])
    f = np.array([15 / 24, 3 / 16, 6 / 8, 0])
    np.testing.assert_allclose(class_frequencies(maps, 4), f)
    np.testing.assert_allclose(median_frequency_weights(maps, 4), [1, 15 / 24 * 16 / 3, 15 / 24 * 8 / 6, 0])
    np.testing.assert_allclose(median_frequency_weights(maps, 4, limit=2)[1], 2)


def test_unlabelled_cells_count_nowhere():
    maps = [np.array([0, 1, 1, 255, 255]), np.array([255, 0])]
    np.testing.assert_allclose(class_frequencies(maps, 2), [2 / 4, 2 / 3])


def test_balanced_classes_weigh_the_same():
    np.testing.assert_allclose(median_frequency_weights([np.arange(6) % 3], 3), 1)


@pytest.mark.parametrize("wrong", [3, 254, -1])
def test_wrong_labels_are_named(wrong):
    with pytest.raises(ArgumentError, match=r"maps: expected classes 0..2 or 255, found .* in map 1"):
        class_frequencies([np.array([0, 1]), np.array([0, wrong])], 3)


def test_no_labels_at_all_are_refused():
    with pytest.raises(ArgumentError, match="at least one labelled cell"):
        median_frequency_weights([np.full(4, 255)], 3)
