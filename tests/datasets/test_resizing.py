"""Smaller images and labels: averages and majorities of the pixels that they cover."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.frame import resize_image

labels = arrays(np.uint8, (12, 8), elements=st.sampled_from([0, 3, 13, 255]))


@given(arrays(np.uint8, (12, 8, 3)))
def test_pixel_is_the_mean_of_its_block(image):
    blocks = image.reshape(4, 3, 4, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(resize_image(image, (4, 4)), blocks, atol=1)


@settings(deadline=None)
@given(labels)
def test_label_is_the_most_frequent_of_its_block(labels):
    blocks = labels.reshape(4, 3, 4, 2).swapaxes(1, 2).reshape(16, 6)
    expected = [max(sorted(set(block)), key=list(block).count) for block in blocks.tolist()]
    np.testing.assert_array_equal(resize_labels(labels, (4, 4)).ravel(), expected)


@settings(deadline=None)
@given(labels)
def test_sparse_labels_outvote_what_is_unlabelled(labels):
    blocks = labels.reshape(4, 3, 4, 2).swapaxes(1, 2).reshape(16, 6)
    known = [[c for c in block if c != 255] or [255] for block in blocks.tolist()]
    expected = [max(sorted(set(block)), key=block.count) for block in known]
    np.testing.assert_array_equal(resize_labels(labels, (4, 4), sparse=True).ravel(), expected)


@given(labels)
def test_labels_invent_no_class_at_any_size(labels):
    resized = resize_labels(labels, (5, 3))
    assert resized.shape == (5, 3)
    assert np.isin(resized, labels).all()
