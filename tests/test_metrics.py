import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from sklearn import metrics as sklearn_metrics
from torchmetrics.classification import MulticlassAccuracy, MulticlassJaccardIndex

from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import (
    class_accuracy,
    class_iou,
    confusion_matrix,
    frequency_weighted_iou,
    pixel_accuracy,
    semantic_cells,
)

# Counted by hand: three cells of class 0 (one of them called 1), two of class 1, none of class 2.
TRUTH = np.array([[0, 0, 0], [1, 1, 255]], dtype=np.uint8)
PREDICTED = np.array([[0, 0, 1], [1, 2, 0]])
BY_HAND = [[2, 1, 0], [0, 1, 1], [0, 0, 0]]


def test_confusion_counted_by_hand():
    np.testing.assert_array_equal(confusion_matrix(TRUTH, PREDICTED, 3), BY_HAND)


def test_metrics_computed_by_hand():
    assert pixel_accuracy(BY_HAND) == pytest.approx(3 / 5)
    assert class_accuracy(BY_HAND) == pytest.approx((2 / 3 + 1 / 2) / 2)  # class 2 has no truth
    assert frequency_weighted_iou(BY_HAND) == pytest.approx(3 / 5 * 2 / 3 + 2 / 5 * 1 / 3)
    np.testing.assert_allclose(class_iou(BY_HAND), [2 / 3, 1 / 3, 0])  # class 2 is called once, wrongly
    assert np.isnan(class_iou([[1, 0], [0, 0]])[1])


def _random_maps(n_classes=6, seed=0):
    rng = np.random.default_rng(seed)
    truth, predicted = rng.integers(0, n_classes, (2, 40, 30))
    truth[rng.random(truth.shape) < 0.2] = 255
    return truth, predicted


def test_confusion_and_accuracies_agree_with_scikit_learn():
    truth, predicted = _random_maps()
    labelled = truth != 255
    ours = confusion_matrix(truth, predicted, 6)
    np.testing.assert_array_equal(ours, sklearn_metrics.confusion_matrix(truth[labelled], predicted[labelled]))
    assert pixel_accuracy(ours) == pytest.approx(sklearn_metrics.accuracy_score(truth[labelled], predicted[labelled]))
    expected = sklearn_metrics.balanced_accuracy_score(truth[labelled], predicted[labelled])
    assert class_accuracy(ours) == pytest.approx(expected)


def test_metrics_agree_with_torchmetrics():
    truth, predicted = _random_maps(seed=1)
    ours = confusion_matrix(truth, predicted, 6)
    pair = torch.from_numpy(predicted), torch.from_numpy(truth)
    for metric, mine in (
        (MulticlassAccuracy(6, average="micro", ignore_index=255), pixel_accuracy),
        (MulticlassAccuracy(6, average="macro", ignore_index=255), class_accuracy),
        (MulticlassJaccardIndex(6, average="weighted", ignore_index=255), frequency_weighted_iou),
    ):
        assert mine(ours) == pytest.approx(metric(*pair).item(), abs=1e-6)
    by_class = MulticlassJaccardIndex(6, average="none", ignore_index=255)(*pair)
    np.testing.assert_allclose(class_iou(ours), by_class, atol=1e-6)


@given(hnp.arrays(np.uint8, (5, 4), elements=st.sampled_from([0, 1, 2, 3, 255])))
def test_a_perfect_prediction_scores_one(truth):
    matrix = confusion_matrix(truth, truth, 4)
    for metric in (pixel_accuracy, class_accuracy, frequency_weighted_iou):
        score = metric(matrix)
        assert np.isnan(score) if (truth == 255).all() else score == pytest.approx(1)


def test_frames_add_up():
    truth, predicted = _random_maps(seed=2)
    halves = sum(confusion_matrix(truth[part], predicted[part], 6) for part in (slice(0, 20), slice(20, None)))
    np.testing.assert_array_equal(halves, confusion_matrix(truth, predicted, 6))


def test_semantic_cells_is_the_confusion_without_unknown_truth():
    rng = np.random.default_rng(3)
    truth, predicted = rng.integers(0, 14, (2, 500))
    only_semantic = np.where(truth >= 10, 255, truth)
    ours = semantic_cells(confusion_matrix(truth, predicted, 14), KITTI_14)
    np.testing.assert_array_equal(ours, confusion_matrix(only_semantic, predicted, 14))


def test_another_number_can_be_ignored():
    np.testing.assert_array_equal(confusion_matrix([0, 9, 1], [0, 0, 0], 2, ignore=9), [[1, 0], [1, 0]])


def test_what_is_predicted_on_unlabelled_cells_is_not_looked_at():
    np.testing.assert_array_equal(confusion_matrix([0, 255], [0, 200], 2), [[1, 0], [0, 0]])


@pytest.mark.parametrize(
    ("truth", "predicted", "message"),
    [
        ([0, 1], [0, 1, 1], "predicted: expected the shape of truth"),
        ([0, 2], [0, 1], r"truth: expected classes 0..1 .* found 0..2"),
        ([0, -1], [0, 1], "truth: expected classes 0..1"),
        ([0, 1], [0, 255], "predicted: expected classes 0..1"),
        ([0.0, 1.0], [0, 1], "truth: expected integer classes, found type float64"),
    ],
)
def test_wrong_labels_are_refused(truth, predicted, message):
    with pytest.raises(ArgumentError, match=message):
        confusion_matrix(truth, predicted, 2)


def test_a_matrix_of_another_shape_is_refused():
    with pytest.raises(ArgumentError, match="a square matrix"):
        pixel_accuracy(np.zeros((2, 3)))
    with pytest.raises(ArgumentError, match="14 classes of KITTI-14"):
        semantic_cells(np.zeros((3, 3)), KITTI_14)
