import numpy as np
import pytest
import torch

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import unit_image


def test_every_byte_becomes_its_share_of_255():
    image = torch.arange(256, dtype=torch.uint8).reshape(1, 1, 16, 16)
    scaled = unit_image(image)
    assert scaled.shape == image.shape
    assert scaled.dtype == torch.float32
    np.testing.assert_array_equal(scaled.numpy().ravel(), np.arange(256, dtype=np.float32) / np.float32(255))


def test_an_image_that_was_scaled_before_is_refused():
    image = torch.zeros(3, 4, 5, dtype=torch.uint8)
    with pytest.raises(ArgumentError, match=r"image: expected bytes.*found torch.float32"):
        unit_image(unit_image(image))
